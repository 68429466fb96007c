"""The registry of model effects: completeness, physics of each effect, and the FMUs that have them."""

import math
import random
import subprocess
import sys
from dataclasses import replace

import fmpy
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cse1 import EFFECTS, SHIP, THRUSTERS, Inputs
from support.cse1 import VESSEL as COMPONENT
from support.own_effects import GOOD, OWN
from support.project import ROOT

from fmus.declare import flatten, packer, variables
from fmus.effects import Loaded, Motion, Running, Thrust
from fmus.effects.__main__ import table as effects_table
from fmus.effects.effect import Search
from fmus.effects.environment import surface
from fmus.frames import rotate_to_earth
from fmus.hull import Inertia, damping_force
from fmus.signals import Force, VelocityInCurrent
from fmus.thrusters import propeller, table
from fmus.vessel.vessel import State, hull
from fmus.vessel.vessel_effects import vessel_effects

Params = COMPONENT.params
PROPELLER, TABLE = (m.make(SHIP.effects, SHIP.description) for m in (propeller, table))
CHANGES, OUTSIDE = vessel_effects(EFFECTS).changes, vessel_effects(EFFECTS).outside
LINEAR = [e.id for e in EFFECTS.values() if e.linear and e.kind in ("force", "environment")]
speeds = st.floats(-0.6, 0.6)


def with_params(component, **changed):
    """The component's parameters with some of them changed by name."""
    names = [v.name for v in variables(component.params)]
    values = flatten(component.params())
    for name, value in changed.items():
        values[names.index(name)] = value
    return packer(component.params)(values)


def sail(p, seconds=5.0, h=0.01, tau=Force(0.5, 0.2, 0.1), start=None):
    """State and last outputs of the vessel after some time of constant force."""
    s = start or COMPONENT.init(tau, p)
    ready, out = COMPONENT.prepared(p), None
    for _ in range(round(seconds / h)):
        s, out = COMPONENT.advance(s, tau, ready, h)
    return s, out


def test_every_parameter_of_an_effect_is_one_of_an_fmu():
    declared = {v.name for v in COMPONENT.variables} | {v.name for v in THRUSTERS.variables}
    of_fmus = [e for e in EFFECTS.values() if e.function is not None]
    missing = [p.name for e in of_fmus for p in e.parameters if p.name not in declared]
    assert not missing
    assert "delta_X_absu_u" in declared
    assert "delta_Y_absr_v" in declared


def test_coefficients_start_at_zero_and_can_be_tuned():
    for e in EFFECTS.values():
        for p in e.parameters:
            assert not p.fixed
            assert p.start == 0.0 or p.name not in e.coefficients


@pytest.mark.parametrize("e", EFFECTS.of_kind("force")[: len(CHANGES.members)], ids=lambda e: e.id)
def test_damping_like_force_is_the_coefficient_times_the_product_in_its_name(e):
    axis, _, text = e.id.partition("_")
    assert e.axis == axis
    rng = random.Random(1)
    for _ in range(20):
        values = dict(zip("uvr", (rng.uniform(-1, 1) for _ in range(3)), strict=True))
        expected, rest = 2.5, text
        while rest:
            if rest[0] == "|":
                expected, rest = expected * abs(values[rest[1]]), rest[3:]
            else:
                expected, rest = expected * values[rest[0]], rest[1:]
        force = dict(zip("XYN", e.function(Motion(**values), 2.5), strict=True))
        assert force.pop(axis) == pytest.approx(expected, abs=1e-15)
        assert all(value == 0.0 for value in force.values())


@pytest.mark.parametrize("name", LINEAR)
def test_regressors_carry_the_whole_effect(name):
    e = EFFECTS[name]
    rng = np.random.default_rng(2)
    ship = Loaded(*rng.uniform(-0.5, 0.5, (10, 30)))
    weights = rng.uniform(0.0, 1.0, len(e.coefficients))
    given_ = dict(zip(e.coefficients, weights, strict=True))
    values = [given_.get(p.name, p.start) for p in e.parameters]
    whole = e.function(ship, *values)
    columns = e.regressors(ship)
    for axis in range(3):
        total = sum(w * column[axis] for w, column in zip(weights, columns, strict=True))
        assert np.allclose(total, whole[axis], atol=1e-12)


def test_force_outputs_add_up_to_the_model_error():
    rng = random.Random(3)
    names = [v.name for v in variables(CHANGES.params)] + [v.name for v in variables(OUTSIDE.params)]
    some = {n: rng.uniform(-1, 1) for n in names if not n.endswith(("_period", "_range", "_peak"))}
    p = with_params(COMPONENT, **some)
    s = State(*(rng.uniform(-0.3, 0.3) for _ in range(7)))
    _, out = COMPONENT.step(s, Force(0.1, 0.2, 0.3), p, 0.0)
    sums = dict.fromkeys("XYN", 0.0)
    for member, group in [(m, g) for g in (CHANGES, OUTSIDE) for m in g.members]:
        part = out.change if group is CHANGES else out.outside
        for axis in member.effect.axis:
            one = len(member.effect.axis) == 1
            name = f"force_{member.effect.slug}" + ("" if one else f"_{axis}")
            sums[axis] += getattr(part, name)
    assert [out.omega_X, out.omega_Y, out.omega_N] == pytest.approx(list(sums.values()), abs=1e-12)
    assert max(map(abs, sums.values())) > 0.1


def test_without_effects_there_is_no_model_error_at_all():
    _, out = sail(Params(), 1.0)
    assert (out.omega_X, out.omega_Y, out.omega_N) == (0.0, 0.0, 0.0)
    assert not any(out.change)
    assert not any(out.outside)


@pytest.mark.parametrize("values", [{"X_u": -100.0, "Y_v": -9.0}, {"N_absr_r": -5.0, "delta_X_u": -1.0}])
def test_scaled_damping_is_that_of_the_ship_at_hand(values):
    """What remains without damping is the same; the rest is one and a half times as much."""
    s = State(0.0, 0.0, 0.3, 0.2, -0.1, 0.15, 0.0)

    def omega_star(**more):
        _, out = COMPONENT.step(s, Force(0.0, 0.0, 0.0), with_params(COMPONENT, **values, **more), 0.0)
        return np.array([out.omega_X, out.omega_Y, out.omega_N])

    _, _, damping = hull(with_params(COMPONENT, **values), vessel_effects(EFFECTS))
    gained = omega_star(scale_damping=0.5) - omega_star()
    assert gained == pytest.approx(0.5 * np.array(damping_force(s.u, s.v, s.r, damping)), abs=1e-12)


@given(st.floats(-3.0, 3.0), speeds, speeds)
def test_earth_force_pushes_the_same_way_on_every_heading(psi, F_n, F_e):
    X, Y, N = EFFECTS["earth_force"].function(Motion(psi=psi), F_n, F_e, 100.0, 0.0)
    assert rotate_to_earth(psi, X, Y) == pytest.approx((F_n, F_e), abs=1e-12)
    assert N == 0.0


def test_a_ship_without_thrust_drifts_with_the_current():
    s, _ = sail(with_params(COMPONENT, V_n=0.03, V_e=0.02), 300.0, 0.02, Force())
    n, e = rotate_to_earth(s.psi, s.u, s.v)
    assert (n, e) == pytest.approx((0.03, 0.02), abs=1e-3)


def test_the_integration_stays_of_fourth_order_with_effects():
    p = with_params(COMPONENT, F_n=0.3, F_e=-0.2, V_n=0.05, wave_force=0.2, body_bias_N=0.05)
    # Through no kink of |u|, |v| or |r|.
    start = State(psi=0.3, u=0.4, v=0.3, r=0.4)
    ends = [sail(p, 0.32, h, start=start)[0] for h in (0.02, 0.01, 0.0025)]
    coarse, fine = (math.dist(ends[k][:6], ends[2][:6]) for k in (0, 1))
    assert coarse / fine > 12.0


def test_waves_have_the_strength_the_peak_and_the_drift_that_were_asked_for():
    t = np.arange(0.0, 3600.0, 0.05)
    F = np.array(EFFECTS["waves"].function(Motion(t=t), 0.3, 0.1, 4.0, 0.0, 0.1)[0])
    assert F.mean() == pytest.approx(0.1, abs=0.003)
    assert F.std() == pytest.approx(0.3, rel=0.02)
    spectrum = np.abs(np.fft.rfft(F - F.mean())) ** 2
    peak = 2 * math.pi * np.fft.rfftfreq(len(t), 0.05)[spectrum.argmax()]
    assert peak == pytest.approx(4.0, rel=0.1)
    assert np.abs(surface(t, 4.0)).max() < 4.0


@pytest.mark.parametrize(
    ("name", "value", "same"),
    [
        ("mass", 2.0, Inertia(m=14.79 + 2.0, I_z=1.76 * (1.0 + 2.0 / 14.79))),
        ("centre_of_gravity", 0.1, Inertia(x_g=0.0375 + 0.1)),
        ("added_mass_X", 2.0, Inertia(X_udot=-4.0)),
        ("added_mass_Y", 2.0, Inertia(Y_vdot=-12.0)),
        ("added_mass_N", 2.0, Inertia(N_rdot=-3.0)),
    ],
)
def test_other_inertia_is_another_ship_and_a_model_error(name, value, same):
    changed, out = sail(with_params(COMPONENT, **{name: value}))
    other, plain = sail(Params(inertia=same))
    assert changed == pytest.approx(other, abs=1e-12)
    assert any(abs(w) > 1e-4 for w in (out.omega_X, out.omega_Y, out.omega_N))
    assert plain.omega_X == 0.0


def test_measurement_effects_change_the_measurement_and_nothing_else():
    p = with_params(COMPONENT, heading_offset=0.1, marker_offset_dx=0.2, marker_offset_dy=-0.1)
    s, out = sail(p)
    true, _ = sail(Params())
    assert s == true
    dx, dy = rotate_to_earth(s.psi, 0.2, -0.1)
    assert out.measured.x_m == pytest.approx(s.x + dx)
    assert out.measured.y_m == pytest.approx(s.y + dy)
    assert math.remainder(out.measured.psi_m - s.psi, 2 * math.pi) == pytest.approx(0.1)


def test_an_effect_switched_on_during_a_run_makes_no_jump():
    s, _ = sail(Params(), 2.0)
    p = with_params(COMPONENT, V_n=0.1, mass=3.0, delta_X_u=-4.0, F_n=0.5)
    after, _ = COMPONENT.step(s, Force(), p, 0.0)
    assert after == s


# Thrusters


def push(p, request=(0.5, 0.3, 0.1), velocity=VelocityInCurrent(), steps=1, h=0.01, model=THRUSTERS):
    s, out = model.init(None, p), None
    for _ in range(steps):
        s, out = model.step(s, Inputs(Force(*request), velocity), p, h)
    return out


def act(out):
    return out.tau_act_X, out.tau_act_Y, out.tau_act_N


def cmd(out):
    return out.tau_cmd_X, out.tau_cmd_Y, out.tau_cmd_N


def thruster_params(**changed):
    return with_params(THRUSTERS, **changed)


@pytest.mark.parametrize(("axis", "k"), [("surge", 0), ("sway", 1), ("yaw", 2)])
def test_loss_on_an_axis_takes_its_share_of_that_axis(axis, k):
    out = push(thruster_params(**{f"loss_{axis}": 0.3}))
    shares = [a / c for a, c in zip(act(out), cmd(out), strict=True)]
    assert shares == pytest.approx([0.7 if j == k else 1.0 for j in range(3)])


def test_losses_of_the_thrusters_add_up_to_a_loss_of_all():
    both = push(thruster_params(loss_vsp=0.25, loss_bow=0.25))
    assert act(both) == pytest.approx([0.75 * c for c in cmd(both)])
    bow = push(thruster_params(loss_bow=1.0), (0.0, 0.0, 0.5))
    # Without the bow the aft thrusters alone push the stern aside.
    assert bow.tau_act_Y == pytest.approx(bow.tau_act_N / -0.4575)


def test_bow_thruster_fails_at_its_time():
    p = thruster_params(bow_failure_time=0.05)
    before, after = push(p, steps=4), push(p, steps=5)
    assert act(before) == pytest.approx(cmd(before))
    assert act(after) == pytest.approx(act(push(thruster_params(loss_bow=1.0))))


@pytest.mark.parametrize("device", ["bow", "vsp"])
def test_thruster_that_is_out_comes_back(device):
    names = ("start_2", "end_2", "start_7", "end_7")
    out = dict(zip((f"{device}_outage_{n}" for n in names), (0.02, 0.04, 0.06, 0.07), strict=True))
    dead = act(push(thruster_params(**{f"loss_{device}": 1.0})))
    for steps in range(1, 10):
        force = act(push(thruster_params(**out), steps=steps))
        gone = steps in (2, 3, 6)  # the force of a step is that at its end
        assert force == pytest.approx(dead if gone else act(push(thruster_params(), steps=steps)))


def test_bow_loses_effect_with_speed_and_never_turns_round():
    p = thruster_params(bow_speed_loss=2.0)
    assert act(push(p)) == pytest.approx(cmd(push(p)))
    for u in (0.2, -0.2):
        half = act(push(p, velocity=VelocityInCurrent(u, 0.0, 0.0)))
        assert half == pytest.approx(act(push(thruster_params(loss_bow=0.4))))
    assert act(push(p, velocity=VelocityInCurrent(2.0, 0.0, 0.0))) == pytest.approx(
        act(push(thruster_params(loss_bow=1.0)))
    )


@given(st.floats(-1.0, 1.0), st.floats(0.0, 0.5))
def test_deadband_loses_small_forces_and_reduces_the_rest(X, d):
    out = push(thruster_params(deadband=d), (X, 0.0, 0.0))
    assert out.tau_act_X == pytest.approx(math.copysign(max(0.0, abs(X) - d), X), abs=1e-12)


def test_saturation_limits_what_acts_and_not_what_is_commanded():
    out = push(thruster_params(saturation_vsp=0.4), (1.0, 0.0, 0.0))
    assert (out.tau_cmd_X, out.tau_act_X) == pytest.approx((1.0, 0.4))


def test_point_of_attack_is_that_of_the_plant():
    by_effect = push(thruster_params(attack_point_dx=0.05, attack_point_dy=-0.02))
    by_plant = push(thruster_params(plant_p_x=0.05, plant_p_y=-0.02))
    assert act(by_effect) == pytest.approx(act(by_plant))
    X, Y, N = cmd(by_effect)
    assert by_effect.tau_act_N == pytest.approx(N + 0.05 * Y + 0.02 * X)


def test_thrust_curve_is_asymmetric_and_has_a_dead_band():
    p = thruster_params(thrust_curve_ahead=0.2, thrust_curve_astern=-0.5, thrust_curve_deadband=0.1)
    F = 1.165
    expected = {0.05: 0.0, 0.6: 1.2 * 0.5 * F, -0.6: -0.5 * 0.5 * F}
    for c, force in expected.items():
        assert push(p, (c * F, 0.0, 0.0)).tau_act_X == pytest.approx(force, abs=1e-12)


def test_free_curves_pass_through_their_nodes():
    p = thruster_params(curve_vsp_x_c_16=0.1, curve_bow_u_11=-0.5)
    assert push(p, (0.5 * 1.165, 0.0, 0.0)).tau_act_X == pytest.approx(0.5 * 1.165 + 0.1)
    moving = push(p, (0.0, 0.0, 0.5), VelocityInCurrent(0.3, 0.0, 0.0))
    assert act(moving) == pytest.approx(act(push(thruster_params(loss_bow=0.5), (0.0, 0.0, 0.5))))
    ship = Motion(u=0.3)
    nodes = [0.0] * 21
    nodes[15] = 2.0
    assert EFFECTS["curve_X(u)"].function(ship, *nodes, 0.6)[0] == pytest.approx(2.0)


@pytest.mark.parametrize("steps", [1, 2, 50])
def test_a_lag_acts_in_each_step_with_its_mean(steps):
    """By one step or fifty, the impulse of a step of 1 N is the integral of 1 - exp(-t / T)."""
    T, p, impulse = 0.5, thruster_params(lag=0.5), 0.0
    s, h = THRUSTERS.init(None, p), 0.5 / steps
    for _ in range(steps):
        s, out = THRUSTERS.step(s, Inputs(Force(1.0, 0.0, 0.0), VelocityInCurrent()), p, h)
        impulse += h * out.tau_act_X
    assert impulse == pytest.approx(T * math.exp(-1.0))


def test_a_lag_gives_its_value_where_no_time_passes():
    p = thruster_params(lag=0.5)
    s, _ = THRUSTERS.step(THRUSTERS.init(None, p), Inputs(Force(1.0, 0.0, 0.0)), p, 0.5)
    after, out = THRUSTERS.step(s, Inputs(Force(-1.0, 0.0, 0.0)), p, 0.0)
    assert out.tau_act_X == pytest.approx(1.0 - math.exp(-1.0), abs=1e-5)
    assert after == s


@pytest.mark.parametrize("delay", [0.01, 0.2, 0.63, 3.0])
def test_delay_brings_every_command_later(delay):
    p = thruster_params(delay=delay)
    s = THRUSTERS.init(None, p)
    acted = []
    for k in range(500):
        request = Force(0.5 if k >= 100 else 0.0, 0.0, 0.0)
        s, out = THRUSTERS.step(s, Inputs(request, VelocityInCurrent()), p, 0.01)
        acted.append(out.tau_act_X)
    # A delay longer than the memory is kept in steps of a sixty-third of itself.
    first = next(k for k, X in enumerate(acted) if X > 0.0)
    assert (first - 100) * 0.01 == pytest.approx(delay, abs=0.0051 if delay < 0.63 else delay / 30)
    assert acted[-1] == pytest.approx(0.5)


def test_rate_limit_holds():
    out = push(thruster_params(plant_rate=2.0), (1.165, 0.0, 0.0), steps=10)
    assert out.tau_act_X == pytest.approx(0.19 * 1.165)  # the mean of the tenth step, 0.18 to 0.2


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-0.5, 0.5))
def test_propeller_allocation_knows_the_square(X, Y, N):
    p = PROPELLER.params()
    out = push(p, (X, Y, N), model=PROPELLER)
    assert act(out) == pytest.approx(cmd(out), abs=1e-12)
    straight = push(THRUSTERS.params(), (X, Y, N))
    assert abs(out.u_vsp_x) >= abs(straight.u_vsp_x) - 1e-12


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), speeds)
def test_table_starts_as_the_straight_line(X, Y, u):
    p = TABLE.params()
    out = push(p, (X, Y, 0.1), VelocityInCurrent(u, 0.1, 0.0), model=TABLE)
    assert act(out) == pytest.approx(cmd(out), abs=1e-12)


def test_table_interpolates_over_command_and_inflow():
    p = with_params(TABLE, table_vsp_x_9_1=1.0, table_vsp_x_9_2=0.8, table_vsp_x_9_3=0.6)
    for u, share in ((0.0, 1.0), (0.1, 0.9), (0.2, 0.8), (0.4, 0.6), (1.0, 0.6)):
        out = push(p, (9.0, 0.0, 0.0), VelocityInCurrent(u, 0.0, 0.0), model=TABLE)
        assert out.tau_act_X == pytest.approx(share * 1.165)


def test_actuator_effects_leave_what_they_do_not_concern():
    commands = (0.3, 0.2, 0.1)
    now = Running(0.0, 0.1, 0.0, 0.0, commands, (0.3, 0.2, 0.3, 0.2, 0.1), (1.0, 1.0, 1.0))
    f = Thrust((0.3, 0.3, 0.0), (0.2, 0.2, 0.1), (-0.4, -0.4, 0.4), (-0.1, 0.1, 0.0), (0.5, 0.5, 1.0))
    for e in EFFECTS.of_kind("actuator"):
        if e.memory is None:
            given = e.function(f, now, *[p.start for p in e.parameters])
            assert flatten(given) == pytest.approx(flatten(f)), e.id


# The registry from outside


def command(module, *arguments, cwd):
    return subprocess.run(
        [sys.executable, "-m", module, *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )


def test_values_that_are_tried_are_allowed_and_those_of_one_parameter_grow():
    for name in EFFECTS:
        effect = EFFECTS[name]
        tries = effect.search.tries if isinstance(effect.search.tries, list) else []
        ranges = {p.name: p.range for p in effect.parameters}
        for parameter, value in (pair for each in tries for pair in each.items()):
            low, high = ranges[parameter].min, ranges[parameter].max
            assert low is None or low <= value, (name, parameter)
            assert high is None or value <= high, (name, parameter)
        alone = [value for each in tries if len(each) == 1 for value in each.values()]
        if len({parameter for each in tries for parameter in each}) == 1:
            assert alone == sorted(set(alone)), name


def test_no_more_than_all_of_a_force_is_lost_and_it_is_no_more_than_doubled():
    ranges = [p.range for name in EFFECTS if name.startswith("loss_") for p in EFFECTS[name].parameters]
    assert len(ranges) > 3
    assert all((1.0 - r.max, 1.0 - r.min) == (0.0, 2.0) for r in ranges)


def test_documentation_table_is_that_of_the_registry():
    assert (ROOT / "docs" / "effects.md").read_text() == effects_table(EFFECTS)


def test_one_function_in_one_file_adds_an_effect_to_the_fmu(tmp_path):
    (tmp_path / "mine.py").write_text(OWN.format(body=GOOD))
    done = command("fmus.build", "vessel", "--effects", "mine.py", "--out", "fmu", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    result = fmpy.simulate_fmu(
        str(tmp_path / "fmu" / "vessel.fmu"),
        start_values={"N_uuv": 100.0, "u_0": 0.3, "v_0": 0.2},
        output=["u", "v", "force_N_uuv", "omega_N"],
        stop_time=0.05,
        step_size=0.01,
    )
    expected = 100.0 * result["u"] ** 2 * result["v"]
    assert result["force_N_uuv"] == pytest.approx(expected)
    assert result["omega_N"] == pytest.approx(expected)
    assert expected[-1] > 0.1
    assert "N_uuv" in command("fmus.effects", "mine.py", cwd=tmp_path).stdout


@pytest.mark.parametrize(
    ("text", "stated"),
    [
        (OWN.format(body="N_uuv if ship.u > 0.0 else 0.0"), "mine.py:8"),
        (OWN.format(body=GOOD).replace("N_uuv", "delta_X_u"), "effect 'X_u' already"),
        (OWN.format(body=GOOD).replace('"N_uuv"', '"X_u"'), "'X_u' already"),
        (OWN.format(body=GOOD).replace('"force"', '"farce"'), "no kind 'farce'"),
        (OWN.format(body=GOOD).replace('    """A moment of my own."""\n', ""), "docstring"),
        (
            OWN.format(body=GOOD).replace("formula=", "memory=((0.0, 0.0),), formula="),
            "'mine.py': N_uuv: a memory is of an actuator, and the kind is 'force'",
        ),
        (
            OWN.format(body="X_u * ship.u").replace("N_uuv:", "X_u:"),
            "'mine.py': vessel declares X_u more than once",
        ),
        ("x = 1", "registers no effect"),
        ("class Other:\n    pass", "registers no effect"),
        ("import nowhere_at_all", "nowhere_at_all"),
    ],
)
def test_a_wrong_file_of_effects_is_told_in_one_line(tmp_path, text, stated):
    (tmp_path / "mine.py").write_text(text)
    done = command("fmus.build", "vessel", "--effects", "mine.py", "--out", "fmu", cwd=tmp_path)
    assert done.returncode == 2
    assert stated in done.stderr
    assert done.stderr.count("\n") == 1
    assert not list(tmp_path.glob("fmu/*"))


@pytest.mark.parametrize("linear", [False, True])
@pytest.mark.parametrize("declared", [None, False, True])
@pytest.mark.parametrize("fitted", [None, (), ("one",)])
def test_a_regression_finds_what_is_declared_or_follows_from_linearity(linear, declared, fitted):
    effect = replace(
        EFFECTS["X_uuu"], linear=linear, search=Search(differentiable=declared, fitted=fitted)
    )
    differentiable = linear if declared is None else declared
    assert effect.differentiable is differentiable
    default = effect.coefficients if differentiable else ()
    assert effect.fitted == (default if fitted is None else fitted)
    assert not set(effect.coefficients) & set(effect.shape_parameters)
