"""Mistakes in a file are told by the data, with the line that mends them; right files are never refused."""

import json
import re
from dataclasses import replace
from functools import cache
from itertools import count, cycle, repeat
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import lsq_linear
from support.cases import in_part
from support.ccode import stepped
from support.command import command
from support.cse1 import VESSEL
from support.measured import DATA, MEASURED, NOISE, VELOCITY, needs_data, sail, smoothed, table_of

import diagnosis
from benchmarks.ship_effects import Cause, causes
from benchmarks.ship_effects import sail as sail_of
from diagnosis import InputError, Model, Run, omega, propose_columns, weak_windows
from diagnosis.assessment import plausibility
from diagnosis.assessment.command_check import contradicted_commands, without_force
from diagnosis.assessment.currents import in_further_current
from diagnosis.assessment.gains import gains, varying
from diagnosis.assessment.plausibility import (
    Mistake,
    likeliest_mistake,
    pushed_aside,
    refuse_implausible,
    same_columns,
    scale_is_confirmed,
)
from diagnosis.assessment.reading_odds import Explanation, ReadingOdds, bounded, most_thrust
from diagnosis.assessment.readings import (
    AS_READ,
    Reading,
    of_angles,
    of_commands,
    of_pose,
    other_factors,
    readings,
    reread,
    swapped,
)
from diagnosis.assessment.settings import SETTINGS
from diagnosis.predictors import ship_with, uncertainty
from diagnosis.predictors.ship_model import parameters
from diagnosis.runs import line_beside, propose
from diagnosis.runs.columns.columns import POSE, Column, Layout, Named
from diagnosis.runs.columns.unit_check import UNITS
from diagnosis.verdict.confidence import doubt_of_data
from fmus.signals import Force

COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]


@cache
def base():
    """The run that is varied."""
    return sail(60.0, 0.05)[0]


def edited(pose=None, commands=None):
    """The run with its pose and commands as these functions of them make them."""
    run = base()
    return replace(
        run,
        pose=pose(run.pose.copy()) if pose else run.pose,
        tau_cmd=commands(run.tau_cmd) if commands else run.tau_cmd,
    )


def flipped(*signs):
    return lambda values: values * np.array(signs)


def explained(*columns):
    """An explanation by columns (column, deviation[, low, high])."""
    why = Explanation()
    for column in columns:
        why.may(*column)
    return why


def test_a_density_is_that_of_a_normal_prior_and_normal_noise():
    """One column, noise far above all else, so that it hardly depends on what is explained."""
    rng = np.random.default_rng(0)
    x, e, least, s, windows = (
        rng.normal(size=(30, 3)),
        rng.normal(size=(30, 3)),
        np.array([20.0, 30.0, 50.0]),
        7.0,
        12.0,
    )
    w = np.sqrt(windows / 30) / np.sqrt((e**2).mean(axis=0) + least**2)
    information = 1.0 + s**2 * ((x * w) ** 2).sum()
    b = s * (x * w * e * w).sum() / information
    noise = np.sqrt(((e - b * s * x) ** 2).mean(axis=0) + least**2)
    expected = -windows * np.log(noise).sum() - 0.5 * (b**2 + np.log(information))
    assert explained((x, s)).explain(e, least, windows).density == pytest.approx(expected, abs=1e-2)


@pytest.mark.parametrize("seed", range(4))
def test_factors_between_limits_are_the_same_from_wherever_they_are_looked_for(seed):
    """The one minimum of a convex problem, by scipy's algorithm for it and from limits that hold elsewhere."""
    rng = np.random.default_rng(seed)
    design, y = np.vstack([rng.normal(size=(9, 6)), np.eye(6)]), rng.normal(0.0, 3.0, 15)
    low, high = (
        np.array([-np.inf, -1.0, 0.0, 0.0, -0.3, -np.inf]),
        np.array([np.inf, np.inf, np.inf, 0.5, 0.3, 0.2]),
    )
    expected = lsq_linear(design, y, (low, high)).x
    held = (expected - low < 1e-6) | (high - expected < 1e-6)
    assert 0 < held.sum() < 6
    for near in (
        np.zeros(6),
        np.fmax(low, -9.0),
        np.fmin(high, 9.0),
        expected,
        rng.uniform(-1.0, 1.0, 6),
    ):
        np.testing.assert_allclose(bounded(design, y, low, high, near), expected, atol=1e-6)


def test_the_unit_of_a_column_does_not_matter():
    """A column in a unit k times as large has factors, deviation and limits that are k times smaller."""
    rng = np.random.default_rng(2)
    x, y, least = rng.normal(size=(40, 3)), rng.normal(size=(40, 3)), np.full(3, 0.1)
    e = 1.5 * x - 2.0 * y + 0.3 * rng.normal(size=(40, 3))

    def density(k):
        columns = (k * x, 0.7 / k, -np.inf, 1.2 / k), (k * y, 0.4 / k, -1.1 / k, np.inf)
        return explained(*columns).explain(e, least, 15.0).density

    assert density(1.0) < explained((x, 0.7), (y, 0.4)).explain(e, least, 15.0).density - 1.0, (
        "limits act"
    )
    assert [density(k) for k in (0.2, 7.0)] == pytest.approx([density(1.0)] * 2)


@pytest.mark.parametrize("name", ["cse1", "kvlcc2"])
def test_a_current_that_may_explain_an_error_is_that_of_the_ships_size(name):
    """A small share of a speed that grows with the root of the length (Froude)."""
    model = Model(ship=ship_with((), name))
    speed = uncertainty.MEASURED * np.sqrt(model.ship.description.length / 1.105)
    currents = [(m.value("V_n"), m.value("V_e")) for m in in_further_current(model)]
    np.testing.assert_allclose(currents, speed * np.eye(2), rtol=1e-3)


@pytest.mark.parametrize(("V_n", "V_e"), [(-0.9, -0.4), (0.3, 1.0)])
def test_a_ship_in_a_current_as_fast_as_itself_is_not_in_another_unit(V_n, V_e):
    """Its speed over ground was explained by feet, and its force sideways by no actuator."""
    ship = ship_with((), "otter")
    stream = Cause("current", {"V_n": V_n, "V_e": V_e}, {})
    table = sail_of(ship, stream, np.random.default_rng(1), None, steps_of_thrust(), seconds=160.0)
    (w,) = diagnosis.load(table, ship="otter")
    assert w.smoothed.misread == ""
    found = ReadingOdds(w, Model(ship=ship)).in_current().model
    assert (found.value("V_n"), found.value("V_e")) == pytest.approx((V_n, V_e), abs=0.05)
    feet = table.assign(x=table["x"] / 0.3048, y=table["y"] / 0.3048)
    assert "its position is in ft" in doubt(feet)


def test_what_explains_an_error_within_its_limits_makes_it_likelier_in_any_unit():
    rng = np.random.default_rng(1)
    x, other, least = rng.normal(size=(60, 3)), rng.normal(size=(60, 3)), np.full(3, 0.01)
    e = 2.0 * x + 0.05 * rng.normal(size=(60, 3))

    def density(*columns, unit=1.0):
        return (
            explained(*((unit * c, *rest) for c, *rest in columns))
            .explain(unit * e, unit * least, 20.0)
            .density
        )

    plain = density((other, 1.0))
    assert density((x, 1.0)) > plain + 20.0
    assert density((x, 1.0), (other, 0.0)) == density((x, 1.0)), "what has no deviation explains nothing"
    assert density((x, 1.0, -np.inf, 0.0)) < plain + 2.0
    assert plain < density((x, 1.0, 0.0, 1.0)) < density((x, 1.0, 0.0, 3.0))
    assert density((x, 1.0), unit=10.0) == pytest.approx(density((x, 1.0)) - 20.0 * 3.0 * np.log(10.0))


@pytest.mark.quick
def test_the_right_reading_is_the_likeliest_and_one_without_numbers_is_none():
    odds = ReadingOdds(weak_windows(smoothed(base())), Model())
    right = odds.log_density(AS_READ)
    for reading in (
        of_pose("", (1.0, 1.0, -1.0)),
        of_commands("", (-1.0, -1.0, -1.0)),
        swapped(POSE, 0, 1),
    ):
        assert odds.log_density(reading) < right
    assert odds.log_density(Reading("", motion=np.diag([np.nan, 1.0, 1.0]))) == -np.inf
    assert odds.log_density(of_pose("", (1e200, 1.0, 1.0))) == -np.inf


GROUPS = {
    "its position": ("x", "y"),
    "its heading": ("psi",),
    "its commands": ("tau_X", "tau_Y", "tau_N"),
}
FACTORS = {
    "mm": 1e-3,
    "cm": 1e-2,
    "km": 1e3,
    "ft": 0.3048,
    "in": 0.0254,
    "mN": 1e-3,
    "kN": 1e3,
    "N.mm": 1e-3,
    "N.cm": 1e-2,
    "kN.m": 1e3,
    "degrees": np.pi / 180.0,
    "°": np.pi / 180.0,
    "rpm": 1.0 / 60.0,
    "rad/s": 0.5 / np.pi,
}


@pytest.mark.parametrize(
    ("name", "signals"), [("cse1", ()), ("gunnerus", ("azimuth.alpha", "azimuth.n"))]
)
def test_a_reading_in_another_unit_scales_what_it_names_and_nothing_else(name, signals):
    commands = np.ones((base().time.size, len(signals))) if signals else None
    run = replace(base(), commands=commands, signals=signals)
    seen = set()
    for r in readings(run, Model(ship=ship_with((), name))):
        stated = re.fullmatch(r"(.+) (?:is|are) in (\S+)(?: and (\S+))?", r.mistake)
        if not stated:
            continue
        who, unit, moment = stated.groups()
        named = [s for part in who.split(" and ") for s in GROUPS.get(part, (part,))]
        expected = {s: FACTORS[moment if s == "tau_N" and moment else unit] for s in named}
        assert {s: c.factor for s, c in r.changes.items()} == pytest.approx(expected)
        assert all(c == Named(name=s, factor=c.factor) for s, c in r.changes.items())
        seen.add(unit)
    assert seen >= ({"rpm", "°"} if signals else {"ft", "mN", "N.cm"})


@pytest.mark.parametrize("pace", [1.0, 4.0])
def test_another_reading_changes_motion_and_density_by_its_factors(pace):
    w = weak_windows(smoothed(base())).thinned
    changes = {
        "psi": Named(name="psi", offset=np.pi),
        "time": Named(name="time", factor=pace),
    }
    half = replace(of_pose("", (0.5, 0.5, 1.0)), changes=changes)
    meant = reread(w, half, Model())
    factors = np.array([0.5, 0.5, 1.0])
    np.testing.assert_allclose(meant.smoothed.eta, w.smoothed.eta * factors + [0.0, 0.0, np.pi])
    np.testing.assert_allclose(meant.smoothed.eta_dot, w.smoothed.eta_dot * factors / pace)
    np.testing.assert_allclose(meant.slope.toarray(), w.slope.toarray() / pace)
    assert half.density == pytest.approx(np.log(0.25) - 6.0 * np.log(pace))
    np.testing.assert_array_equal(meant.run.tau_cmd, w.run.tau_cmd)
    turned = reread(w, of_commands("", (1.0, -2.0, 0.5)), Model())
    np.testing.assert_allclose(turned.run.tau_cmd, w.run.tau_cmd * [1.0, -2.0, 0.5])


MISTAKES = [
    ("heading is mirrored", {"psi": {"name": "psi", "flip": True}}, {"pose": flipped(1, 1, -1)}),
    (
        "heading counts from east, counter-clockwise",
        {"psi": {"name": "psi", "offset": 1.571, "flip": True}},
        {"pose": lambda pose: pose * [1, 1, -1] + [0.0, 0.0, 0.5 * np.pi]},
    ),
    ("y points west", {"y": {"name": "y", "flip": True}}, {"pose": flipped(1, -1, 1)}),
    ("x points south", {"x": {"name": "x", "flip": True}}, {"pose": flipped(-1, 1, 1)}),
    (
        "commands have the wrong sign",
        {name: {"name": name, "flip": True} for name in COLUMNS[4:]},
        {"commands": flipped(-1, -1, -1)},
    ),
    (
        "tau_Y has the wrong sign",
        {"tau_Y": {"name": "tau_Y", "flip": True}},
        {"commands": flipped(1, -1, 1)},
    ),
]


@pytest.mark.parametrize(
    ("mistake", "line", "edits"), in_part(MISTAKES, keep=[MISTAKES[1], MISTAKES[4]])
)
def test_mistake_is_told_with_the_line_that_mends_it(mistake, line, edits, tmp_path):
    w = weak_windows(smoothed(replace(edited(**edits), file=tmp_path / "a.csv")))
    with pytest.raises(InputError) as error:
        refuse_implausible([w], Model())
    text = str(error.value)
    assert mistake in text
    assert f"put {json.dumps({'columns': line})} into" in text
    assert "\n" not in text


@cache
def otter():
    """A run of a ship with two fixed propellers, which cannot push sideways."""
    ship = ship_with((), "otter")
    return sail_of(ship, causes(ship)["none"], np.random.default_rng(0), None, seconds=120.0)


def doubt(table):
    """What is said of a run of that ship."""
    with pytest.raises(InputError) as error:
        diagnosis.load(table, ship="otter")
    return str(error.value)


OF_ACTUATORS = [
    (["port.n", "starboard.n"], ["starboard.n", "port.n"], 1.0, "port.n and starboard.n are swapped"),
    (["port.n"], ["port.n"], -1.0, "port.n has the wrong sign"),
    (["port.n", "starboard.n"], ["port.n", "starboard.n"], 60.0, "port.n and starboard.n are in rpm"),
    (["port.n", "starboard.n"], ["port.n", "starboard.n"], 1 / 60.0, "are in 1/s in place of rpm"),
]


@pytest.mark.parametrize(
    ("columns", "read_from", "factor", "mistake"), in_part(OF_ACTUATORS, keep=OF_ACTUATORS[:1])
)
def test_mistakes_of_a_described_ship_are_told_with_odds(columns, read_from, factor, mistake):
    table = otter().copy()
    table[columns] = factor * otter()[read_from].to_numpy()
    said = doubt(table)
    assert mistake in said
    assert "(odds " in said


def test_a_share_of_the_whole_way_of_a_rudder_counts_from_hard_over():
    """0 to 100 % was read as from midship to starboard."""
    run = replace(
        base(), signals=("rudder.delta",), commands=np.linspace(0.0, 0.6, base().time.size)[:, None]
    )
    layout = SimpleNamespace(limits=lambda _: [(-0.6, 0.6)], round=None)
    ship = SimpleNamespace(layout_of=lambda _: layout, form_of=lambda _: {"rudder.delta": "rad"})
    model = SimpleNamespace(ship=ship, drive=SimpleNamespace(params=None))
    found = {r.mistake: r for r in of_angles(run, run.commands, model)}
    shares = found["rudder.delta is a share of the way from hard over to port"]
    meant = run.commands @ shares.commands.T + shares.added
    assert meant[[0, -1], 0] == pytest.approx([-0.6, 0.6])
    other = found["rudder.delta is a share of the way from hard over to starboard"]
    np.testing.assert_allclose(run.commands @ other.commands.T + other.added, -meant, atol=1e-12)
    half = replace(run, commands=2.0 * run.commands)
    assert not any("share" in r.mistake for r in of_angles(half, half.commands, model))


def test_latitude_and_longitude_may_be_in_each_others_column(tmp_path):
    """A degree of the one has not as many metres as one of the other."""
    lat, lon = 63.44 + otter()["x"] / 111_469.0, 10.4 + otter()["y"] / 49_896.0
    table = otter().drop(columns=["x", "y"]).assign(lat=lon, lon=lat)
    table.to_csv(tmp_path / "a.csv", index=False)
    needed = propose(tmp_path / "a.csv", ship_with((), "otter")).needed
    (tmp_path / "a.csv.json").write_text(json.dumps(needed))
    with pytest.raises(InputError, match="its latitude and longitude are in each other's column"):
        diagnosis.load([tmp_path / "a.csv"], ship="otter")


@pytest.mark.parametrize("unit", ["cm", "mm"])
def test_a_length_that_was_read_in_another_unit_is_put_right_by_the_unit(unit, tmp_path):
    """Not by a factor of the wrong one."""
    size = UNITS["length"][unit]
    table = otter().assign(x=otter()["x"] / size, y=otter()["y"] / size)
    table.to_csv(tmp_path / "a.csv", index=False)
    wrong = {s: {"name": s, "unit": "in"} for s in ("x", "y")}
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": wrong}))
    with pytest.raises(InputError) as error:
        diagnosis.load([tmp_path / "a.csv"], ship="otter")
    assert f'"x": {{"name": "x", "unit": "{unit}"}}' in str(error.value)


def test_axes_that_are_mirrored_stand_before_actuators_that_are_swapped():
    """Of a ship that is the same on both sides nothing tells one from the other; files have the first."""
    said = doubt(otter().assign(y=-otter()["y"], psi=-otter()["psi"]))
    first, _, rest = said.partition(", or ")
    assert "y points west and its heading is mirrored" in first
    assert "port.n and starboard.n are swapped" in rest


@pytest.mark.slow
@pytest.mark.parametrize("cause", ["wind", "lag"])
def test_hidden_cause_of_a_described_ship_is_no_mistake(cause):
    """With every coefficient 10 % wrong."""
    ship = ship_with((), "otter")
    table = sail_of(ship, causes(ship)[cause], np.random.default_rng(1), 1, seconds=120.0)
    assert len(diagnosis.load(table, ship="otter")) == 1


def steps_of_thrust():
    """Commands that change every twelve seconds."""
    for pair in cycle([(12.0, 0.2), (0.2, 12.0), (9.0, 3.0), (3.0, 9.0)]):
        yield from repeat(pair, 60)


@pytest.mark.parametrize(("seed", "lag"), [(1, 2.5), (2, 3.0)])
def test_propellers_that_are_slower_than_described_are_no_mistake(seed, lag, monkeypatch):
    """Their thrust follows so late that it looks too small for the clock; it is described with 1 s."""
    ship = ship_with((), "otter")
    slow = causes(ship)["none"]._replace(thrusters={"lag_port": lag, "lag_starboard": lag})
    rng = np.random.default_rng(seed)
    table = sail_of(ship, slow, rng, None, steps_of_thrust(), seconds=160.0)
    assert len(diagnosis.load(table, ship="otter")) == 1
    monkeypatch.setattr(plausibility, "slower", lambda w, model: [])
    (w,) = diagnosis.load(table, ship="otter")
    assert "perhaps" in w.smoothed.misread
    assert "s passed in each second of its time" in w.smoothed.misread


@pytest.mark.parametrize(("lost", "line"), [(0.75, "or all thrusters give 0.25 of theirs"), (0.0, "")])
def test_thrusters_that_are_weak_are_no_mistake(lost, line):
    """As those of a flat battery: where damping is quadratic, a slow clock looks the same."""
    ship = ship_with((), "otter")
    weak = causes(ship)["none"]._replace(thrusters={"loss_port": lost, "loss_starboard": lost})
    rng = np.random.default_rng(1)
    table = sail_of(ship, weak, rng, None, steps_of_thrust(), seconds=160.0)
    (w,) = diagnosis.load(table, ship="otter")
    before, _, said = w.smoothed.misread.partition(" (odds")[0].rpartition(", ")
    assert said == line
    assert before.partition(" ")[0] == ("perhaps" if lost else "")


@pytest.mark.slow
def test_another_clock_is_found_with_the_lags_of_the_thrusters_in_it():
    """Of lags of 1 s in a clock that runs ten times too fast half the pace was found."""
    ship, pace = ship_with((), "otter"), 0.1
    table = sail_of(
        ship, causes(ship)["none"], np.random.default_rng(1), None, steps_of_thrust(), seconds=160.0
    )
    table["time"] /= pace
    text = doubt(table)
    assert text is not None
    found = re.search(r"probably ([\d.]+) s passed in each second of its time", text)
    assert found, text
    assert float(found[1]) == pytest.approx(pace, rel=0.1)


@pytest.mark.parametrize("cause", ["wind", "lag"])
def test_a_steady_turn_may_have_constant_commands(cause):
    """With every coefficient 10 % wrong; commands that were others are found by their varying force."""
    ship = ship_with((), "otter")
    rng = np.random.default_rng(1)
    turn = sail_of(ship, causes(ship)[cause], rng, 1, repeat((7.0, 10.0)), seconds=120.0)
    (w,) = diagnosis.load(turn, ship="otter")
    assert np.ptp(w.run.commands, axis=0).max() == 0.0
    assert "all its commands are constant, and the motion needs a force that varies by" in doubt(
        otter().assign(**dict.fromkeys(ship.commands, 10.0))
    )


def test_a_force_where_no_actuator_pushes_is_a_question():
    (w,) = diagnosis.load(otter(), ship="otter")
    model = Model(ship=ship_with((), "otter"))
    assert pushed_aside(w, model) is None
    stream = model.plus({"F_n": 400.0, "F_e": 300.0})  # such as a current that the model does not have
    assert np.abs(omega(w, stream)[:, 1]).max() > 239.0
    assert pushed_aside(w, stream) is None
    said = pushed_aside(reread(w, of_pose("", (100.0, 100.0, 1.0)), model), model)
    assert said is not None
    assert " sideways, where no actuator acts, and all together give 239 N" in said


def test_a_rudder_acts_sideways_on_a_ship_under_way():
    """A hull whose lift is far off lacks more sideways than all of its propeller gives."""
    ship = ship_with((), "kvlcc2")
    way = ((10.0, 0.5 if k % 1500 < 750 else -0.5) for k in count())
    log = sail_of(ship, causes(ship)["none"], np.random.default_rng(1), 1, way, seconds=90.0)
    (w,), model = diagnosis.load(log, ship="kvlcc2"), Model(ship=ship)
    wrong = model.plus({"Y_uv": -100.0 * model.unit("Y_uv")})
    assert varying(w, omega(w, wrong))[1] > SETTINGS.much * most_thrust(w, wrong)[1]
    assert pushed_aside(w, wrong) is None


def test_a_propeller_that_cannot_reverse_gives_no_force():
    tanker = ship_with((), "kvlcc2")
    commands = np.column_stack([np.full(9, -5.0), np.linspace(-0.3, 0.3, 9)])
    force = tanker.commanded_force(commands)
    run = Run("a", np.arange(9.0), np.zeros((9, 3)), force, commands, signals=tuple(tanker.commands))
    said = without_force(run, Model(ship=tanker))
    assert "propeller.n is beyond its limits, 0 to 20, in all rows" in said


@pytest.mark.parametrize("k", [0.3, 1.0, 4.0])
def test_the_gain_is_how_many_times_the_commanded_force_acts(k):
    w = weak_windows(smoothed(edited(commands=lambda tau: tau / k)))
    g = gains(w, Model())
    assert g.value == pytest.approx([k] * 3, rel=0.1)
    assert (np.abs(g.value - k) < 4.0 * g.error).all()
    assert (g.error < 0.1 * k).all()
    assert g.stated.all()


def circling(seconds=110.0, h=0.1, camera=0.1):
    """A run of the exact ship whose sway force and yaw moment follow from its velocity and a set rate."""
    body, force, rows = stepped(VESSEL, parameters(VESSEL, {}), Force()), [0.0, 0.0, 0.0], []
    seen = body.advance(force, 0.0)
    for t in (np.arange(round(seconds / h)) * h).tolist():
        v, r = (seen[k] for k in VELOCITY[1:])
        rate = 0.12 if t % 120.0 < 60.0 else -0.12
        force = [0.17 + 0.12 * np.sin(t / 9.0), 2.0 * rate - 7.0 * v, 4.9 * rate - 3.0 * r]
        rows.append([t, *(seen[k] for k in MEASURED), *force])
        seen = body.advance(force, h)
    time, pose, tau = np.split(np.array(rows), [1, 4], axis=1)
    pose += camera * NOISE * np.random.default_rng(3).standard_normal(pose.shape)
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    return Run("circling", time[:, 0], pose, tau)


def test_feedback_of_the_motion_tells_no_gain_of_its_own():
    w = weak_windows(smoothed(circling()))
    g = gains(w, Model())
    assert not g.stated[1:].any()
    refuse_implausible([w], Model())


@pytest.mark.quick
def test_commands_that_follow_those_of_another_axis_tell_no_gain_of_their_own():
    def one_thruster(tau):
        return np.column_stack([tau[:, :2], -0.5 * tau[:, 1]])

    w = weak_windows(smoothed(edited(commands=one_thruster)))
    assert np.isnan(gains(w, Model()).value).tolist() == [False, True, True]
    assert gains(weak_windows(smoothed(base())), Model()).stated.all()


def test_late_clock_is_no_mistake():
    late = replace(base(), pose=np.vstack([np.repeat(base().pose[:1], 10, axis=0), base().pose[:-10]]))
    noise = 1e-4 * np.random.default_rng(0).standard_normal(late.pose.shape)
    assert (
        likeliest_mistake(weak_windows(smoothed(replace(late, pose=late.pose + noise))), Model()) is None
    )


def of_units(found):
    """Whether nothing but units seems to be wrong."""
    return all(c == Named(name=s, factor=c.factor) for r in found.readings for s, c in r.changes.items())


@pytest.mark.quick
def test_ship_of_another_size_is_a_unit_alone():
    """By Froude's law 270 times as long, with the model of the small ship: at the most units are doubted."""
    scale, run = 270.0, base()
    large = replace(
        run,
        time=run.time * scale**0.5,
        pose=run.pose * [scale, scale, 1.0],
        tau_cmd=run.tau_cmd * [scale**3, scale**3, scale**4],
    )
    found = likeliest_mistake(weak_windows(smoothed(large)), Model())
    assert found is None or of_units(found)


@pytest.mark.parametrize(
    ("edits", "pair"),
    [
        ({"pose": lambda p: p[:, [0, 0, 2]]}, ("x", "y")),
        ({"pose": lambda p: p[:, [2, 1, 2]]}, ("x", "psi")),
        ({"commands": lambda t: t[:, [0, 1, 1]]}, ("tau_Y", "tau_N")),
        ({"commands": lambda t: 0.0 * t}, None),
    ],
)
def test_column_that_is_used_twice_is_found(edits, pair):
    assert same_columns(edited(**edits)) == pair


@pytest.mark.slow
@needs_data
def test_tanker_with_a_rudder_is_a_unit_alone():
    """KVLCC2, its rudder read as a command of yaw, with the model of quite another ship: so at the most."""
    data = pd.read_csv(DATA / "kvlcc2_hsva" / "z_05_01.csv")
    pose = np.column_stack([data.x, data.y, np.radians(data.psi_deg)])
    for sign in (1.0, -1.0):
        rudder = np.column_stack([0.0 * data.t, 0.0 * data.t, sign * data.rudder_deg])
        w = weak_windows(smoothed(Run("z", data.t.to_numpy(), pose, rudder)))
        found = likeliest_mistake(w, Model())
        assert found is None or of_units(found)


@pytest.mark.parametrize("unit", [1.0, 0.3048])
def test_a_velocity_that_agrees_confirms_the_unit_of_the_position(unit):
    """A ship that seems 3.3 times too quick moves by its own speed so; a velocity in another unit says nothing."""
    run = edited(pose=lambda p: p / [0.3048, 0.3048, 1.0])
    (alone,) = diagnosis.gather([run], anyway=True)
    found = likeliest_mistake(alone, Model())
    assert found is not None
    assert "its position is in ft" in found.clause
    nu = alone.smoothed.nu * [unit, unit, 1.0]
    measured = dict(zip("uvr", np.nan_to_num(nu).T, strict=True))
    (w,) = diagnosis.gather([replace(run, measured=measured)], anyway=True)
    assert set("uv") <= set(w.smoothed.sensors.agreeing)
    assert scale_is_confirmed(w.smoothed.sensors) == (unit == 1.0)
    found = likeliest_mistake(w, Model())
    assert (found is not None and "its position is in ft" in found.clause) == (unit != 1.0)


def test_degrees_of_latitude_are_in_no_unit_of_length():
    columns = {"x": Column(name="Lat", factor=111e3), "y": Column(name="Lon", factor=68e3)}
    for layout, expected in ((Layout(columns=columns), False), (Layout(), True)):
        run = replace(base(), layout=layout)
        found = [*readings(run, Model()), *other_factors(run, 2.0, 0.7)]
        assert any("position is in" in r.mistake for r in found) == expected
        assert any("as in axes east and north" in r.mistake for r in found) == expected
        assert any(r.mistake == "y points west (east is positive here)" for r in found)


@pytest.mark.parametrize(("name", "angles"), [("cybership2", 2), ("otter", 0)])
def test_all_angles_may_have_the_wrong_sign(name, angles):
    ship = ship_with((), name)
    run = replace(base(), ship=ship.description, signals=tuple(ship.commands))
    run = replace(run, commands=np.ones((run.time.size, len(run.signals))))
    found = [r for r in readings(run, Model(ship=ship)) if r.mistake == "its angles have the wrong sign"]
    assert [len(r.changes) for r in found] == [angles] * bool(angles)


def read_as(ship, commands, mistake):
    """Commands (k,) of a ship as a reading of them means them; None: there is none."""
    run = replace(base(), ship=ship.description, signals=tuple(ship.commands))
    run = replace(run, commands=np.tile(np.array(commands), (run.time.size, 1)))
    found = [r for r in readings(run, Model(ship=ship)) if r.mistake.startswith(mistake)]
    assert len(found) <= 1
    return (run.commands @ found[0].commands.T + found[0].added)[0] if found else None


def test_angles_may_count_from_elsewhere():
    tanker, vessel = ship_with((), "kvlcc2"), ship_with((), "gunnerus")
    limit = 0.62
    for way, sign in (("port", 1.0), ("starboard", -1.0)):
        mistake = f"rudder.delta counts from hard over to {way}"
        for share in (0.0, 0.3, 1.0):
            meant = read_as(tanker, [9.0, (1.0 + share) * limit], mistake)
            np.testing.assert_allclose(meant, [9.0, sign * share * limit], atol=1e-12)
        assert read_as(tanker, [9.0, -0.1], mistake) is None
    assert read_as(tanker, [9.0, 0.1], "rudder.delta points the other way") is None
    meant = read_as(vessel, [0.3, 2.0], "azimuth.alpha points the other way")
    np.testing.assert_allclose(meant, [0.3 + np.pi, 2.0])
    assert read_as(vessel, [0.3, 2.0], "azimuth.alpha counts from hard over") is None


def test_numbers_in_si_may_stand_under_another_unit():
    tanker = ship_with((), "kvlcc2")
    degree = np.pi / 180.0
    meant = read_as(tanker, [9.0, 0.3 * degree], "rudder.delta is in rad in place of")
    np.testing.assert_allclose(meant, [9.0, 0.3])
    assert read_as(tanker, [9.0, 0.7 * degree], "rudder.delta is in rad in place of") is None, "beyond"
    meant = read_as(tanker, [9.0 / 60.0, 0.3], "propeller.n is in 1/s in place of rpm")
    np.testing.assert_allclose(meant, [9.0, 0.3])
    assert read_as(tanker, [9.0, 0.3], "propeller.n is in 1/s in place of rpm") is None, "beyond"
    for size, possible in ((6.0, True), (7.0, False)):
        run = replace(base(), pose=base().pose * [1.0, 1.0, 0.0] + [0.0, 0.0, size * degree])
        found = [r for r in readings(run, Model()) if "in radians in place" in r.mistake]
        assert [r.changes["psi"].factor for r in found] == pytest.approx([1.0 / degree] * possible)


def test_what_may_be_dead_of_commands_that_are_meant_otherwise():
    """Of an angle that counts from elsewhere the whole actuator, of another mistake the command alone."""
    names = ("a.alpha", "a.n", "b.n")
    flipped_angle = of_commands("", (-1.0, 1.0, 1.0), names)
    turned = replace(of_commands("", (1.0, 1.0, 1.0), names), added=np.array([np.pi, 0.0, 0.0]))
    for reading, kept in ((flipped_angle, [0.0, 1.0, 1.0]), (turned, [0.0, 0.0, 1.0])):
        np.testing.assert_array_equal(reading.dead(names).commands, np.diag(kept))
        assert reading.dead(names).added == 0.0
    assert of_pose("", (1.0, -1.0, 1.0)).dead(names) is None


@pytest.mark.parametrize("way", in_part(["port", "starboard"], keep=["port"]))
def test_a_rudder_that_counts_from_hard_over_is_told_in_the_unit_of_its_column(way, tmp_path):
    ship = ship_with((), "kvlcc2")
    orders = ((9.0, delta) for delta in cycle([0.3] * 400 + [-0.3] * 300 + [0.1] * 200 + [-0.2] * 400))
    nothing = causes(ship)["none"]
    table = sail_of(ship, nothing, np.random.default_rng(0), None, orders, seconds=120.0)
    right, limit = np.degrees(table["rudder.delta"]), np.degrees(0.62)
    table["rudder.delta"] = right + limit if way == "port" else limit - right
    path = tmp_path / "a.csv"
    table.to_csv(path, index=False)
    unit = {"columns": {"rudder.delta": {"name": "rudder.delta", "unit": "deg"}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(unit))
    (w,) = diagnosis.gather([path], anyway=True, model=Model(ship=ship))
    found = likeliest_mistake(w, Model(ship=ship))
    assert found is not None
    assert found.readings[0].mistake == f"rudder.delta counts from hard over to {way}"
    line = line_beside(path, w.run.layout, found.readings[0].changes)
    stated = json.loads(re.search(r"put (\{.*\}) into", line)[1])["columns"]["rudder.delta"]
    assert stated["unit"] == "deg"
    assert stated["offset"] == pytest.approx(-limit if way == "port" else limit, abs=0.01)
    assert stated.get("flip", False) == (way == "starboard")
    (tmp_path / "a.csv.json").write_text(json.dumps({"columns": {"rudder.delta": stated}}))
    (mended,) = diagnosis.gather([path], model=Model(ship=ship))
    np.testing.assert_allclose(mended.run.commanded["rudder.delta"], np.radians(right), atol=1e-3)


@pytest.mark.parametrize("rudder", [0.3, 0.0])
def test_a_rudder_that_goes_to_and_fro_at_one_shaft_speed_varies(rudder):
    """At rest it gives no force: a zig-zag has constant commands of force."""
    ship = ship_with((), "cybership2")
    t = np.arange(0.0, 100.0, 0.1)
    way = np.where(np.sin(0.3 * t) > 0.0, rudder, -rudder)
    given = {"port.n": 10.0 + 0.0 * t, "starboard.n": 10.0 + 0.0 * t, "bow.u": 0.0 * t}
    given |= {"port_rudder.delta": way, "starboard_rudder.delta": way}
    commands = np.column_stack([given[name] for name in ship.commands])
    psi = 0.2 * np.sin(0.3 * t - 1.0)
    pose = np.column_stack([0.03 * np.cumsum(np.cos(psi)), 0.03 * np.cumsum(np.sin(psi)), psi])
    pose += np.random.default_rng(2).normal(0.0, 1e-3, pose.shape)
    tau = ship.commanded_force(commands, None)
    run = Run("z", t, pose, tau, commands, signals=tuple(ship.commands), ship=ship.description)
    said = contradicted_commands(weak_windows(smoothed(run)), Model(ship=ship))
    assert (said is not None and "commands are constant" in said) == (rudder == 0.0)


@pytest.mark.parametrize(("size", "asked"), [(0.2, True), (0.006, False)])
def test_a_steady_run_in_gusts_has_constant_commands(size, asked):
    """What its motion needs varies by less than 5 % of what its actuators give."""
    ship = ship_with((), "cybership2")
    t = np.arange(0.0, 100.0, 0.1)
    given = {"port.n": 10.0, "starboard.n": 10.0, "bow.u": 0.0}
    given |= {"port_rudder.delta": 0.0, "starboard_rudder.delta": 0.0}
    commands = np.tile([given[name] for name in ship.commands], (t.size, 1))
    psi = size * np.sin(0.3 * t)
    pose = np.column_stack([0.03 * np.cumsum(np.cos(psi)), 0.03 * np.cumsum(np.sin(psi)), psi])
    pose += np.random.default_rng(2).normal(0.0, 1e-4, pose.shape)
    tau = ship.commanded_force(commands, None)
    run = Run("z", t, pose, tau, commands, signals=tuple(ship.commands), ship=ship.description)
    w, model = weak_windows(smoothed(run)), Model(ship=ship)
    assert bool(contradicted_commands(w, model)) == asked
    needed = varying(w, omega(w, model))
    assert (needed > 0.05 * most_thrust(w, model)).any() == asked


class SomeOdds:
    """In place of the odds of readings: one reading is that much likelier than the file as it was read."""

    def __init__(self, better, dead=0.0):
        self.better, self.dead = better, dead

    def __call__(self, w, model):
        return self

    def in_current(self):
        return self

    def log_density(self, reading):
        if reading.mistake == "tau_Y has the wrong sign":
            return self.better
        return 0.0 if reading.mistake or reading.commands is None else self.dead


@pytest.mark.parametrize(
    ("odds", "sure"), [pytest.param(101.0, False, marks=pytest.mark.quick), (1e7, True)]
)
def test_a_mistake_that_is_likely_and_not_sure_is_a_line_and_no_refusal(
    odds, sure, monkeypatch, tmp_path
):
    """Of many readings chance may give one odds of 100 : 1."""
    monkeypatch.setattr(plausibility, "ReadingOdds", SomeOdds(np.log(odds)))
    w = weak_windows(smoothed(replace(base(), file=tmp_path / "a.csv")))
    if sure:
        with pytest.raises(InputError, match="probably tau_Y has the wrong sign"):
            refuse_implausible([w], Model())
        return
    (found,) = refuse_implausible([w], Model())
    line = found.smoothed.misread
    assert line.startswith("perhaps tau_Y has the wrong sign (odds 10^2 : 1); if so, put {")
    assert line in found.smoothed.notes
    assert doubt_of_data([w]) == ""
    assert "--anyway" in doubt_of_data([w, found]), "a finding of it is not sure"


@pytest.mark.parametrize(
    ("dead", "odds"), [(-5.0, "more than 10^6 : 1"), (12.0, "20 : 1"), (14.5, None), (16.0, None)]
)
def test_a_wrong_sign_may_be_where_a_dead_actuator_does_nearly_as_well(dead, odds, monkeypatch):
    """Where it does better it is one: nothing is said."""
    monkeypatch.setattr(plausibility, "ReadingOdds", SomeOdds(15.0, dead))
    found = likeliest_mistake(weak_windows(smoothed(base())), Model())
    if odds is None:
        assert found is None
        return
    assert found.clause.partition(" (")[2] == f"odds {odds})"
    assert found.sure == (dead < 0.0)


def test_what_is_found_in_a_file_is_told_with_its_side_car(monkeypatch, tmp_path):
    """Of one file and of several: likely mistakes, and faults that redundant channels show."""
    feet = Mistake([Reading("y is in ft", {"y": Named(name="y", factor=0.3048)})], 5.0, sure=False)
    table = otter()
    r = np.gradient(np.unwrap(table["psi"]), table["time"])
    for name, turning in (("a", r), ("b", -r)):
        table.assign(r=turning).to_csv(tmp_path / f"{name}.csv", index=False)
    ship = ("--ship", "otter")
    clean = command(propose_columns.main, tmp_path / "a.csv", *ship).stdout
    monkeypatch.setattr(plausibility, "likeliest_mistake", lambda *_: feet)
    for files in (["b.csv"], ["a.csv", "b.csv"]):
        done = command(propose_columns.main, *(tmp_path / name for name in files), *ship)
        said = " ".join(done.stdout.split())
        assert done.returncode == 0
        assert said.count("perhaps y is in ft (odds 10^2 : 1); if so, put {") == len(files)
        assert said.count("its sign is reversed") == 1
    assert "perhaps" not in clean
    assert "reversed" not in clean


@pytest.mark.parametrize(("factor", "refused"), [(1.0, True), (0.1, False)])
def test_a_noise_that_the_samples_contradict_gives_readings_no_odds(factor, refused, monkeypatch):
    """With a motion that follows its noise accelerations are smaller in feet, whatever the ship does."""
    run = sail(64.0, 0.1)[0]
    run = replace(run, noise={n: factor * s for n, s in zip(POSE, NOISE, strict=True)})
    feet = Mistake([Reading("y is in ft", {"y": Named(name="y", factor=0.3048)})], 20.0)
    monkeypatch.setattr(plausibility, "likeliest_mistake", lambda *_: feet)
    if refused:
        with pytest.raises(InputError, match="y is in ft"):
            diagnosis.gather([run])
        return
    (w,) = diagnosis.gather([run])
    assert any("the noise of x is given as" in line for line in w.smoothed.doubted)


def test_the_side_car_of_a_run_that_seems_mirrored_is_written_all_the_same(tmp_path):
    """What is known of names and units stands then, and the line that mends the rest has it."""
    run = edited(pose=flipped(1, 1, -1))
    table = table_of(run)
    table = table.assign(yaw=np.degrees(table["psi"])).drop(columns="psi")
    table.to_csv(tmp_path / "a.csv", index=False)
    done = command(propose_columns.main, tmp_path / "a.csv", "--write")
    assert done.returncode == 0
    stated = " ".join(done.stdout.split())
    assert "not usable yet: run 'a': probably its heading is mirrored" in stated
    assert '{"name": "yaw", "unit": "deg", "flip": true}' in stated
    side_car = json.loads((tmp_path / "a.csv.json").read_text())
    assert side_car == {"columns": {"psi": {"name": "yaw", "unit": "deg"}}}
