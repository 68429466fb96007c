"""What is said of each channel (diagnosis/runs/measured_channels.py): its rate, noise, spikes and use."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from diagnosis import Run
from diagnosis.execution.short_text import SHOWN
from diagnosis.runs.cleaning import Z95, noise
from diagnosis.runs.measured_channels import (
    ESTIMATED,
    GIVEN,
    UNUSED,
    MeasuredChannel,
    _correlation,
    _of_differences,
    _of_rounding,
    by_name,
    channels_of,
)
from diagnosis.runs.sensors.sensor_finding import Examined, SensorFinding

H, N = 0.25, 2000
TIME = 5.0 + H * np.arange(N)
SIGMA = np.array([0.1, 0.2, 0.05])


def channel(**changes):
    values = {
        "name": "x",
        "rate": 4.0,
        "held": 0.0,
        "noise": 0.1,
        "noise_rel_std": 0.0,
        "unit": "m",
        "noise_from": GIVEN,
        "correlation": 0.0,
        "latency": 0.0,
        "outliers": 0,
    }
    return MeasuredChannel(**values | changes)


def smoothed(measured=None, noise=None, findings=(), agreeing=None, aside=None, every=(1, 1, 1)):
    """A run about a motion that is known, of which each channel is updated every so many rows."""
    rng = np.random.default_rng(1)
    eta = np.column_stack([TIME, 2.0 * TIME, 3.0 + 0.02 * TIME])
    pose = eta + SIGMA * rng.standard_normal((N, 3))
    pose[:, 2] = np.angle(np.exp(1j * pose[:, 2]))
    fresh = np.column_stack([np.arange(N) % k == 0 for k in every])
    run = Run("made", TIME, pose, np.zeros((N, 3)), measured=measured or {}, noise=noise or {})
    known = None
    if measured is not None:
        known = Examined(run, tuple(findings), agreeing=agreeing or {}, aside=aside or {})
    return SimpleNamespace(
        track=SimpleNamespace(run=run, fresh=fresh, dropped=np.zeros(N, bool)),
        eta=eta,
        time=TIME,
        agrees=np.ones((N, 3), bool),
        noise=SIGMA,
        noise_rel_std=np.array([0.01, 0.02, 0.03]),
        noise_at_most=np.array([False, True, False]),
        sensors=known,
    )


def test_a_pose_has_its_rates_and_noise_and_no_latency():
    s = smoothed(noise={"y": 0.2}, every=(1, 2, 4))
    x, y, psi = channels_of(s)
    assert [c.name for c in (x, y, psi)] == ["x", "y", "psi"]
    assert [c.rate for c in (x, y, psi)] == pytest.approx([4.0, 2.0, 1.0])
    assert [c.held for c in (x, y, psi)] == pytest.approx([0.0, 0.5, 0.75])
    assert [c.noise for c in (x, y, psi)] == SIGMA.tolist()
    assert [c.noise_rel_std for c in (x, y, psi)] == [0.01, 0.02, 0.03]
    assert [c.unit for c in (x, y, psi)] == ["m", "m", "rad"]
    assert [c.noise_from for c in (x, y, psi)] == [ESTIMATED, GIVEN, ESTIMATED]
    assert [c.noise_at_most for c in (x, y, psi)] == [False, True, False]
    assert [(c.latency, c.correlation, c.outliers, c.used) for c in (x, y, psi)] == [
        (0.0, 0.0, 0, True)
    ] * 3


def test_rows_without_a_pose_are_not_held():
    s = smoothed(every=(2, 1, 1))
    s.track.dropped[1::2] = True
    assert next(iter(channels_of(s))).held == 0.0
    s.track.run.pose[1::4, 1] = np.nan
    s.track.fresh[1::4, 1] = False
    assert [c.held for c in channels_of(s)][1] == 0.0


def test_outliers_are_samples_that_disagree_with_the_times_of_the_first():
    s = smoothed(every=(1, 1, 2))
    wrong = np.arange(10, 10 + 4 * (SHOWN + 3), 4)
    s.agrees[wrong, 2] = False
    s.agrees[11, 2] = False  # no sample of the heading
    s.eta[wrong[:1]] = np.nan
    *_, psi = channels_of(s)
    assert psi.outliers == SHOWN + 2
    assert psi.outlier_times == tuple(TIME[wrong[1 : SHOWN + 1]])


@given(st.integers(0, 30), st.floats(0.3, 0.95), st.sampled_from([0.1, 2.0]))
def test_a_correlation_has_the_time_constant_of_its_process(seed, rho, h):
    """Residuals of a first order: -h / log(rho)."""
    n = 4000
    x = lfilter([1.0], [1.0, -rho], np.random.default_rng(seed).standard_normal(n))
    found = _correlation(h * np.arange(n), x)
    assert np.exp(-h / found) == pytest.approx(rho, abs=0.07)


def test_white_alternating_and_few_residuals_have_no_correlation():
    time, white = np.arange(400.0), np.random.default_rng(0).standard_normal(400)
    assert _correlation(time, white) == 0.0
    assert _correlation(time, (-1.0) ** time) == 0.0
    assert _correlation(time, 0.0 * time) == 0.0
    assert _correlation(time[:3], np.ones(3)) == 0.0
    assert _correlation(time, np.ones(400)) == pytest.approx(-1.0 / np.log(0.999)), "at the most"


def test_samples_on_both_sides_of_a_gap_are_no_neighbours():
    """Pairs a second apart are the same; from pair to pair it is three, and they have nothing in common."""
    pairs = np.repeat(np.random.default_rng(0).standard_normal(400), 2)
    time = np.repeat(4.0 * np.arange(400), 2) + np.tile([0.0, 1.0], 400)
    steps = np.diff(time)
    assert np.median(steps) == 1.0
    assert _correlation(time, pairs) > 10.0


@given(st.floats(1e-3, 10.0), st.integers(1, 5))
def test_rounding_has_the_deviation_of_an_even_distribution(step, least):
    values = step * np.array([7.0, 0.0, 7.0 + least, 20.0, 40.0])
    assert _of_rounding(values) == pytest.approx(step * least / np.sqrt(12.0))
    assert _of_rounding(np.full(5, step)) == 0.0
    assert _of_rounding(values * (1.0 + 1e-12) ** np.arange(5)) == pytest.approx(
        step * least / np.sqrt(12.0), rel=1e-6
    )


@pytest.mark.parametrize("samples", [50, 400])
def test_the_deviation_of_a_noise_is_that_of_many_estimates_of_it(samples):
    rng = np.random.default_rng(0)
    found = noise(rng.standard_normal((samples, 2000)))
    assert _of_differences(samples) == pytest.approx(np.std(found) / np.mean(found), rel=0.07)


def channels(**options):
    return {c.name: c for c in channels_of(smoothed(**options)) if c.name not in ("x", "y", "psi")}


def test_a_channel_beside_the_pose_has_its_own_samples_noise_and_rate():
    rng = np.random.default_rng(2)
    u = np.repeat(0.5 + 0.03 * rng.standard_normal(N // 4), 4)
    found = channels(measured={"u": u, "r": 0.01 * rng.standard_normal(N)}, agreeing={"u": 0.1})
    assert found["u"].rate == pytest.approx(1.0)
    assert found["u"].held == pytest.approx(0.75)
    assert found["u"].noise == pytest.approx(0.03, rel=0.15)
    assert (found["u"].unit, found["r"].unit) == ("m/s", "rad/s")
    assert found["u"].noise_from == ESTIMATED
    assert found["u"].noise_rel_std == _of_differences(N // 4)
    assert (found["u"].outliers, found["u"].correlation) == (0, 0.0)
    assert found["u"].used
    assert found["r"].why == UNUSED


def test_a_noise_that_is_given_stays_and_rounding_is_the_least():
    rng = np.random.default_rng(2)
    u = 0.5 + 0.03 * rng.standard_normal(N)
    found = channels(measured={"u": u}, noise={"u": 0.7})["u"]
    assert (found.noise, found.noise_rel_std, found.noise_from) == (0.7, 0.0, GIVEN)
    line = np.round(np.linspace(0.0, 400.0, N))
    assert channels(measured={"u": line})["u"].noise == pytest.approx(1.0 / np.sqrt(12.0))


def test_a_channel_that_is_set_aside_has_its_reason_and_one_that_is_late_its_delay():
    rng = np.random.default_rng(3)
    white = {n: rng.standard_normal(N) for n in ("speed", "course", "r")}
    fault = SensorFinding("r", "delay", 0.4, "s", (0.3, 0.5), 0.0, 1.0, "r is late", aside=("r",))
    found = channels(measured=white, findings=[fault], agreeing={"speed": 0.1})
    assert found["speed"].used
    assert found["course"].used, "by its speed"
    assert (found["r"].why, found["r"].latency) == ("r is late", 0.4)
    assert found["speed"].latency == 0.0
    aside = channels(measured={}, aside={"r": white["r"]})
    assert aside["r"].why == UNUSED


@pytest.mark.parametrize(("samples", "stated"), [(3, False), (4, True)])
def test_a_channel_with_fewer_samples_than_its_differences_need_is_left_out(samples, stated):
    u = np.full(N, np.nan)
    u[10 : 10 + 7 * samples : 7] = np.random.default_rng(0).standard_normal(samples)
    found = channels(measured={"u": u})
    assert ("u" in found) == stated
    if stated:
        assert found["u"].rate == pytest.approx(1.0 / (7.0 * H))


def test_channels_of_several_runs_are_medians_sums_and_the_first_reason():
    first = channel(rate=1.0, noise=5.0, noise_at_most=True)
    second = channel(rate=9.0, noise=1.0, outliers=2, outlier_times=(3.0,), why="late")
    third = channel(rate=4.0, noise=2.0, outliers=5, outlier_times=(7.0,), why="other")
    other = channel(name="y")
    one, two = by_name([first, other, second, third])
    assert one == replace(
        first, rate=4.0, noise=2.0, outliers=7, outlier_times=(3.0,), why="late", noise_at_most=True
    )
    assert two == other
    assert not one.used


@pytest.mark.parametrize(
    ("rel_std", "known"), [(0.499 / Z95, True), (0.501 / Z95, False), (np.inf, False)]
)
def test_a_noise_is_known_if_its_interval_begins_above_half_of_it(rel_std, known):
    assert channel(noise_rel_std=rel_std).known == known


def test_a_file_has_all_but_the_name():
    content = channel(why="late").content()
    assert content["used"] is False
    assert content["why"] == "late"
    assert "name" not in content
    assert {*content} == {*vars(channel())} - {"name"} | {"used"}
