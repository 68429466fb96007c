"""The force of the thrusters along a run: from series the same as from the steps of their FMU."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.closed_form import Allocation, allocate
from support.cse1 import EFFECTS, FIVE, Inputs
from support.cse1 import THRUSTERS as COMPONENT
from support.measured import sail

from diagnosis import Model, Run
from diagnosis.predictors import ship_with
from diagnosis.predictors.thrust import Response, thrust
from diagnosis.runs.held_signal import Integral
from fmus.actuators.response import layouts
from fmus.declare import variables
from fmus.ops import wrap
from fmus.signals import Force, VelocityInCurrent

# Of every effect on thrusters, and of every other parameter of the plant's, a value that matters.
VALUES = {
    "thrust_curve_ahead": -0.3,
    "thrust_curve_astern": 0.2,
    "thrust_curve_deadband": 0.1,
    "bow_failure_time": 11.0,
    "deadband": 0.05,
    "saturation_vsp": 0.4,
    "saturation_bow": 0.3,
    "bow_speed_loss": 2.0,
    "lag": 0.7,
    "delay": 0.36,
    "plant_rate": 0.2,
    "plant_l_vsp": -0.4,
    "plant_l_bow": 0.3,
    "plant_F_vsp": 0.9,
    "plant_F_bow": 2.0,
    "power_vsp": 0.7,
    "power_bow": 0.6,
    "bow_outage_start_1": 3.0,
    "bow_outage_end_1": 7.5,
    "bow_outage_start_8": 20.0,
    "bow_outage_end_8": 26.02,
    "vsp_outage_start_1": 0.0,
    "vsp_outage_end_1": 4.0,
    "vsp_outage_start_2": 12.0,
    "vsp_outage_end_2": 12.5,
    "cross_vsp_sway": 0.5,
    "cross_vsp_surge": 0.5,
}
EFFECTS = EFFECTS.of_kind("actuator")
BY_EFFECT = {e.id: {n: VALUES.get(n, 0.1) for n in e.coefficients} for e in EFFECTS}
BY_EFFECT["power_exponent"] |= {"power_vsp": 0.7, "power_bow": 0.6}  # at full power it does nothing
OTHERS = [
    n
    for n in (v.name for v in variables(COMPONENT.params))
    if n.startswith(("plant_", "power_"))
    and n not in BY_EFFECT
    and not n.endswith(("P_idle", "P_full", "bow_y"))  # no part of its force, or along it
]
BY_PARAMETER = {n: {n: VALUES.get(n, 0.02)} for n in OTHERS}
TOGETHER = {"delay and lag": {"delay": 0.36, "lag": 0.7}, "all": {**VALUES, "loss_bow": 0.2}}


@cache
def sailed():
    """The run that is varied, and its true velocity (n, 3)."""
    return sail(16.0, noise=0.0)


def base():
    return sailed()[0]


def true_nu():
    return sailed()[1]


def acting(run, model, nu):
    """tau_act (n, 3) by series."""
    return thrust(run, model, Response(run, model).between_samples, nu)


def by_steps(run, nu, values):
    """tau_act (n, 3) of the thrusters' FMU, stepped from sample to sample."""
    model = Model(thrusters=values)
    h = float(np.median(np.diff(run.time)))
    # The force over the step that begins at a sample follows from the command of that sample.
    past, out = COMPONENT.init(Inputs(), model.drive.params)._replace(t=run.time[0] - h), []
    for tau, velocity in zip(run.tau_cmd.tolist(), nu.tolist(), strict=True):
        inputs = Inputs(Force(*tau), VelocityInCurrent(*velocity))
        past, outputs = COMPONENT.advance(past, inputs, model.drive, h)
        out.append(outputs[6:])
    return np.array(out)


@cache
def nominal_steps():
    return by_steps(base(), true_nu(), {})


@pytest.mark.parametrize("values", (cases := BY_EFFECT | BY_PARAMETER | TOGETHER).values(), ids=cases)
def test_mean_force_over_each_interval_from_series_is_that_of_the_steps(values):
    """Within 1e-9 N; of a lag 6e-6 of what was commanded twelve time constants ago is forgotten."""
    expected = by_steps(base(), true_nu(), values)
    force = acting(base(), Model(thrusters=values), true_nu())
    forgotten = 2e-5 if values.get("lag") else 1e-9
    np.testing.assert_allclose(force, expected, atol=forgotten)
    assert np.abs(expected - nominal_steps()).max() > 1e-3, "the value matters"


@pytest.mark.parametrize(
    "values",
    [
        {"bow_failure_time": 3.013},
        {"bow_outage_start_1": 3.004, "bow_outage_end_1": 7.519},
        {"bow_outage_start_1": 3.004, "bow_outage_end_1": 3.011, "vsp_outage_start_1": 2.0, "vsp_outage_end_1": 3.009},
    ],
    ids=["for good", "for a time", "three changes in one row"],
)  # fmt: skip
def test_a_failure_between_two_samples_has_the_mean_force_of_both_sides(values):
    """As in rows that begin at the change points, with the same commands and speeds."""
    run, nu, model = base(), true_nu(), Model(thrusters=values)
    every = np.union1d(run.time, [*values.values()])
    row = np.searchsorted(run.time, every, side="right") - 1
    split = replace(run, time=every, pose=run.pose[row], tau_cmd=run.tau_cmd[row])
    parts = acting(split, model, nu[row])[:-1] * np.diff(every)[:, None]
    whole = np.array([parts[row[:-1] == k].sum(axis=0) for k in range(run.time.size - 1)])
    force = acting(run, model, nu)[:-1]
    assert force == pytest.approx(whole / np.diff(run.time)[:, None], abs=1e-12)
    there = np.searchsorted(run.time, max(values.values())) - 1
    rounded = acting(run, Model(thrusters=dict.fromkeys(values, run.time[there])), nu)[there]
    assert np.abs(force[there] - rounded).max() > 1e-3, "the time within the row matters"


@pytest.mark.parametrize(
    "values",
    [v for e, v in BY_EFFECT.items() if "vsp" in e],
    ids=[e for e in BY_EFFECT if "vsp" in e],
)
def test_two_propellers_with_the_same_commands_are_twice_the_one_that_stands_for_both(values):
    """One set of the FMU stands for both, at the mean of their places: to port and starboard alike."""
    run, nu = base(), true_nu()
    u = np.column_stack(allocate(*run.tau_cmd.T, Allocation()))
    u[:, 2] = 0.0
    one = replace(run, commands=u)
    two = replace(run, commands=np.column_stack([u[:, :2], u[:, :2], u[:, 2]]), signals=FIVE)
    if len(values) == 21:
        values = {n: 0.01 * k for k, n in enumerate(values)}
    model = Model(thrusters=values)
    by_one, by_two = (acting(r, model, nu) for r in (one, two))
    np.testing.assert_allclose(by_two, 2.0 * by_one, atol=1e-12)


def test_a_propeller_to_port_that_pushes_ahead_turns_the_ship_to_starboard():
    """By 0.055 m, whether it is a set of its own or half of one."""
    still = Model()
    for k, name in enumerate(("vsp1", "vsp2")):
        model = Model(thrusters={f"curve_{name}_x_c_{node}": 0.2 for node in range(1, 22)})
        idle = replace(base(), commands=np.zeros((base().time.size, 5)), signals=FIVE)
        for run in (base(), idle):
            push, none = (acting(run, m, true_nu()) for m in (model, still))
            X, Y, N = (push - none).T
            np.testing.assert_allclose(X, 0.2 if run is idle else 0.1)
            np.testing.assert_allclose(Y, 0.0, atol=1e-12)
            np.testing.assert_allclose(N, (0.055, -0.055)[k] * X)


def along_time(response):
    """Commands that arrive and shares that act (n, 3), or the one that is both."""
    return np.moveaxis(response.between_samples, -1, 1)


@pytest.mark.parametrize("period", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("delay", [0.013, 0.1, 0.33, 1.2, 3.0])
def test_delay_is_that_of_the_held_commands_whatever_the_period(period, delay):
    t = np.arange(round(20.0 / period)) * period
    tau = np.column_stack([np.sign(np.sin(0.7 * t)), 0.0 * t, 0.0 * t])
    run = Run("steps", t, np.zeros((t.size, 3)), tau)
    (given,) = along_time(Response(run, Model(thrusters={"delay": delay})))  # what arrives acts
    (nominal,) = along_time(Response(run, Model()))
    held = Integral(np.append(t, t[-1] + period), nominal, 0.0 * nominal[0])
    ends = np.append(t, t[-1] + period) - delay
    exact = np.diff(held(ends), axis=0) / period
    # What a delay remembers lies a step apart, so that an edge is smeared over a step of the grid.
    smeared = np.abs(np.cumsum(given - exact, axis=0) * period).max()
    assert smeared <= max(0.02, delay / 60.0) * np.abs(nominal).max()


def test_a_run_that_begins_under_way_had_its_first_command_before():
    model = Model(thrusters={"lag": 1.0})
    rest, moving = (along_time(Response(base(), model, moving=m))[1] for m in (False, True))
    first = along_time(Response(base(), Model()))[0][0]
    np.testing.assert_allclose(moving[0], first, rtol=1e-5)
    assert np.abs(rest[0]).max() < 0.05 * np.abs(first).max()


def test_a_long_gap_takes_neither_time_nor_memory():
    later = np.where(base().time > 8.0, base().time + 1e9, base().time)
    run = Run("gap", later, base().pose, base().tau_cmd)
    model = Model(thrusters={"lag": 0.5})
    with_gap = along_time(Response(run, model))[1]
    without = along_time(Response(base(), model))[1]
    before = base().time < 7.9
    np.testing.assert_allclose(with_gap[before], without[before], atol=1e-9)
    after = base().time > 14.1  # twelve time constants later the gap is forgotten
    np.testing.assert_allclose(with_gap[after], without[after], atol=1e-4)


@pytest.mark.parametrize("values", [{"lag": 0.5}, {"delay": 0.5}, {"clock_offset": 0.4}], ids=str)
@pytest.mark.parametrize("seconds", [20.0, 70.0])
def test_what_was_commanded_before_a_gap_is_held_in_it(seconds, values):
    """Be it filled with rows of the last command or not."""
    k, h = 400, float(np.median(np.diff(base().time)))
    later = np.where(np.arange(base().time.size) > k, base().time + seconds, base().time)
    with_gap = Run("gap", later, base().pose, base().tau_cmd)
    rows = np.concatenate(
        [np.arange(k + 1), np.full(round(seconds / h), k), np.arange(k + 1, later.size)]
    )
    filled = Run(
        "filled", base().time[0] + h * np.arange(rows.size), base().pose[rows], base().tau_cmd[rows]
    )
    model = Model().plus(values)
    gap, whole = (along_time(Response(run, model))[-1] for run in (with_gap, filled))
    np.testing.assert_allclose(gap[k + 1 :], whole[k - later.size + 1 :], atol=1e-4)


@pytest.mark.parametrize("dynamics", [{"lag": 0.4}, {"delay": 0.37}, {"delay": 0.1, "lag": 0.7}])
def test_linear_memories_are_the_filters_that_they_declare(dynamics):
    response = Response(base(), Model(thrusters=dynamics))
    commands = np.diff(response._commands(response.step * np.arange(response._steps + 1)), axis=0)
    commands /= response.step
    forgotten = np.exp(-12.0) * np.abs(commands).max()  # what the steps of a part begin without
    np.testing.assert_allclose(
        response._signal_by_signal(commands), response._stepped(commands), atol=forgotten
    )


@pytest.mark.parametrize(
    ("of", "slow"),
    [
        ("cybership2", {"play_port_rudder": 0.2}),
        ("cybership2", {"rate_port_rudder": 0.1, "delay": 0.3}),
        ("gunnerus", {"rate_azimuth": 0.1}),
        ("gunnerus", {"rate_azimuth": 0.06, "lag_azimuth": 3.0}),
    ],
)
def test_signals_that_move_by_themselves_are_stepped_as_the_thrusters_do(of, slow):
    """Commands that jump, angles all around; a turn more or less is none."""
    made = ship_with((), of)
    layout = layouts(made.description)[0]
    jumps = np.random.default_rng(3).uniform(-1.0, 1.0, (40, len(layout.commands)))
    jumps[:, np.array(layout.round)] *= np.pi
    commands = np.repeat(0.6 * jumps, 20, axis=0)
    time = 0.5 * made.scale.time * np.arange(len(commands))
    pose = np.column_stack([0.5 * time, 0.0 * time, 0.0 * time])
    tau = made.commanded_force(commands)
    response = Response(
        Run("jumps", time, pose, tau, commands, ship=made.description), Model(ship=made).plus(slow)
    )
    given = np.diff(response._commands(response.step * np.arange(response._steps + 1)), axis=0)
    given /= response.step
    found, expected = response._signal_by_signal(given), response._stepped(given)
    assert np.abs(found - given[:, None]).max() > 0.1
    off = found - expected
    off[..., np.array(layout.round)] = wrap(off[..., np.array(layout.round)])
    np.testing.assert_allclose(off, 0.0, atol=1e-4)
