"""Channels that are measured behind a filter: predicted as filtered, undone, and found."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.signal import lfilter, lsim
from support.measured import sail, smoothed

from diagnosis import Model, Windows, diagnose
from diagnosis.predictors.filters import FilterStart
from diagnosis.predictors.prediction import before_filters, filtered, true_motion
from diagnosis.predictors.shooting import Shooting
from diagnosis.predictors.uncertainty import NOISE_TOLERANCE, omega_std
from diagnosis.predictors.weak_form import HORIZON, omega, weak_windows
from diagnosis.search.candidates import removed_noise

LAGS = {"position_lag": 0.7, "heading_lag": 0.4}
BEHIND = Model(measurement=LAGS)
TRACKERS = {"position_tracker": 0.6, "heading_tracker": 0.9}
TRACKED = Model(measurement=TRACKERS)
BOTH = Model(measurement=LAGS | TRACKERS)
LATE = {"position_latency": 0.43, "heading_latency": 0.27}
ALL = Model(measurement=LAGS | TRACKERS | LATE)


def behind_filters(run, position_lag=0.0, heading_lag=0.0):
    """A run with channels behind filters of first order, sample by sample, as an instrument has them."""
    pose, h = np.array(run.pose), float(np.median(np.diff(run.time)))
    pose[:, 2] = np.unwrap(pose[:, 2])
    for k, lag in enumerate((position_lag, position_lag, heading_lag)):
        if lag:
            kept = np.exp(-h / lag)
            pose[:, k] = pose[0, k] + lfilter([1.0 - kept], [1.0, -kept], pose[:, k] - pose[0, k])
    return replace(run, pose=pose)


def test_a_filter_gives_the_response_to_a_ramp_and_comes_to_its_lag():
    """y = s (t - T (1 - exp(-t/T))) for y' = (s t - y)/T, y(0) = 0."""
    shooting = Shooting([smoothed(sail(40.0)[0])], HORIZON)
    first, h = shooting.starts.first(lambda s: s.eta), 0.3
    t = h * np.arange(40.0)
    poses = first[None, :, None] + 0.2 * t[:, None, None, None]
    found = filtered(poses, BEHIND, shooting.starts, h) - first[None, :, None]
    for k, lag in enumerate(BEHIND.filters.lag):
        expected = 0.2 * (t - lag * (1.0 - np.exp(-t / lag)))
        np.testing.assert_allclose(found[:, k, 0, 0], expected, atol=1e-12)
        assert found[-1, k, 0, 0] == pytest.approx(0.2 * (t[-1] - lag), rel=1e-6)


def test_a_tracker_is_the_integral_of_its_differential_equations():
    """Of a ramp it has no error in the end, and of a parabola T^2 times the acceleration."""
    shooting = Shooting([smoothed(sail(40.0)[0])], HORIZON)
    first, h = shooting.starts.first(lambda s: s.eta), 0.05
    rate = shooting.starts.first(lambda s: s.eta_dot)
    t = h * np.arange(400.0)
    T = TRACKED.filters.tracker[0]
    poses = first[None, :, None] + (0.1 * t + 0.02 * t**2)[:, None, None, None]
    found = filtered(poses, TRACKED, shooting.starts, h)
    off = poses - found
    np.testing.assert_allclose(off[-1, :2], T**2 * 0.04, rtol=1e-3)
    x, start = poses[:, 0, 0, 0], found[0, 0, 0, 0]
    v = rate[0, 0] - np.sqrt(2.0) / T * (x[0] - start)
    # dy/dt = v + sqrt(2)/T (x - y), dv/dt = (x - y) / T^2; exact for straight lines between samples
    gains = np.array([np.sqrt(2.0) / T, 1.0 / T**2])
    system = np.column_stack([-gains, [1.0, 0.0]]), gains[:, None], [[1.0, 0.0]], [[0.0]]
    _, exact, _ = lsim(system, x, t, (start, v))
    np.testing.assert_allclose(found[:, 0, 0, 0], exact, atol=1e-8)


@dataclass(eq=False)
class Sine:
    """A smoothed motion that is a sine with its derivatives, in all three coordinates."""

    time: np.ndarray
    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray

    @classmethod
    def behind(cls, model, t, w):
        """sin(w t) behind filters with the frequency response H(i w), in steady state."""
        s = 1j * w
        low = 1.0 / (1.0 + s * np.array(model.filters.lag))
        T = np.array(model.filters.tracker)
        tracking = (np.sqrt(2.0) * s * T + 1.0) / (s**2 * T**2 + np.sqrt(2.0) * s * T + 1.0)
        z = low * tracking * np.exp(s * (t[:, None] - np.array(model.filters.latency)))
        return cls(t, z.imag, (s * z).imag, (s**2 * z).imag)


@pytest.mark.parametrize("model", [Model(measurement=LAGS), TRACKED, BOTH, Model(measurement=LATE), ALL])
def test_the_motion_behind_filters_is_that_before_them(model):
    """Whatever the filters do to a sine is undone, once a tracker's unknown start is forgotten."""
    t, w = np.linspace(0.0, 60.0, 6001), 0.5
    pose, rate = before_filters(Sine.behind(model, t, w), model)
    later = (t > 20.0) & (t < 59.4)  # at the end nothing is known of later rows
    np.testing.assert_allclose(pose[later], np.sin(w * t)[later, None] * np.ones(3), atol=2e-5)
    np.testing.assert_allclose(rate[later], w * np.cos(w * t)[later, None] * np.ones(3), atol=2e-5)


@pytest.mark.parametrize("model", [BOTH, Model(measurement=LATE), ALL])
def test_forward_and_back_are_inverse(model):
    """A motion behind the filters, sample by sample, is undone to the motion."""
    t, w = np.linspace(0.0, 60.0, 6001), 0.5
    sine = Sine.behind(model, t, w)
    before = model.filters.undone(sine)
    at = 3000
    poses = np.repeat(np.sin(w * t[at:])[:, None, None, None], 3, axis=1)
    motions = (before.between, before.timely, before.timely_rate, sine.eta)
    found = model.filters.behind(poses, FilterStart(*(x[at][:, None] for x in motions)), t[1])
    later = np.full(3, 0 if model is BOTH else 50)  # before, a latency has a line for the motion
    for k, first in enumerate(later):
        np.testing.assert_allclose(found[first:, k, 0, 0], sine.eta[at + first :, k], atol=1e-4)
        np.testing.assert_allclose(found[:first, k, 0, 0], sine.eta[at : at + first, k], atol=8e-3)


def test_a_motion_that_is_late_is_undone_up_to_a_gap():
    """Where the later motion is not known, the acceleration stays as it is."""
    t, w = np.linspace(0.0, 20.0, 201), 0.5
    sine = Sine.behind(Model(measurement=LATE), t, w)
    gap = slice(100, 130)
    for x in (sine.eta, sine.eta_dot, sine.eta_ddot):
        x[gap] = np.nan
    before = Model(measurement=LATE).filters.undone(sine)
    known = np.isfinite(sine.eta[:, 0])
    off = np.abs(before.pose - np.sin(w * t)[:, None])
    assert np.isfinite(off[known]).all()
    assert off[known].max() < 0.43**3 / 6.0 * w**3 * 1.05
    assert off[:90].max() < 1e-5


@pytest.mark.parametrize("gain", [0.02, 0.05, 0.1])
def test_the_first_response_of_a_tracker_is_the_gain_of_an_alpha_beta_filter(gain):
    """Kalata's relation gives the speed gain of a steady filter, and T = h / sqrt(beta)."""
    h, beta = 0.1, 2.0 * (2.0 - gain) - 4.0 * np.sqrt(1.0 - gain)
    model = Model(measurement={"heading_tracker": h / np.sqrt(beta), "position_lag": 0.4})
    place, _, heading = model.filters.first_response(h)
    assert heading == pytest.approx(gain, rel=0.3 * gain)
    assert place == pytest.approx(1.0 - np.exp(-h / 0.4))


def test_noise_before_a_filter_counts_in_full():
    """The noise of a filtered channel is what is left of it from sample to sample."""
    (w,) = [weak_windows(smoothed(behind_filters(sail(60.0, h=0.1, noise=10.0)[0], heading_lag=0.4)))]
    h = w.smoothed.track.period
    plain, behind = (omega_std(w, m)[:, 2] for m in (Model(), Model(measurement={"heading_lag": 0.4})))
    assert np.median(behind / plain) == pytest.approx(1.0 / (1.0 - np.exp(-h / 0.4)), rel=0.3)


def test_undoing_a_filter_is_one_over_its_frequency_response():
    w = np.geomspace(0.01, 100.0, 50)
    s = 1j * w[:, None]
    T, lag = np.array(BOTH.filters.tracker), np.array(BOTH.filters.lag)
    passed = (np.sqrt(2.0) * s * T + 1.0) / (s**2 * T**2 + np.sqrt(2.0) * s * T + 1.0) / (1.0 + s * lag)
    np.testing.assert_allclose(BOTH.filters.undoing(w), 1.0 / np.abs(passed.T))


def test_the_noise_that_a_tracker_takes_away_is_known():
    """Two runs that differ in their noise alone: half the square of their difference is that of one.

    The noise is claimed with its tolerance, and so is what becomes less of it.
    """
    tracked = Model(measurement={"position_tracker": 0.5})
    made = [sail(120.0, h=0.1, noise=5.0, seed=seed)[0] for seed in range(8)]
    windows = [weak_windows(smoothed(run)) for run in made]
    charge = np.mean([removed_noise([w], Model(), tracked) for w in windows], axis=0)
    fall = np.zeros(3)
    for a, b in zip(windows[::2], windows[1::2], strict=True):
        now, undone = (omega(a, m) - omega(b, m) for m in (Model(), tracked))
        fall += np.sum(now**2 - undone**2, axis=0) / 2.0 / 4.0
    assert (fall[:2] > 0.0).all()
    assert (charge[:2] > 0.7 * fall[:2]).all()
    assert (charge[:2] < NOISE_TOLERANCE**2 * 1.5 * fall[:2]).all()
    assert removed_noise(windows, Model(), Model({"delta_X_u": -1.0, "heading_offset": 0.1})) is None


def test_poses_and_rates_become_body_fixed_speeds():
    (x, y, psi), (u, v, r) = true_motion(
        np.array([[1.0], [2.0], [np.pi / 2]]), np.array([[0.3], [0.4], [0.1]]), Model()
    )
    assert (x.item(), y.item(), psi.item()) == (1.0, 2.0, np.pi / 2)
    np.testing.assert_allclose([u.item(), v.item(), r.item()], [0.4, -0.3, 0.1], atol=1e-9)


def test_a_model_with_the_filters_predicts_what_they_give():
    run = behind_filters(sail(noise=0.0)[0], **LAGS)
    windows = Windows([smoothed(run)])
    without, within = (windows.errors(m).over_all() for m in (Model(), BEHIND))
    assert without[0] > 0.02
    assert within[0] < 0.1 * without[0]
    assert within[1] < 0.1 * without[1]


def test_models_that_differ_in_their_filters_are_predicted_each_by_its_own():
    windows = Windows([smoothed(sail(40.0)[0])])
    models = [Model(), BEHIND, Model({"delta_X_u": -1.0}, measurement=LAGS)]
    for found, model in zip(windows.residuals_of_each(models), models, strict=True):
        np.testing.assert_allclose(found, windows.residuals(model), atol=1e-12)


@pytest.mark.slow
def test_a_tracker_is_found_in_addition_to_the_hidden_effect():
    """The heading of an alpha-beta filter at 10 Hz, whose continuous time constant is h / sqrt(beta)."""
    h, gain = 0.1, 0.2
    beta = 2.0 * (2.0 - gain) - 4.0 * np.sqrt(1.0 - gain)  # Kalata 1984
    run = sail(120.0, h=h, ship={"delta_X_u": -2.0})[0]
    pose, at, speed = np.array(run.pose), float(run.pose[0, 2]), 0.0
    for n, value in enumerate(np.unwrap(run.pose[:, 2]).tolist()):
        expected = at + h * speed
        at, speed = expected + gain * (value - expected), speed + beta / h * (value - expected)
        pose[n, 2] = at
    w = weak_windows(smoothed(replace(run, pose=pose)))
    found = {e.id: e for e in diagnose([w]).content.effects}
    assert {*found} == {"heading_tracker", "X_u"}
    assert found["X_u"].confidence > 0.9
    assert found["heading_tracker"].coefficients["heading_tracker"].value == pytest.approx(
        h / np.sqrt(beta), rel=0.15
    )


@pytest.mark.slow
def test_no_filter_is_found_where_none_is():
    """Thrusters that lag are its opposite: the force is late, and not the measurement."""
    w = weak_windows(smoothed(sail(90.0, h=0.1, thrusters={"lag": 0.5})[0]))
    assert {e.id for e in diagnose([w]).content.effects} == {"lag"}


@pytest.mark.slow
def test_a_position_that_is_late_is_no_low_pass():
    """Positions of a receiver that are older than their stamps, as by a slow link; the heading is not."""
    run = sail(180.0, h=0.1, noise=0.2)[0]
    late, rows = 0.6, 6  # s; more is easier
    pose = np.array(run.pose)
    pose[rows:, :2] = run.pose[:-rows, :2]
    w = weak_windows(smoothed(replace(run.rows(np.arange(rows, run.time.size)), pose=pose[rows:])))
    found = {e.id: e for e in diagnose([w]).content.effects}
    assert {*found} == {"position_latency"}
    assert found["position_latency"].coefficients["position_latency"].value == pytest.approx(
        late, rel=0.05
    )


@pytest.mark.parametrize("name", ["position_tracker", "heading_latency", "position_lag"])
def test_what_a_filter_hides_is_known_up_to_the_ends_of_each_stretch(name):
    """A rate that is unknown in the last row of a stretch would make a whole window unknown."""
    s = smoothed(sail(40.0)[0])
    lost = np.zeros(s.time.size, bool)
    lost[150:190] = lost[-6:] = True
    parts = {
        n: np.where(lost[:, None], np.nan, getattr(s, n)) for n in ("eta", "eta_dot", "eta_ddot", "nu")
    }
    found = before_filters(replace(s, **parts), Model(measurement={name: 0.5}))
    for part in found:
        assert np.isfinite(part[~lost]).all()
