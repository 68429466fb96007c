"""Commands and their response on even steps: means, delays, lags, the bend, and the likeliest delay."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import LinAlgError, expm
from scipy.stats import ttest_1samp

from diagnosis import Run, clean
from diagnosis.predictors import ship_with
from diagnosis.runs.cleaning import BRIEF
from diagnosis.runs.paired_test import surely_positive
from diagnosis.runs.smoothing import command_response, lateness
from diagnosis.runs.smoothing.command_motion import (
    FORGETTING,
    IDLE,
    SLOW,
    Commands,
    Gains,
    Lateness,
    acting,
    idle,
    lagged,
)
from diagnosis.runs.smoothing.command_regression import Regression, least_squares
from diagnosis.runs.smoothing.lateness import (
    Searched,
    likeliest_delay,
    likeliest_late,
    searched,
)
from diagnosis.runs.smoothing.penalised import Problem, Rates, Spline, solve
from diagnosis.runs.smoothing.spline import basis, knots
from fmus.scale import REFERENCE, Scale

pytestmark = pytest.mark.numerical
H, N, START = 0.1, 200, 3.0
TIME = START + H * np.arange(N)


def track(tau, time=TIME, period=H, scale=REFERENCE):
    run = Run("made", time, np.zeros((time.size, 3)), tau)
    return SimpleNamespace(run=run, period=period, scale=scale)


def commands(tau, psi=None, ends=((0.0, H * (N - 1)),), time=TIME, scale=REFERENCE, **more):
    start, end = np.array(ends).T
    psi = np.zeros(time.size) if psi is None else psi
    return Commands(track(tau, time, scale=scale), psi, knots(start, end, 0.5), **more)


def jumping(seed=0, hold=7, n=N):
    rng = np.random.default_rng(seed)
    return np.repeat(rng.standard_normal((n // hold + 1, 3)), hold, axis=0)[:n]


def held(tau, time, at):
    """The command that acts at an instant."""
    return tau[max(int(np.searchsorted(time, at, side="right")) - 1, 0)]


def test_idle_speeds_are_those_of_the_reference_times_the_scale():
    assert idle(REFERENCE).tolist() == list(IDLE)
    four = Scale(4.0 * REFERENCE.length)
    assert idle(four) == pytest.approx(np.multiply(IDLE, [2.0, 2.0, 0.5]))


@settings(max_examples=8)
@given(st.floats(-0.5, 1.5), st.integers(0, 100))
def test_a_delayed_command_is_its_mean_over_a_step_that_much_earlier(delay, seed):
    """Rows of a clock that is not even; before the run the first command was there."""
    rng = np.random.default_rng(seed)
    time = START + np.cumsum(rng.uniform(0.03, 0.3, 60))
    tau = rng.standard_normal((60, 3))
    span = time[-1] - time[0]
    c = commands(tau, ends=((0.0, span),), time=time)
    for k in (0, 3, 20, 31):
        begin = c.even[k] - delay
        fine = begin + H * (np.arange(400) + 0.5) / 400.0
        mean = np.mean([held(tau, time, t) for t in fine], axis=0)
        assert c.delayed(delay)[k] == pytest.approx(mean, abs=0.03)


def test_a_ship_at_rest_had_no_command_before():
    tau = np.ones((N, 3))
    resting, moving = (commands(tau, at_rest=at_rest).delayed(0.35) for at_rest in (True, False))
    assert moving == pytest.approx(1.0)
    assert resting[:5, 1] == pytest.approx([0.0, 0.0, 0.0, 0.5, 1.0])
    assert resting[5:] == pytest.approx(1.0)


def test_each_stretch_has_its_own_even_times_and_begins_at_rest():
    c = commands(jumping(), ends=((0.0, 5.0), (9.0, 12.0)))
    first, second = c.parts
    assert first == pytest.approx(START + H * np.arange(51))
    assert second == pytest.approx(START + 9.0 + H * np.arange(31))
    assert c.even.tolist() == [*first, *second]
    a = np.ones((c.even.size, 1))
    x, x_dot = c.motion(a)
    alone, rate = commands(jumping(), ends=((9.0, 12.0),)).motion(a[:31])
    assert x[51:] == pytest.approx(alone)
    assert x_dot[51:] == pytest.approx(rate)


@pytest.mark.parametrize("lag", [0.05, 0.7, 20.0])
def test_a_lag_forgets_exponentially(lag):
    step = np.ones((N, 3))
    found = commands(step).lagging(step, lag)
    assert found[:, 0] == pytest.approx(1.0 - np.exp(-H * np.arange(N) / lag))


def test_commands_behind_a_lag_are_their_means_over_each_step():
    """As of the lags that a ship's file describes, but from rest."""
    tau = jumping()
    c = commands(np.vstack([np.zeros((1, 3)), tau[1:]]))
    steps = np.full(c.even.size, H)
    expected = np.column_stack([lagged(x, steps, 0.7) for x in c.delayed(0.0).T])
    np.testing.assert_allclose(c.tau_late(Lateness(lag=0.7)), expected, atol=1e-12)
    np.testing.assert_array_equal(c.tau_late(Lateness(0.3)), c.delayed(0.3))


@pytest.mark.parametrize("size", [1.0, 4.0])
def test_motion_is_that_of_a_mass_that_forgets(size):
    """x'' + 2 x' / T + x / T^2 = a, of an acceleration that is held for a step; times grow as sqrt(L)."""
    scale = Scale(size * REFERENCE.length)
    c = commands(jumping(), scale=scale)
    T = FORGETTING * np.sqrt(size)
    assert c.forgetting == pytest.approx(T)
    a = jumping(1)[:, :1]
    x, x_dot = c.motion(a)
    F = np.zeros((3, 3))
    F[0, 1], F[1] = 1.0, [-1.0 / T**2, -2.0 / T, 1.0]
    step, state = expm(F * H), np.zeros(3)
    for k in range(N - 1):
        assert [x[k, 0], x_dot[k, 0]] == pytest.approx(state[:2], abs=1e-9)
        state[2] = a[k, 0]
        state = step @ state


def test_the_bend_is_the_swing_to_starboard_in_the_middle_of_each_step():
    psi, swing = 0.02 * TIME, np.sin(TIME)
    known = swing.copy()
    known[50:53] = np.nan
    c = commands(jumping(), psi, swing=known)
    expected = np.interp(
        c.even + 0.5 * H, np.delete(TIME, range(50, 53)), np.delete(swing, range(50, 53))
    )
    assert np.abs(c.bend) == pytest.approx(np.abs(expected))
    ahead = c.bend / c.rotation
    assert ahead.real == pytest.approx(0.0, abs=1e-12)
    assert ahead.imag == pytest.approx(expected)


def test_a_heading_that_is_not_known_is_on_the_line_between_those_that_are():
    psi = 0.1 * TIME
    psi[20:40] = np.nan
    c = commands(jumping(), psi)
    assert np.angle(c.rotation) == pytest.approx(np.angle(np.exp(0.1j * np.minimum(c.even, TIME[-1]))))


@pytest.mark.parametrize("bend", [0.0, 0.7])
def test_the_response_is_the_motion_of_gains_turned_into_the_plane(bend):
    G = np.array([[1.0, 0.2, 0.0], [0.1, 2.0, -0.3], [0.4, 0.0, 3.0]])
    psi, swing = 0.05 * TIME, np.cos(TIME)
    c = commands(jumping(), psi, swing=swing)
    found = c.response(Gains(G, bend), Lateness(0.3))
    surge, sway, yaw = (c.delayed(0.3) @ G.T).T
    plane = c.rotation * (surge + 1j * sway) + bend * c.bend
    north, east, turn = (c.motion(a[:, None])[0][:, 0] for a in (plane.real, plane.imag, yaw))
    assert found.eta == pytest.approx(np.column_stack([north, east, turn])[:N], abs=1e-9)
    assert found.delay == found.late.delay == 0.3
    T = c.forgetting
    whole = found.eta_ddot + 2.0 * found.eta_dot / T + found.eta / T**2
    assert whole[:, 2] == pytest.approx(yaw[:N], abs=1e-9)
    assert whole[:, 0] == pytest.approx(plane.real[:N], abs=1e-9)


# The run whose force is that behind the described lags


def test_a_ship_without_lags_is_as_it_was():
    t = track(jumping())
    assert acting(t, np.ones(N)) == (t, False)


def test_the_force_is_that_of_lagged_commands_at_the_speed_and_a_rudder_steers():
    """Where the yaw moment depends on the speed."""
    of = ship_with((), "cybership2")
    helm = np.repeat(np.random.default_rng(1).uniform(-0.5, 0.5, N // 20), 20)
    given = np.column_stack([*[np.full(N, 5.0)] * 2, 0.0 * helm, helm, helm])
    run = Run("made", TIME, np.zeros((N, 3)), of.commanded_force(given), given, ship=of.description)
    found, steered = acting(cleaned(run), np.full(N, 0.5))
    assert steered
    layout = of.layout_of(given)
    steps = np.append(np.diff(TIME), H)
    late = np.column_stack([lagged(c, steps, lag) for c, lag in zip(given.T, layout.lags, strict=True)])
    assert found.run.tau_cmd == pytest.approx(of.commanded_force(late, None, np.full(N, 0.5)))
    assert not acting(cleaned(run), np.zeros(N))[1], "at rest it does not"


def cleaned(run):
    pose = np.column_stack(
        [0.5 * run.time, 1e-3 * np.sin(7.0 * run.time), 1e-3 * np.cos(5.0 * run.time)]
    )
    return clean(Run(run.name, run.time, pose, run.tau_cmd, run.commands, ship=run.ship))


# Regression


@given(st.integers(0, 1000), st.lists(st.sampled_from([1e-6, 1.0, 1e6]), min_size=3, max_size=3))
def test_least_squares_do_not_depend_on_units(seed, units):
    rng = np.random.default_rng(seed)
    a, z = rng.standard_normal((20, 3)), rng.standard_normal(20)
    x = np.linalg.lstsq(a, z, rcond=None)[0]
    assert least_squares(a * units, z) * units == pytest.approx(x, rel=1e-6, abs=1e-9)


def test_columns_that_are_the_same_share_their_effect_and_one_that_is_zero_has_none():
    rng = np.random.default_rng(1)
    column, z = rng.standard_normal((2, 30))
    one = least_squares(column[:, None], z)[0]
    assert least_squares(np.column_stack([column, column, 0.0 * column]), z) == pytest.approx(
        [0.5 * one, 0.5 * one, 0.0]
    )


@given(
    st.integers(0, 1000), st.integers(2, 30), st.floats(-0.3, 0.8), st.sampled_from([0.05, 0.01, 1e-4])
)
def test_a_mean_is_surely_positive_by_the_one_sided_test(seed, k, mean, chance):
    values = mean + 0.5 * np.random.default_rng(seed).standard_normal(k)
    p = float(ttest_1samp(values, 0.0, alternative="greater").pvalue)
    assert surely_positive(values, chance) == (p < chance)
    assert not surely_positive(np.ones(1), chance), "one value has no spread"


def regression(tau=None, psi=None, seed=0):
    """Of a pose that is noise alone, by a spline of even knots."""
    tau = jumping(hold=20) if tau is None else tau
    c = commands(tau, psi, swing=np.sin(TIME))
    grid = c.grid
    z = np.random.default_rng(seed).standard_normal((N, 3))
    spline = Spline(
        grid, basis(grid, TIME - START), np.ones((3, int(grid.intervals.sum()))), Rates.none(grid)
    )
    p = Problem(np.arange(N), z, np.array([1.0, 2.0, 0.5]), np.ones((N, 3)), 4, spline)
    return Regression(p, solve(p, np.full(3, 10.0), np.ones((N, 3))), c, TIME - START)


def test_gains_are_found_again_where_the_pose_is_the_response_alone():
    """To what a spline takes of it: the same is taken of the motions of unit gains."""
    psi = 0.1 * TIME
    G = np.array([[1.0, 0.2, -0.5], [0.1, 2.0, -0.3], [0.4, -0.7, 3.0]])
    r = regression(psi=psi)
    response = r.commands.response(Gains(G, 0.4), Lateness(0.2))
    p = r.problem._replace(z=response.eta)
    again = Regression(p, solve(p, np.full(3, 10.0), np.ones((N, 3))), r.commands, r.time)
    found = again.gains(Lateness(0.2), bent=True)
    assert found.force == pytest.approx(G, abs=1e-5)
    assert found.bend == pytest.approx(0.4, abs=1e-5)
    straight = r.commands.response(Gains(G, 0.0), Lateness(0.2))
    p = r.problem._replace(z=straight.eta)
    again = Regression(p, solve(p, np.full(3, 10.0), np.ones((N, 3))), r.commands, r.time)
    found = again.gains(Lateness(0.2))
    assert found.force == pytest.approx(G, abs=1e-5)
    assert found.bend == 0.0


def test_slow_gains_are_found_beside_gains_that_are_described():
    """The response is that of the commands, and of the commands behind a lag of a second."""
    G = np.array([[1.0, 0.2, -0.5], [0.1, 2.0, -0.3], [0.4, -0.7, 3.0]])
    H_slow = np.array([[-0.3, 0.0, 0.1], [0.2, -0.9, 0.0], [0.0, 0.3, -1.5]])
    r = regression(psi=0.1 * TIME)
    response = r.commands.response(Gains(G, 0.4, H_slow), Lateness(0.2))
    tau, slow = r.commands.delayed(0.2), r.commands.slow(Lateness(0.2))
    by_hand = r.commands.motion((tau @ G[2] + slow @ H_slow[2])[:, None])[0][:N, 0]
    assert response.eta[:, 2] == pytest.approx(by_hand, abs=1e-9)
    rise = slow[1:] - slow[:-1] * np.exp(-H / SLOW)
    assert rise == pytest.approx((1.0 - np.exp(-H / SLOW)) * tau[:-1])
    p = r.problem._replace(z=response.eta)
    again = Regression(p, solve(p, np.full(3, 10.0), np.ones((N, 3))), r.commands, r.time)
    found = again.gains(Lateness(0.2), described=G, bent=True)
    assert found.force.tolist() == G.tolist()
    assert found.slow == pytest.approx(H_slow, abs=1e-5)
    assert found.bend == pytest.approx(0.4, abs=1e-5)


def test_a_response_that_is_not_finite_is_refused():
    r = regression()
    with pytest.raises(LinAlgError), np.errstate(all="ignore"):
        r.motions(np.full((r.commands.even.size, 3), 1e307))


def test_blocks_are_of_three_seconds_of_the_reference_ship_for_samples_and_roughness():
    r = regression()
    block = r.block
    rows = N + r.problem.spline.grid.rank
    assert block.size == rows
    assert block[:N].tolist() == [int(t // 3.0) for t in (TIME - START)]
    middle = (np.arange(rows - N) + 0.5) * 0.5
    assert block[N:].tolist() == [min(int(t // 3.0), block.max()) for t in middle]


def fake(late, gain=10.0, seed=0, n=600, hold=20):
    """A regression of two signals, gains times the command that acted so long before, and noise of size one."""
    time = START + H * np.arange(n)
    c = commands(jumping(seed, hold, n), ends=((0.0, H * (n - 1)),), time=time)
    rng = np.random.default_rng(seed + 1)
    acted = c.delayed(late)
    n = len(acted)
    z = [gain * acted[:, [k]] + rng.standard_normal((n, 1)) for k in (0, 2)]
    return SimpleNamespace(
        commands=c,
        time_scale=1.0,
        block=np.arange(n) // 30,
        pose=z,
        motions=lambda tau: (tau[:, :2], tau[:, 2:]),
    )


@pytest.mark.parametrize("late", [0.0, 0.1, 0.4, 0.7, 1.0])
def test_the_likeliest_delay_is_that_of_the_commands(late):
    """One that is shorter than is noticed is never sure."""
    found, sure = likeliest_delay(fake(late))
    assert found == pytest.approx(late)
    assert sure == (late >= BRIEF)


def test_a_delay_that_chance_finds_is_none():
    """Of signals that are noise, and of commands that never change."""
    found = [likeliest_delay(fake(0.4, 0.0, seed)) for seed in range(20)]
    assert sum(delay > 0.0 for delay, _ in found) <= 2
    assert not any(sure for _, sure in found)
    assert likeliest_delay(fake(0.4, hold=600)) == (0.0, False)


def test_a_delay_that_one_block_alone_shows_is_not_sure():
    r, late = fake(0.0, 0.0), fake(0.4)
    for z, other in zip(r.pose, late.pose, strict=True):
        z[300:330] = 3.0 * other[300:330]
    found, sure = likeliest_delay(r)
    assert found == pytest.approx(0.4)
    assert not sure


@settings(max_examples=20)
@given(st.integers(0, 10), st.floats(0.0, 100.0), st.sampled_from([1.0, 2.5]))
def test_a_search_ends_where_least_is_left_unless_chance_gives_as_much(best, height, size):
    """Of a valley: its lowest place, or 0 where that is hardly lower than no delay."""
    c = commands(jumping(), scale=Scale(size * REFERENCE.length))
    asked = []

    def left(k):
        asked.append(k)
        return height * abs(k - best) / max(best, 1)

    found = searched(left, c)
    assert found.tried == set(asked)
    enough = 2.0 + 2.0 * np.log(len(found.tried))
    assert found.best == (best if best and height >= enough else 0)


@pytest.mark.parametrize("way", Lateness._fields)
@pytest.mark.parametrize("time", [0.0, 0.1, 0.3, 0.6])
@pytest.mark.parametrize("size", [0.8, 1.0])
def test_a_delay_and_a_lag_are_found_beside_described_gains_of_any_size(way, time, size):
    """Each by its own way; fitted is how late, and gains too large as a whole do not hide it."""
    G = np.array([[1.0, 0.2, -0.5], [0.1, 2.0, -0.3], [0.4, -0.7, 3.0]])
    r = regression(jumping(hold=20, seed=4), psi=0.1 * TIME)
    p = r.problem._replace(z=r.commands.response(Gains(size * G, 0.0), Lateness(**{way: time})).eta)
    p = p._replace(sigma=np.full(3, 1e-3))
    again = Regression(p, solve(p, np.full(3, 10.0), np.ones((N, 3))), r.commands, r.time)
    assert likeliest_late(again, way, G) == pytest.approx(Lateness(**{way: time}))


@pytest.mark.parametrize(
    ("before", "with_delay", "with_lag", "late"),
    [
        (0.0, 49.0, 48.0, Lateness()),  # less than a twentieth of what the commands explain
        (0.0, 51.0, 52.0, Lateness(lag=0.4)),
        (0.0, 53.0, 52.0, Lateness(0.4)),
        (0.2, 1.0, 0.5, Lateness(0.4)),  # late in any case
        (0.2, -1.0, -0.5, Lateness(0.2)),
        (0.4, 9.0, -0.5, Lateness(0.4)),  # the delay that it has: nothing to compare
    ],
)
def test_commands_act_later_if_that_explains_a_share_of_what_they_do(
    before, with_delay, with_lag, late, monkeypatch
):
    def one(cost, late):
        return SimpleNamespace(
            cost=cost, again=None, smoothness=None, response=SimpleNamespace(late=late)
        )

    def explained(by, smoothness, weights, late, described, way):
        return one(-1000.0 - (with_delay if way == "delay" else with_lag), late)

    monkeypatch.setattr(
        command_response, "likeliest_late", lambda by, way, described: Lateness(**{way: 0.4})
    )
    monkeypatch.setattr(command_response, "explained", explained)
    found = command_response.explained_late(one(-1000.0, Lateness(before)), None, None, 0.0)
    assert found.response.late == late


def test_lateness_that_makes_no_difference_to_a_motion_is_none(monkeypatch):
    r = regression(jumping(hold=20, seed=4))
    noticed = round(BRIEF / H)
    for best, late in ((0, 0.0), (noticed, BRIEF), (noticed + 2, BRIEF + 2 * H)):
        monkeypatch.setattr(lateness, "searched", lambda left, c, best=best: Searched(best, {0, best}))
        assert likeliest_late(r, "delay", np.eye(3)) == pytest.approx(Lateness(late))
    monkeypatch.setattr(lateness, "BRIEF", 2.0 * BRIEF)
    monkeypatch.setattr(lateness, "searched", lambda left, c: Searched(noticed, {0, noticed}))
    assert likeliest_late(r, "delay", np.eye(3)) == Lateness()
