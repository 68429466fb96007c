"""Manoeuvring trials: their guidance, and their measures against closed forms."""

import io
import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console
from scipy.optimize import brentq
from support.command import command
from support.project import COMPONENTS, ROOT, with_values
from support.ships import PROPELLER, SHIPS, described, part, scaled

import cosim
from cosim.metrics import main as metrics_main
from cosim.trials import MEASURES, executes, measure, outcome, passage, sheet
from cosim.trials.measures import limits
from cosim.trials.trial_outcome import TrialOutcome
from cosim.trials.trial_picture import draw_trial
from fmus.declare import packer, variables
from fmus.ship import ship
from fmus.signals import Force, VelocityInCurrent
from fmus.sizing import sized

ORDERS = ("gauss_seidel", "jacobi")


def load(name, algorithm):
    """A shipped scenario with an order of exchange."""
    content = json.loads((ROOT / "scenarios" / f"{name}.json").read_text())
    return cosim.load_scenario(content | {"algorithm": algorithm})


OTTER = SHIPS["otter"]
DEG = math.radians(1.0)
KINDS = ("circle", "spiral", "stop", "zigzag")


# Ships whose answer is known: the guidance moves them, the measures are held against closed forms


def nomoto(kind, seconds, T=5.0, K=0.1, U=1.0, drift=0.0, h=0.01, rate=None, **values):
    """A ship of Nomoto, T r_dot + r = K order, at a constant speed, under a trial.

    Args:
        rate: r [rad/s] -> what stands in place of r in the equation of Nomoto.
    """
    guidance = COMPONENTS[f"guidance_{kind}"]
    p = with_values(guidance, start=3.0, **values)
    x = y = psi = r = 0.0
    s, rows = None, []
    for k in range(round(seconds / h)):
        inputs = guidance.inputs(psi) if kind == "zigzag" else guidance.inputs()
        s = s or guidance.init(inputs, p)
        s, stated = guidance.step(s, inputs, p, h)
        rows.append((k * h, x, y, psi, stated.order))
        bent = r if rate is None else rate(r)
        before = r
        r += h * (K * stated.order - bent) / T
        middle = psi + 0.25 * h * (before + r)
        x, y = x + h * U * math.cos(middle + drift), y + h * U * math.sin(middle + drift)
        psi += 0.5 * h * (before + r)
    return passage(*np.array(rows).T)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("T", "K", "check"), [(5.0, 0.1, 10 * DEG), (1.0, 0.3, 20 * DEG)])
def test_the_overshoots_are_those_of_nomoto(T, K, check, side):
    """T r - K T ln(1 + r / K): from the reversal at the rate r on, until the ship turns no more."""

    def turned(t):
        return K * (t - T * (1.0 - math.exp(-t / T)))

    t: float = brentq(lambda t: turned(t) - check, 0.0, 100.0)  # pyright: ignore
    r = K * (1.0 - math.exp(-t / T))
    found = measure("zigzag", nomoto("zigzag", 120.0, T, K, psi_check=check, side=side), 1.0)
    assert found["check_angle"] == pytest.approx(check, abs=0.01 * K)
    assert found["initial_turning_time"] == pytest.approx(t, abs=0.011)
    assert found["initial_turning"] == pytest.approx(t, abs=0.011)
    assert found["overshoot_1"] == pytest.approx(T * r - K * T * math.log1p(r / K), rel=0.01)
    assert found["overshoot_time_1"] == pytest.approx(T * math.log1p(r / K), abs=0.02)
    assert found["overshoot_2"] > found["overshoot_1"]
    assert found["period"] > 2.0 * found["overshoot_time_2"]
    assert found["approach_speed"] == pytest.approx(1.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("drift", [0.0, -0.2])
def test_a_turn_without_lag_is_a_circle(drift, side):
    """Seen along the heading, a ship that drifts by beta goes round a centre that lies by beta ahead."""
    U, K = 2.0, 0.1
    p = nomoto("circle", 120.0, 0.011, K, U, side * drift, side=side)
    found, R = measure("circle", p, 1.0), U / K
    s, c = math.sin(drift), math.cos(drift)
    assert found["advance"] == pytest.approx(R * (c - s), rel=0.01)
    assert found["transfer"] == pytest.approx(R * (c + s), rel=0.01)
    assert found["tactical_diameter"] == pytest.approx(2.0 * R * c, rel=0.01)
    assert found["time_90"] == pytest.approx(0.5 * math.pi / K, rel=0.01)
    assert found["circle_speed"] == pytest.approx(U, rel=1e-3)
    assert found["circle_rate"] == pytest.approx(K, rel=1e-3)
    assert found["circle_diameter"] == pytest.approx(2.0 * R, rel=1e-3)


def test_a_turn_tells_only_what_it_goes_far_enough_for():
    whole = nomoto("circle", 120.0, 0.5)
    names = [{*measure("circle", passage(*(column[:rows] for column in whole)), 1.0)}
             for rows in (1200, 2500, 4500, 6200, 7200)]  # fmt: skip
    assert names[0] == {"approach_speed"}
    assert names[1] - names[0] == {"advance", "transfer", "time_90"}
    assert names[2] - names[1] == {"tactical_diameter", "time_180"}
    assert names[3] == names[2], "not quite a whole turn"
    assert names[4] - names[3] == {"circle_speed", "circle_rate", "circle_diameter"}


def straight_then(order, psi, length=2.0, kind="circle", **measures):
    """A ship at 1 m/s that heads as told over a minute, its order put over after 10 s."""
    t = np.arange(0.0, 60.0, 0.1)
    course = psi(t) + 0.0 * t
    x, y = (5.0 + np.cumsum(0.1 * f(course)) for f in (np.cos, np.sin))
    return TrialOutcome(kind, passage(t, x, y, course, order(t)), length, measures, {})


@pytest.mark.parametrize("length", [2.0, 0.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_picture_of_a_turn_is_seen_along_the_first_heading(length, side):
    found = straight_then(
        lambda t: np.where(t > 10.0, 0.3 * side, 0.0),
        lambda t: 0.8 + side * 0.1 * np.maximum(t - 10.0, 0.0),
        length,
        advance=10.0,
        tactical_diameter=20.0,
    )
    track, heading, order = draw_trial(found).figure.axes
    ship, start, advance, diameter = track.get_lines()
    unit = length or 1.0
    aside, ahead = ship.get_xdata(), ship.get_ydata()
    assert aside[:100] == pytest.approx(0.0, abs=0.15), "straight ahead until the order is put over"
    assert ahead[0] == pytest.approx(-10.0 / unit, abs=0.1)
    assert aside[np.abs(aside).argmax()] == pytest.approx(side * 20.0 / unit, rel=0.02)
    assert ahead.max() == pytest.approx(10.0 / unit, rel=0.03)
    assert (start.get_xdata()[0], start.get_ydata()[0]) == (0.0, 0.0)
    assert list(advance.get_ydata()) == [10.0 / unit] * 2
    assert list(diameter.get_xdata()) == [side * 20.0 / unit] * 2
    assert track.get_xlabel() == f"to starboard [{'L' if length else 'm'}]"
    turned, put_over = heading.get_lines()
    assert turned.get_xdata()[0] == pytest.approx(-10.0, abs=0.15), "time since the order"
    assert turned.get_ydata()[-1] == pytest.approx(side * math.degrees(4.99), rel=0.01)
    assert list(put_over.get_xdata()) == [0.0, 0.0]
    (share,) = order.get_lines()
    assert (share.get_ydata().min(), share.get_ydata().max()) == (
        (0.0, 1.0) if side > 0.0 else (-1.0, 0.0)
    )
    (plain, _), *_ = [draw_trial(found._replace(measures={})).figure.axes[0].get_lines()]
    assert plain.get_ydata() == pytest.approx(ahead)


@pytest.mark.parametrize(("check", "limits"), [(0.17, ["10°", "25°"]), (0.26, [])])
def test_a_zigzag_has_an_axis_of_its_order_and_marks_at_its_overshoots(check, limits):
    """And the limits of IMO with their unit, or a sentence that there are none at this check angle."""
    found = outcome("zigzag", nomoto("zigzag", 200.0, 5.0, psi_check=check), 1.0)
    _, heading, order = draw_trial(found).figure.axes
    assert list(order.get_yticks()) == [-1.0, 0.0, 1.0]
    assert order.get_ylabel() == "order [1]"
    dots = [line for line in heading.get_lines() if line.get_marker() == "o"]
    angles = [x for n, x in found.measures.items() if re.fullmatch(r"overshoot_\d", n)]
    assert [t.get_text() for t in heading.texts] == [f"{math.degrees(x):.3g}°" for x in angles]
    tops = [check + x for x in angles]
    assert [abs(dot.get_ydata()[0]) for dot in dots] == pytest.approx(np.degrees(tops), rel=0.05)
    sentence = heading.get_title(loc="right")
    console = Console(width=100, record=True, file=io.StringIO())
    console.print(sheet(found))
    shown = console.export_text()
    assert "IMO limit" in shown
    above = [n for n, x in found.measures.items() if x > found.limits.get(n, math.inf)]
    assert shown.count("exceeded") == len(above)
    if limits:
        assert sentence == "IMO limit of overshoots: " + ", ".join(limits)
        assert "10 °" in shown
        assert above == ["initial_turning"]  # of a ship of 1 m within 25 m
        assert "MSC.137(76)" in shown
    else:
        assert sentence == "no IMO limit at a check angle of 14.9°, but at 10° and 20°"
        assert sentence in shown


def test_a_picture_of_a_stop_has_the_speed_and_of_a_spiral_the_rates():
    found = straight_then(lambda t: np.where(t > 10.0, -1.0, 0.0), lambda t: 0.2, kind="stop")
    speed = draw_trial(found).figure.axes[1]
    (line,) = speed.get_lines()
    assert line.get_ydata() == pytest.approx(1.0, rel=1e-6)
    assert line.get_xdata()[0] == pytest.approx(-10.0, abs=0.15)
    assert speed.get_ylabel() == "speed [m/s]"
    steps = [0.0, 0.3, 0.0, -0.3]
    found = straight_then(
        lambda t: np.array(steps)[(t / 15.0).astype(int)],
        lambda t: np.cumsum(0.1 * np.array([0.0, 0.04, 0.01, -0.02])[(t / 15.0).astype(int)]),
        kind="spiral",
    )
    rates = draw_trial(found).figure.axes[1]
    (line,) = rates.get_lines()
    assert line.get_xdata() == pytest.approx(steps[1:]), "the approach is left out"
    assert line.get_ydata() == pytest.approx(np.degrees([0.04, 0.01, -0.02]), rel=1e-3)
    assert (rates.get_xlabel(), rates.get_ylabel()) == ("order", "rate of turn [°/s]")


def test_a_pull_out_leaves_no_rate_of_a_stable_ship_and_some_of_an_unstable_one():
    left = []
    for rate in (lambda r: r, lambda r: 40.0 * r**3 - 0.4 * r):
        found = measure("circle", nomoto("circle", 400.0, 5.0, rate=rate, release=150.0), 1.0)
        left.append(found["residual_rate"])
        assert found["circle_rate"] > 0.09
    assert left == pytest.approx([0.0, 0.1], abs=1e-3)


def test_the_loop_of_a_spiral_is_that_of_the_unstable_rates():
    """r of K order = n r^3 - a r: without order r is 0, or sqrt(a / n) to the side it comes from."""
    spiral = {"plateaus": 4.0, "hold": 80.0}
    stable = measure("spiral", nomoto("spiral", 1400.0, 1.0, h=0.05, **spiral), 1.0)
    unstable = nomoto("spiral", 1400.0, 1.0, h=0.05, rate=lambda r: 40.0 * r**3 - 0.1 * r, **spiral)
    assert stable["loop_height"] == pytest.approx(0.0, abs=1e-5)
    assert stable["rate_starboard"] == pytest.approx(0.1, rel=1e-3)
    assert stable["rate_port"] == pytest.approx(-0.1, rel=1e-3)
    height = 2.0 * math.sqrt(0.1 / 40.0)
    assert measure("spiral", unstable, 1.0)["loop_height"] == pytest.approx(height, rel=0.01)


def test_a_spiral_that_turns_to_one_side_alone_has_rates_of_one_sign_and_no_loop():
    """r of 0.1 order = 40 r^3 - 2 r, which has a root above sqrt(1 / 60) at each order."""

    def root(order):
        return max(np.roots([40.0, 0.0, -2.0, -0.1 * order]).real)

    p = nomoto(
        "spiral", 1400.0, 1.0, h=0.05, rate=lambda r: 40.0 * r**3 - 2.0 * r, plateaus=4.0, hold=80.0
    )
    found = measure("spiral", p, 1.0)
    rates = [found["rate_port"], found["rate_starboard"]]
    assert np.abs(rates) == pytest.approx(
        sorted([root(-1.0), root(1.0)], reverse=rates[0] < 0.0), rel=1e-3
    )
    assert rates[0] * rates[1] > 0.0
    assert "loop_height" not in found


@given(st.floats(0.2, 5.0), st.floats(0.01, 0.5), st.floats(-3.0, 3.0))
def test_a_constant_deceleration_stops_by_its_closed_form(U, a, psi):
    time = np.arange(0.0, 10.0 + 1.5 * U / a, 0.01)
    since = np.maximum(time - 5.0, 0.0)
    way = U * time - 0.5 * a * since**2
    p = passage(time, way * np.cos(psi), way * np.sin(psi), 0.0 * time + psi, -1.0 * (time >= 5.0))
    found = measure("stop", p, 1.0)
    assert found["approach_speed"] == pytest.approx(U)
    assert found["stop_time"] == pytest.approx(U / a, abs=0.03)
    assert found["track_reach"] == pytest.approx(0.5 * U * U / a, rel=1e-3, abs=1e-3)
    assert found["head_reach"] == pytest.approx(found["track_reach"], abs=1e-3)
    assert found["side_reach"] == pytest.approx(0.0, abs=1e-9)


def test_an_order_is_put_over_when_it_leaves_its_value():
    """A rudder takes two seconds from side to side, is not quite still, and lies a little aside."""
    time = np.arange(0.0, 40.0, 0.05)
    wanted = np.interp(time, [0, 5, 6, 15, 17, 28, 30, 40], [0, 0, 1, 1, -1, -1, 1, 1])
    noise = 0.01 * np.random.default_rng(0).standard_normal(time.size)
    p = passage(time, time, 0.0 * time, 0.0 * time, 0.17 * (wanted + noise) + 0.005)
    assert executes(p) == pytest.approx([5.1, 15.1, 28.1], abs=0.1)


def test_the_measures_follow_the_size_and_forget_place_and_course():
    p = nomoto("circle", 90.0, 2.0)
    here = measure("circle", p, 1.0)
    c, s = math.cos(2.0), math.sin(2.0)
    x, y = 7.0 + c * p.x - s * p.y, -3.0 + s * p.x + c * p.y
    turned = measure("circle", passage(p.time, x, y, p.psi + 2.0 - 2.0 * math.pi, p.order), 1.0)
    assert turned == pytest.approx(here, rel=1e-9)
    large = measure("circle", passage(10.0 * p.time, 100.0 * p.x, 100.0 * p.y, p.psi, p.order), 100.0)
    at = {"m": 100.0, "s": 10.0, "m/s": 10.0, "rad/s": 0.1, "rad": 1.0}
    assert large == pytest.approx(
        {m.name: at[m.unit] * here[m.name] for m in MEASURES if m.name in here}
    )


def test_the_limits_are_those_of_the_resolution():
    turn = {"advance": 400.0, "tactical_diameter": 400.0, "transfer": 1.0}
    assert limits(turn, 100.0) == {"advance": 450.0, "tactical_diameter": 500.0}
    assert limits({"track_reach": 1.0}, 100.0) == {"track_reach": 1500.0}
    for seconds, first, second in ((5.0, 10.0, 25.0), (20.0, 15.0, 32.5), (60.0, 20.0, 40.0)):
        found = {"check_angle": 10 * DEG, "approach_speed": 100.0 / seconds, "overshoot_1": 0.1,
                 "overshoot_2": 0.1, "initial_turning": 1.0}  # fmt: skip
        assert limits(found, 100.0) == pytest.approx(
            {"overshoot_1": first * DEG, "overshoot_2": second * DEG, "initial_turning": 250.0}
        )
    twenty = {"check_angle": 20 * DEG, "approach_speed": 5.0, "overshoot_1": 0.1, "overshoot_2": 0.1}
    assert limits(twenty, 100.0) == pytest.approx({"overshoot_1": 25 * DEG})
    assert limits({**twenty, "check_angle": 5 * DEG}, 100.0) == {}


ONES = np.ones(5)


@pytest.mark.parametrize(
    ("kind", "columns", "message"),
    [
        ("zig-zag", (range(5), ONES, ONES, ONES, range(5)), "no trial 'zig-zag'; did you mean 'zigzag'"),
        ("circle", (range(5), ONES, ONES, ONES, ONES), "is constant"),
        ("circle", (ONES, ONES, ONES, ONES, ONES), "do not increase"),
        ("circle", (range(5), np.nan * ONES, ONES, ONES, ONES), "at least two samples"),
    ],
)
def test_what_is_no_trial_is_told(kind, columns, message):
    with pytest.raises(cosim.InputError, match=message):
        measure(kind, passage(*columns), 1.0)


# Described ships


def conducted(d, kind, seconds, connect, held, mirrored=False, u=0.5, **values):
    """A described ship under a trial, its heading known, at steps of 0.1 s of the Otter's size.

    Args:
        connect: output of the guidance -> inputs of the thrusters.
        held: what other inputs of the thrusters keep.
        values: of the guidance; like ``u`` and ``held`` in the Otter's size.
    """
    at = type(d.scale)(d.length / OTTER.length)
    guidance, parts = sized(COMPONENTS[f"guidance_{kind}"], d), ship(description=d)
    units = {v.name: v.unit for v in guidance.variables}
    of_trial = {"side": -1.0 if mirrored else 1.0, "start": 4.0} | values
    p = with_values(guidance, **{k: x * at.factor(units[k]) for k, x in of_trial.items()})
    vessel, thrusters = parts.vessel, parts.thrusters
    hull, drive = vessel.prepared(vessel.params()), thrusters.prepared(thrusters.params())
    asked = {v.name: 0.0 for v in variables(thrusters.inputs)}
    unit_of = {v.name: v.unit for v in variables(thrusters.inputs)}
    asked |= {k: x * at.factor(unit_of[k]) for k, x in held.items()}
    state = vessel.init(None, vessel.params())._replace(x=0.0, y=0.0, psi=0.0, u=u * at.speed)
    past, gs, rows, h = thrusters.init(None, thrusters.params()), None, [], 0.1 * at.time
    for k in range(round(seconds / 0.1)):
        inputs = guidance.inputs(state.psi) if kind == "zigzag" else guidance.inputs()
        gs = gs or guidance.init(inputs, p)
        gs, stated = guidance.step(gs, inputs, p, h)
        rows.append((k * h, state.x, state.y, state.psi, stated.order))
        for output, names in connect.items():
            asked |= dict.fromkeys(names, getattr(stated, output))
        asked |= {"u": state.u, "v": state.v, "r": state.r}
        past, acts = thrusters.advance(past, packer(thrusters.inputs)(list(asked.values())), drive, h)
        tau = Force(acts.tau_act_X, acts.tau_act_Y, acts.tau_act_N)
        state, _ = vessel.advance(state, tau, hull, h)
    return passage(*np.array(rows).T)


BY_MOMENT = ({"tau_N": ["tau_N"]}, {"tau_X": 60.0})
SHAFT = {**PROPELLER, "x": -1.0}
RUDDER = {"x": -1.1, "area": 0.05, "lag": 0.5, "delta_rate": 0.5}
STEERED = described(
    part("screw", "fixed_propeller", SHAFT), part("rudder", "rudder", RUDDER),
)._replace(allocates=False)  # fmt: skip
PODS = described(
    *(part(n, "azimuth", {**PROPELLER, "n_min": 0.0, "x": -1.0, "y": y}) for n, y in (("port", -0.3), ("starboard", 0.3)))
)._replace(allocates=False)  # fmt: skip
HELMS = {
    "moment": (OTTER, *BY_MOMENT, {"moment": 15.0}),
    "rudder": (STEERED, {"delta": ["rudder_delta"]}, {"screw_n": 8.0}, {"angle": 0.35}),
    "azimuth": (
        PODS, {"delta": ["port_alpha", "starboard_alpha"]}, {"port_n": 6.0, "starboard_n": 6.0},
        {"angle": -0.35},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "helm"), [*(("circle", helm) for helm in HELMS), ("zigzag", "rudder")])
def test_every_helm_turns_the_ship_to_the_side_that_is_ordered_and_alike(kind, helm):
    d, connect, held, values = HELMS[helm]
    there, here = (
        conducted(d, kind, 40.0, connect, held, mirrored, **values) for mirrored in (False, True)
    )
    assert here.y == pytest.approx(-there.y, abs=1e-9)
    begin = executes(there)[0]
    assert there.at(begin + 3.0)[2] > 0.02
    found = [measure(kind, p, d.length) for p in (there, here)]
    assert found[0] == pytest.approx(found[1], rel=1e-6)
    assert {"circle": "advance", "zigzag": "overshoot_2"}[kind] in found[0]


@pytest.mark.parametrize("kind", ["circle", "zigzag"])
def test_the_same_ship_at_another_size_has_the_same_measures(kind):
    small, large = (
        measure(kind, conducted(d, kind, 40.0, *BY_MOMENT, moment=15.0), d.length)
        for d in (OTTER, scaled(OTTER, 10.0))
    )
    at = type(OTTER.scale)(10.0)
    units = {m.name: m.unit for m in MEASURES}
    assert large == pytest.approx({k: at.factor(units[k]) * x for k, x in small.items()}, rel=1e-6)


def test_a_ship_stops_by_its_drag_and_its_propeller_astern():
    d, connect = STEERED, {"n": ["screw_n"]}
    p = conducted_stop(d, connect)
    found = measure("stop", p, d.length)
    assert 0.0 < found["head_reach"] <= found["track_reach"] < 10.0 * d.length
    assert found["side_reach"] == pytest.approx(0.0, abs=1e-9)


def conducted_stop(d, connect):
    guidance = COMPONENTS["guidance_stop"]
    parts = ship(description=d)
    p = with_values(guidance, start=5.0, n_ahead=8.0, n_astern=-8.0)
    vessel, thrusters = parts.vessel, parts.thrusters
    hull, drive = vessel.prepared(vessel.params()), thrusters.prepared(thrusters.params())
    state = vessel.init(None, vessel.params())._replace(x=0.0, y=0.0, psi=0.0, u=1.0)
    past, s, rows, h = thrusters.init(None, thrusters.params()), guidance.init(None, p), [], 0.05
    for k in range(600):
        s, stated = guidance.step(s, None, p, h)
        rows.append((k * h, state.x, state.y, state.psi, stated.order))
        i = thrusters.inputs()
        nu = VelocityInCurrent(state.u, state.v, state.r)
        i = i._replace(request=i.request._replace(screw_n=stated.n), velocity=nu)
        past, acts = thrusters.advance(past, i, drive, h)
        state, _ = vessel.advance(state, Force(acts.tau_act_X, acts.tau_act_Y, acts.tau_act_N), hull, h)
    return passage(*np.array(rows).T)


# Runs


def test_the_page_has_the_measures_of_this_version(tmp_path):
    """The table of the first run, and the first overshoots by both orders of exchange."""
    page = (ROOT / "docs" / "trials.md").read_text(encoding="utf-8")
    block = page[page.index("measure            value") :].split("```")[0].splitlines()[1:-1]
    stated = {words[0]: words[1:3] for words in map(str.split, block)}
    found = cosim.simulate("otter_circle", tmp_path / "circle").metrics
    degrees = {name for name, (_, unit) in stated.items() if "°" in unit}
    assert {name: value for name, (value, _) in stated.items()} == {
        name: f"{math.degrees(x) if name in degrees else x:.4g}" for name, x in found.items()
    }
    row = page[page.index("| `otter_zigzag` |") :].splitlines()[0].replace("°", "").split("|")[2:6]
    values = [cosim.simulate(load("otter_zigzag", how), tmp_path / how).metrics for how in ORDERS]
    overshoots = [v[f"overshoot_{k}"] for k in (1, 2) for v in values]
    assert [float(x) for x in row] == [round(math.degrees(x), 2) for x in overshoots]


@pytest.mark.parametrize(
    ("name", "names"),
    [("otter_zigzag", {"overshoot_1", "overshoot_2"}), ("cse1_circle", {"advance", "circle_speed"})],
)
def test_a_run_is_measured_where_its_guidance_is_a_trial(name, names, tmp_path):
    result = cosim.simulate(name, tmp_path, pictures=True)
    assert (result.status, result.warnings) == ("done", [])
    stated = json.loads((tmp_path / "metrics.json").read_text())
    assert names <= stated.keys() <= {m.name for m in MEASURES}
    sheet_ = json.loads((tmp_path / "trial.json").read_text())
    assert sheet_["measures"] == stated
    assert sheet_["executes"][0] == pytest.approx(20.0)
    assert (tmp_path / "trial.png").exists()
    limited = json.loads((tmp_path / "log.json").read_text())["commands"]
    assert (tmp_path / "commands.png").exists() == bool(limited) == (name == "otter_zigzag")
    assert result.trial is not None
    assert result.trial.limits.keys() & names
    headers = [c.header for c in sheet(result.trial).columns]
    assert headers == ["measure", "value", "unit", "in L", "IMO limit", "meaning"]
    done = command(metrics_main, tmp_path, "--json")
    assert json.loads(done.stdout) == pytest.approx(stated, rel=1e-9)
    assert "limit" in command(metrics_main, tmp_path).stdout


def test_a_run_too_short_for_an_order_says_so(tmp_path):
    notes = []
    result = cosim.simulate("cse1_circle", tmp_path, stop=5.0, show=notes.append)
    assert (result.status, result.metrics) == ("done", {})
    assert any("is constant" in note for note in notes)


def test_without_a_length_there_are_no_limits():
    p = nomoto("circle", 60.0)
    assert outcome("circle", p, 0.0).limits == {}
    assert outcome("circle", p, 1.0).limits.keys() == {"advance", "tactical_diameter"}


@pytest.mark.parametrize("kind", KINDS)
def test_a_trial_is_told_by_its_fmu(kind):
    from fmus.fmi.model_description import guid_of, model_description

    root = model_description(COMPONENTS[f"guidance_{kind}"], guid_of("0"), "1")
    trial = root.find("VendorAnnotations/Tool[@name='cybership']/Trial")
    assert trial is not None
    assert trial.get("kind") == kind
    assert [name for name, c in COMPONENTS.items() if c.trial] == [f"guidance_{k}" for k in KINDS]


def test_the_page_defines_every_measure():
    page = (ROOT / "docs" / "trials.md").read_text(encoding="utf-8")
    numbered = re.compile(r"_[23]$")  # between the first and the fourth overshoot
    assert [m.name for m in MEASURES if f"`{m.name}`" not in page and not numbered.search(m.name)] == []
