"""Thinning of long runs: what it keeps, what it says, and when it leaves a run alone."""

from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from support.measured import lacking_at_all_rows, sail, smoothed

from benchmarks.ship_effects import causes
from benchmarks.ship_effects import sail as sail_of
from diagnosis import load
from diagnosis.predictors import Model, omega, ship_with, weak_form, weak_windows
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.runs import Run, clean, thinned, thinning
from diagnosis.runs.cleaning import Track


@pytest.fixture
def run():
    """A circle of 60 s at 100 Hz: noise, one spike, one gap, commands that alternate in every row."""
    rng, t = np.random.default_rng(0), np.arange(6000) * 0.01
    t = t[(t < 30.0) | (t > 34.0)]
    pose = np.column_stack([3.0 * np.sin(0.2 * t), 3.0 * np.cos(0.2 * t), 0.2 * t])
    measured = pose + rng.normal(0.0, 1e-3, pose.shape)
    measured[1234] += 1.0
    measured[2000:2003] = np.nan
    tau = np.where(np.arange(t.size) % 2, 2.0, 0.0)[:, None] * [1.0, 0.5, 0.1]
    return Run("circle", t, measured, tau), pose


def test_a_run_that_is_not_long_stays_as_it_is(run):
    track = clean(run[0])
    assert thinned(track) is track


def test_a_long_run_keeps_motion_and_impulse_and_says_so(run, monkeypatch):
    monkeypatch.setattr(thinning, "MOST_ROWS", 1200)
    found = thinned(clean(run[0]))
    time, pose = found.run.time, found.pose
    assert np.median(np.diff(time)) == pytest.approx(0.05)
    assert found.period == pytest.approx(0.05)
    assert np.diff(time).max() == pytest.approx(4.0, abs=0.1)  # the gap is none that is filled
    true = np.column_stack([3.0 * np.sin(0.2 * time), 3.0 * np.cos(0.2 * time), 0.2 * time])
    error = pose - true
    assert np.abs(error).max() < 5e-3  # the spike is gone
    assert np.std(error, axis=0) == pytest.approx(1e-3 * np.sqrt(0.5 * np.pi / 5), rel=0.15)
    assert found.valid.all()
    whole = run[0]
    given = (whole.tau_cmd[:-1] * np.diff(whole.time)[:, None]).sum(axis=0)
    kept = (found.run.tau_cmd[:-1] * np.diff(time)[:, None]).sum(axis=0)
    assert kept == pytest.approx(given, rel=0.01)
    assert found.notes[-1].startswith("5599 rows, 0.01 s apart, thinned to 1120, 0.05 s apart")


def test_no_row_is_further_from_the_next_than_the_kernel_bears(run, monkeypatch):
    monkeypatch.setattr(thinning, "MOST_ROWS", 10)
    found = thinned(clean(run[0]))
    assert np.median(np.diff(found.run.time)) == pytest.approx(thinning.BRIEF)


def test_parts_without_a_measurement_keep_what_they_were(run, monkeypatch):
    monkeypatch.setattr(thinning, "MOST_ROWS", 1200)
    whole = run[0]
    whole.pose[500:520] = whole.pose[499]
    whole.pose[1000:1020] = np.nan
    found = thinned(clean(whole))
    assert found.frozen.sum() >= 3
    assert found.dropped.sum() >= 3
    assert not (found.frozen & found.dropped).any()
    assert np.isnan(found.pose[~found.valid]).all()


@pytest.fixture(scope="module")
def w():
    """Windows of a run at 50 Hz."""
    run, _ = sail(32.0)
    return weak_windows(smoothed(run))


def test_model_errors_by_fewer_rows_are_those_by_all(w):
    model = Model({"delta_X_u": -1.0})
    fewer = w.thinned
    assert fewer.thinned is fewer
    assert fewer.run.time.size == pytest.approx(w.run.time.size / 5, abs=2)
    assert (fewer.middle == w.middle).all()
    by_all = lacking_at_all_rows(w, model)
    assert omega(w, model) == pytest.approx(by_all, abs=1e-3 * np.abs(by_all).max())
    assert np.abs(by_all).max() > omega_std(w).max()


@pytest.fixture(scope="module")
def long():
    """Windows of a run in blocks of 40 s, of which 15 s are an excerpt."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weak_form, "BLOCKS", 2)
        yield weak_windows(smoothed(sail(80.0)[0]))


def test_a_run_with_short_blocks_is_its_own_excerpt(w):
    assert w.excerpt is w


@pytest.mark.parametrize("effect", [{}, {"lag": 0.5}, {"delay": 0.5}, {"clock_offset": 0.4}], ids=str)
def test_windows_of_an_excerpt_have_the_errors_of_the_whole(long, effect):
    """Actuators follow what was commanded before each stretch as well."""
    part, model = long.excerpt, Model().plus(effect)
    assert [*np.unique(part.block)] == [0, 1]
    assert part.middle.size == pytest.approx(60, abs=1)
    assert part.run.time.size < 0.7 * long.run.time.size
    kept = np.isin(long.middle, part.middle)
    whole = omega(long, model)
    assert omega(part, model) == pytest.approx(whole[kept], abs=2e-3 * np.abs(whole).max())
    assert omega_std(part, model) == pytest.approx(omega_std(long, model)[kept], rel=0.02)


def answering_noise():
    """Commands of a tanker under control: a slow rudder, with noise that the controller answers."""
    rng = np.random.default_rng(3)
    for k in count():
        slow = 0.2 * np.sin(0.02 * k)
        yield 10.0 + rng.normal(0.0, 2.0), slow + rng.normal(0.0, 0.05)


@pytest.fixture(scope="module")
def controlled():
    """Windows of a run of that tanker, whose rows are merged by two."""
    ship = ship_with((), "kvlcc2")
    none, rng = causes(ship)["none"], np.random.default_rng(0)
    (w,) = load(
        sail_of(ship, none, rng, None, answering_noise(), 60.0, 0.04), ship="kvlcc2", anyway=True
    )
    assert w.thinned.run.time.size < 0.7 * w.run.time.size
    return w


@pytest.mark.parametrize(
    "effect",
    [{"play_rudder": 0.1}, {"rate_rudder": 0.03}, {"lag_rudder": 0.5}, {"delay": 0.7}, {"lag": 0.5}],
    ids=lambda effect: next(iter(effect)),
)
def test_an_actuator_with_a_memory_follows_the_commands_of_all_rows(controlled, effect):
    """Play and a limited rate make another angle of a mean command than of the commands."""
    start = Model(ship=ship_with((), "kvlcc2"))
    model = start.plus(effect)
    by_all = lacking_at_all_rows(controlled, model)
    changed = by_all - lacking_at_all_rows(controlled, start)
    off, size = (np.sqrt(np.mean(x**2, axis=0)) for x in (omega(controlled, model) - by_all, changed))
    assert (off[1:] < 0.06 * size[1:]).all()
    assert off[0] < 0.15 * size[0] + 0.002 * np.abs(controlled.run.tau_cmd[:, 0]).max()


def test_the_mean_of_an_angle_goes_the_short_way_round():
    craft = ship_with((), "gunnerus")
    signals = craft.layout.commands
    (k, *_) = [
        k for k, unit in enumerate(craft.form_of(np.zeros((1, len(signals)))).values()) if unit == "rad"
    ]
    time, commands = np.arange(8) * 0.1, np.zeros((8, len(signals)))
    commands[:, k] = np.where(np.arange(8) % 2, 3.1, -3.1)
    run = Run(
        "astern",
        time,
        np.zeros((8, 3)),
        np.zeros((8, 3)),
        commands,
        signals=signals,
        ship=craft.description,
    )
    mean = thinning._mean_commands(run, time[::2])["commands"][:-1, k]
    assert np.cos(mean) == pytest.approx(-1.0)
    assert (np.abs(mean + np.pi) < 0.1).all()


def test_fewer_rows_end_where_the_motion_is_unknown(w):
    nu = w.smoothed.nu.copy()
    nu[333:777] = np.nan
    fewer = thinning.thinned_motion(replace(w.smoothed, nu=nu))
    time, known = fewer.time, np.isfinite(fewer.nu[:, 0])
    ends = time[np.flatnonzero(np.diff(known))]
    assert ends == pytest.approx(w.run.time[[332, 776]])
    assert {w.run.time[0], w.run.time[-1]} <= set(time)


def test_rare_rows_are_filled_up_between_but_not_over_a_gap():
    """Rows in between have no measurement and the commands of the row before; nothing else changes."""
    rng, n = np.random.default_rng(0), 40
    time = np.cumsum(np.append(0.0, rng.uniform(0.2, 2.2, n - 1)))
    time[20:] += 30.0
    pose, tau, fresh = rng.normal(size=(n, 3)), rng.normal(size=(n, 3)), np.ones((n, 3), bool)
    frozen, dropped = rng.random((2, n)) < 0.2
    run = Run("rare", time, pose, tau, measured={"u": pose[:, 0]})
    track = Track(run, pose, fresh, frozen, dropped, ~fresh[:, 0], 1.2, 0, ())
    found = thinning.filled_up(track)
    old = np.isin(found.run.time, time)
    for name in ("pose", "fresh", "frozen", "dropped"):
        assert np.array_equal(getattr(found, name)[old], getattr(track, name))
        assert not np.nan_to_num(getattr(found, name)[~old]).any()
    assert np.array_equal(found.between, ~old)
    assert np.isnan(found.pose[~old]).all()
    assert np.array_equal(found.run.measured["u"], found.pose[:, 0], equal_nan=True)
    before = np.searchsorted(time, found.run.time, side="right") - 1
    assert np.array_equal(found.run.tau_cmd, tau[before])
    for k, step in enumerate(np.diff(time)):  # as few even parts as are at most half a second long
        parts = found.run.time[before == k] - time[k]
        many = 1 if k == 19 else int(np.ceil(step / 0.5))
        assert parts == pytest.approx(np.arange(many) * step / many)
    quick = replace(track, run=replace(run, time=0.5 * np.arange(n)))
    assert thinning.filled_up(quick) is quick


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_shaft_speed_that_changes_with_each_row_keeps_its_mean_thrust(sign):
    """A controller answers noise: the mean of n has less thrust than the mean of n |n|."""
    of, t = ship_with((), "kvlcc2"), np.arange(400) * 0.01
    n = sign * (8.0 + 3.0 * (np.arange(400) % 2))
    helm = 0.1 * np.sin(t)
    given = np.column_stack([n, helm])
    run = Run("quick", t, np.zeros((400, 3)), of.commanded_force(given), given, ship=of.description)
    edges = t[::20]
    mean = thinning._mean_commands(run, edges)
    thrust = [of.commanded_force(c)[:, 0].mean() for c in (given[:380], mean["commands"][:-1])]
    assert thrust[1] == pytest.approx(thrust[0], rel=1e-4)  # the rudder is in the race
    assert mean["tau_cmd"][:-1, 0].mean() == pytest.approx(thrust[0], rel=1e-9)
    helms = helm[:380].reshape(-1, 20).mean(axis=1)
    np.testing.assert_allclose(mean["commands"][:-1, 1], helms, rtol=1e-9, atol=1e-9)


def test_a_shaft_behind_a_lag_has_the_mean_of_its_speed():
    of, t = ship_with((), "otter"), np.arange(400) * 0.01
    n = 20.0 + 8.0 * (np.arange(400) % 2)
    given = np.column_stack([n, n])
    run = Run("quick", t, np.zeros((400, 3)), of.commanded_force(given), given, ship=of.description)
    mean = thinning._mean_commands(run, t[::20])["commands"]
    np.testing.assert_allclose(mean[:-1], 24.0, rtol=1e-9)
