"""Thinning of long runs: what it keeps, what it says, and when it leaves a run alone."""

import numpy as np
import pytest

from diagnosis.runs import Run, clean, thinned, thinning


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
