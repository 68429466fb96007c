"""The response to the commands: known motions, gains found again, and no harm where nothing is known."""

from dataclasses import replace

import numpy as np
import pytest
from support.measured import DATA, NOISE, base, needs_data, smoothed, true_nu

from diagnosis import Run, clean, read, smooth
from diagnosis.predictors import ship_with
from diagnosis.runs import without_commands
from diagnosis.runs.run_constants import NEGLIGIBLE
from diagnosis.runs.smoothing.command_motion import FORGETTING, Commands, Gains, Lateness, acting, lagged
from diagnosis.runs.smoothing.command_regression import least_squares
from diagnosis.runs.smoothing.spline import knots
from fmus.ops import wrap

N = 3000
INNER = slice(100, -100)


def commands(track, psi):
    span = track.run.time[-1] - track.run.time[0]
    return Commands(track, psi, knots(np.array([0.0]), np.array([span]), 0.05))


def rms(x):
    return np.sqrt(np.mean(np.square(x), axis=0))


def test_constant_force_moves_a_critically_damped_mass():
    run = replace(base(), tau_cmd=np.tile([1.0, -2.0, 0.5], (N, 1)))
    t, T = base().time, FORGETTING
    pushed = commands(clean(run), np.zeros(N)).response(Gains(np.eye(3), 0.0))
    expected = T**2 * (1.0 - (1.0 + t / T) * np.exp(-t / T))
    np.testing.assert_allclose(pushed.eta, np.outer(expected, [1.0, -2.0, 0.5]), rtol=1e-9, atol=1e-9)


def test_pose_velocity_and_acceleration_belong_together():
    time = 100.0 + np.arange(N) * 0.02
    force = np.column_stack([np.sin(time), np.cos(0.7 * time), np.sin(0.3 * time)])
    run = replace(base(), time=time, tau_cmd=force)
    pushed = commands(clean(run), 0.4 * np.sin(0.2 * time)).response(Gains(np.eye(3), 0.0))
    for value, rate in ((pushed.eta, pushed.eta_dot), (pushed.eta_dot, pushed.eta_ddot)):
        between = np.diff(value, axis=0) / 0.02
        np.testing.assert_allclose(between, 0.5 * (rate[1:] + rate[:-1]), atol=2e-2)
        assert np.abs(between.mean(axis=0) - rate.mean(axis=0)).max() < 1e-3


def test_heading_turns_the_response():
    track = clean(replace(base(), tau_cmd=np.random.default_rng(0).standard_normal((N, 3))))
    ahead, aside = (
        commands(track, np.full(N, psi)).response(Gains(np.eye(3), 0.0)) for psi in (0.0, 0.5 * np.pi)
    )
    for a, b in zip(ahead[:3], aside[:3], strict=True):
        np.testing.assert_allclose(b, np.column_stack([-a[:, 1], a[:, 0], a[:, 2]]), atol=1e-12)


def test_delayed_commands_have_a_delayed_response():
    track = clean(base())
    now, late = (
        commands(track, np.zeros(N)).response(Gains(np.eye(3), 0.0), Lateness(by)) for by in (0.0, 0.5)
    )
    np.testing.assert_allclose(late.eta_ddot[25:], now.eta_ddot[:-25], atol=0.06)


def driven(seed, gains, late=0.0):
    """A run, and its true velocity in NED, that nothing but jumping commands drives at zero heading."""
    rng = np.random.default_rng(seed)
    time = np.arange(N) * 0.02
    tau = np.repeat(rng.standard_normal((N // 20, 3)), 20, axis=0)
    a = tau[np.maximum(np.arange(N) - round(late / 0.02), 0)] @ np.array(gains).T
    eta_dot = np.cumsum(np.vstack([np.zeros((1, 3)), a[:-1] * 0.02]), axis=0)
    eta = np.cumsum(np.vstack([np.zeros((1, 3)), eta_dot[:-1] * 0.02 + 0.5 * a[:-1] * 0.02**2]), axis=0)
    return Run("driven", time, eta + NOISE * rng.standard_normal((N, 3)), tau), eta_dot


@pytest.mark.parametrize("late", [0.0, pytest.param(0.34, marks=pytest.mark.quick)])
def test_motion_by_commands_alone_is_found_again(late):
    run, eta_dot = driven(3, [[0.05, 0.0, 0.0], [0.0, 0.04, 0.01], [0.0, 0.0, 0.0]], late)
    knowing = smooth(clean(run))
    blind = without_commands(knowing)
    better = rms((blind.eta_dot - eta_dot)[INNER]) / rms((knowing.eta_dot - eta_dot)[INNER])
    assert (better[:2] > 4.0).all()
    assert knowing.delay == pytest.approx(late, abs=0.02)


def test_commands_that_do_nothing_do_no_harm():
    tau = np.random.default_rng(2).standard_normal((N, 3))
    for command in (0.0 * tau, 0.0 * tau + 0.3, tau):
        run = replace(base(), tau_cmd=command)
        knowing = smooth(clean(run))
        blind = without_commands(knowing)
        assert (rms((knowing.nu - true_nu())[INNER]) < 1.05 * rms((blind.nu - true_nu())[INNER])).all()


@pytest.mark.slow
@needs_data
def test_every_run_of_the_real_ship_says_how_late_its_thrusters_are():
    late = [smoothed(read(path)).delay for path in sorted((DATA / "cse1").glob("*.mat"))[::2]]
    assert len(late) == 2
    assert 0.35 <= min(late) <= max(late) <= 0.45


def test_commands_that_are_the_same_are_no_trouble():
    run, eta_dot = driven(4, 0.02 * np.eye(3))
    same = replace(run, tau_cmd=run.tau_cmd[:, [0, 0, 2]])
    found = smooth(clean(same))
    assert np.isfinite(found.nu).all()
    assert rms((found.eta_dot - eta_dot)[INNER])[0] < 2e-3


def test_commands_that_differ_for_a_moment_are_not_told_apart():
    """What happens in that moment would be the work of their difference, however large."""
    command, moment = np.sin(0.01 * np.arange(N)), np.arange(N) < 5
    a = np.column_stack([command, command + 0.1 * moment])
    z = command + 3.0 * moment
    assert np.abs(least_squares(a, z)).max() > 20.0
    assert least_squares(a, z, NEGLIGIBLE**2) == pytest.approx([0.5, 0.5], abs=0.02)


def test_in_a_unit_that_is_not_the_ships_gains_are_fitted_and_it_does_not_matter():
    small, large = (
        smooth(clean(replace(base(), tau_cmd=unit * base().tau_cmd))).nu for unit in (1e-6, 1e6)
    )
    np.testing.assert_allclose(small, large, atol=1e-9)
    off, described = (rms(nu - true_nu()) for nu in (small, smoothed(base()).nu))
    assert (off < 1.5 * described).all()


def test_parts_far_apart_are_smoothed_each_by_itself():
    half = N // 2
    later = replace(base(), time=base().time + np.where(np.arange(N) < half, 0.0, 100.0))
    apart, whole = (smooth(clean(run)).nu for run in (later, base()))
    assert np.isfinite(apart).all()
    inner = np.r_[100 : half - 100, half + 100 : N - 100]
    assert (rms((apart - true_nu())[inner]) < 1.2 * rms((whole - true_nu())[inner])).all()


def on_a_line(name, commands, force, gains):
    """A run of a ship whose accelerations are gains (3,) times a force (n, 3), and its velocity."""
    of = ship_with((), name)
    a = 0.1 * force * gains
    nu = np.cumsum(a, axis=0) - a + [0.5, 0.0, 0.0]
    way = 0.1 * (nu + 0.5 * a)
    psi = np.cumsum(way[:, 2]) - way[:, 2]
    steps = np.column_stack([way[:, 0] * np.cos(psi), way[:, 0] * np.sin(psi), way[:, 2]])
    pose = np.cumsum(steps, axis=0) - steps
    noise = 5e-3 * np.random.default_rng(6).standard_normal((N, 3))
    run = Run(
        "line",
        0.1 * np.arange(N),
        pose + noise,
        of.commanded_force(commands),
        commands,
        ship=of.description,
    )
    return run, nu


def times_better(run, nu, axis):
    """By how much the response to the commands betters the velocity on an axis."""
    knowing = smooth(clean(run))
    wrong = (rms((found.nu - nu)[INNER])[axis] for found in (without_commands(knowing), knowing))
    return np.divide(*wrong)


@pytest.mark.quick
def test_a_rudder_acts_by_the_speed_of_the_ship():
    """At rest it has no force, and commands of it would explain nothing."""
    helm = np.repeat(np.random.default_rng(1).uniform(-0.5, 0.5, N // 60), 60)
    commands = np.column_stack([*[np.full(N, 5.0)] * 2, 0.0 * helm, helm, helm])
    force = ship_with((), "cybership2").commanded_force(commands, None, 0.5) * [0.0, 0.0, 1.0]
    run, nu = on_a_line("cybership2", commands, force - force.mean(axis=0), [0.0, 0.0, 0.05])
    assert not run.tau_cmd[:, 2].any()
    assert times_better(run, nu, 2) > 1.4


def test_a_force_comes_as_late_as_the_described_lag_of_its_actuator():
    """Taken for one that jumps with the command, it would shift the motion to the front."""
    n = np.repeat(np.random.default_rng(2).uniform(2.0, 14.0, (N // 60, 2)), 60, axis=0)
    late = np.column_stack([lagged(c, np.full(N, 0.1), 1.0) for c in n.T])
    force = ship_with((), "otter").commanded_force(late) * [1.0, 0.0, 1.0]
    run, nu = on_a_line("otter", n, force - force.mean(axis=0), [2e-3, 0.0, 2e-3])
    of = ship_with((), "otter").description
    parts = [p._replace(values=tuple(v for v in p.values if v.name != "lag")) for p in of.actuators]
    prompt = replace(run, ship=of._replace(actuators=tuple(parts)))
    assert times_better(run, nu, 2) > 2.0 * times_better(prompt, nu, 2)


def test_means_behind_a_lag_are_those_of_its_differential_equation():
    steps, x = np.array([0.2, 1.0, 0.1, 3.0]), np.array([1.0, 3.0, -1.0, 0.5])
    fine = 1e-5
    y, means = x[0], []
    for value, step in zip(x, steps, strict=True):
        path = value + (y - value) * np.exp(-np.arange(0.5 * fine, step, fine) / 0.7)
        means.append(path.mean())
        y = value + (y - value) * np.exp(-step / 0.7)
    np.testing.assert_allclose(lagged(x, steps, 0.7), means, rtol=1e-6)
    assert lagged(x, steps, 0.0) is x


def test_a_turn_that_a_rudder_begins_is_no_force_to_the_other_side():
    """The rudder pushes the stern aside, and u r soon moves the ship the other way."""
    helm = np.repeat(np.random.default_rng(3).uniform(-0.5, 0.5, N // 60), 60)
    commands = np.column_stack([*[np.full(N, 5.0)] * 2, 0.0 * helm, helm, helm])
    of, h, u = ship_with((), "cybership2"), 0.1, 0.5
    force = of.commanded_force(commands, None, u)
    nu, pose, states = np.array([u, 0.0, 0.0]), np.zeros(3), []
    for _, Y, turning in force:
        states.append([*pose, *nu])
        rate = [0.0, 0.02 * Y - 0.05 * nu[1], 0.03 * turning - 0.3 * nu[2]]
        after = nu + h * np.array(rate)
        middle, psi = 0.5 * (nu + after), pose[2] + 0.5 * h * nu[2]
        way = (middle[0] + 1j * middle[1]) * np.exp(1j * psi)
        pose = pose + h * np.array([way.real, way.imag, middle[2]])
        nu = after
    states = np.array(states)
    noise = [5e-2, 5e-2, 2e-3] * np.random.default_rng(8).standard_normal((N, 3))
    run = Run(
        "turn",
        h * np.arange(N),
        states[:, :3] + noise,
        of.commanded_force(commands),
        commands,
        ship=of.description,
    )
    assert times_better(run, states[:, 3:], 1) > 1.65


def test_a_lagging_angle_that_goes_round_takes_the_shorter_way():
    """An azimuth that turns at 0.1 rad/s with a lag of 1 s is 0.1 rad behind, turn after turn."""
    of, time = ship_with((), "gunnerus"), 0.1 * np.arange(N)
    commands, behind = (np.column_stack([wrap(0.1 * t), np.full(N, 2.0)]) for t in (time, time - 1.0))
    run = Run("round", time, base().pose, np.zeros((N, 3)), commands, ship=of.description)
    late, steered = acting(clean(run), np.zeros(N))
    expected = of.commanded_force(behind)
    np.testing.assert_allclose(late.run.tau_cmd[100:], expected[100:], atol=0.02 * expected.max())
    assert not steered
