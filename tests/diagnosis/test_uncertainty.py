"""The parts of the uncertainty of a model error (diagnosis/predictors/uncertainty.py)."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.sparse import csr_array

from diagnosis.predictors import uncertainty
from diagnosis.predictors.uncertainty import (
    FREQUENCIES,
    _corner_by_jerk,
    _force_variance,
    _gain,
    _sampled,
    autocovariance,
    bridged,
    command_variance,
    corner_frequency,
    correlated_windows,
    independent,
    measurement_std,
    omega_std,
)
from diagnosis.predictors.weak_form import EVERY, OVERLAP

H, N = 0.1, 600
TIME = H * np.arange(N)


def series(*counts, every=EVERY, first=0.0, gap=()):
    """Windows of runs, evenly spaced but for a gap after some."""
    found = []
    for n in counts:
        middle = first + every * np.arange(float(n))
        for at, by in gap:
            middle[at:] += by
        found.append(SimpleNamespace(middle=middle, every=every))
    return found


@settings(max_examples=20)
@given(st.integers(0, 1000), st.lists(st.integers(1, 15), min_size=1, max_size=3), st.integers(0, 6))
def test_a_covariance_is_the_mean_product_of_windows_of_one_run_so_far_apart(seed, counts, lag):
    error = np.random.default_rng(seed).standard_normal((sum(counts), 3))
    found = autocovariance(series(*counts), error, 6)
    assert found.shape == (7, 3)
    first, products = 0, []
    for n in counts:
        part = error[first : first + n]
        products += [part[k] * part[k + lag] for k in range(n - lag)]
        first += n
    expected = np.mean(products, axis=0) if products else np.zeros(3)
    assert found[lag] == pytest.approx(expected)


def test_windows_on_both_sides_of_a_gap_are_as_far_apart_as_their_times():
    error = np.random.default_rng(0).standard_normal((10, 3))
    found = autocovariance(series(10, gap=[(5, 2.0 * EVERY)]), error, 4)
    pairs = [(k, k + 3) for k in (0, 1, 5, 6)] + [(4, 5)]
    assert found[3] == pytest.approx(np.mean([error[a] * error[b] for a, b in pairs], axis=0))
    years = autocovariance(series(10, gap=[(5, 1e9)]), error, 4)
    for lag in (1, 3, 4):
        inside = [(k, k + lag) for k in range(10 - lag) if k // 5 == (k + lag) // 5]
        assert years[lag] == pytest.approx(np.mean([error[a] * error[b] for a, b in inside], axis=0))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_windows_of_a_first_order_process_count_by_its_correlation(rho):
    """1 + 2 sum rho^l = (1 + rho) / (1 - rho); what overlaps counts as one anyway."""
    n = 8000
    x = lfilter([1.0], [1.0, -rho], np.random.default_rng(1).standard_normal((n, 3)), axis=0)
    found = correlated_windows(series(n), x)
    exact = (1.0 + rho) / (1.0 - rho)
    assert found.mean() == pytest.approx(exact, rel=0.25, abs=0.1)
    assert independent(series(n), x) == pytest.approx(np.maximum(1.0, found / OVERLAP))


def test_correlations_end_before_the_first_that_is_not_positive():
    x = np.tile([[1.0], [-1.0], [-1.0], [1.0]], (50, 3))  # correlations 0, -1, 0, 1 ...
    assert correlated_windows(series(200), x) == pytest.approx([1.0] * 3, abs=0.02)
    assert correlated_windows(series(200), 0.0 * x).tolist() == [1.0] * 3


# Samples in windows


def windows(agrees=None, jerk=1.0, noise=0.1, width=3.0, time=TIME):
    """Windows over a run, each a mean of the rows within it."""
    middle = np.arange(time[0] + 0.5 * width, time[-1] - 0.5 * width, 1.0)
    inside = np.abs(time - middle[:, None]) <= 0.5 * width
    agrees = np.ones((time.size, 3), bool) if agrees is None else agrees
    periods = np.array([np.median(np.diff(time[there])) for there in agrees.T])
    s = SimpleNamespace(
        agrees=agrees,
        time=time,
        track=SimpleNamespace(periods=periods),
        jerk=np.full(3, jerk),
        noise=np.full(3, noise),
    )
    smooth = inside / inside.sum(axis=1, keepdims=True)
    return SimpleNamespace(middle=middle, width=width, smooth=smooth, smoothed=s)


def test_a_channel_has_its_own_time_for_each_sample():
    agrees = np.column_stack([np.arange(N) % k == 0 for k in (1, 2, 5)])
    found = _sampled(windows(agrees))
    assert np.median(found, axis=0) == pytest.approx([H, 2.0 * H, 5.0 * H], rel=0.05)


def test_where_few_samples_are_there_each_has_a_longer_time_up_to_the_window():
    agrees = np.ones((N, 3), bool)
    agrees[100:300, 0] = False
    agrees[100:300, 1] = np.arange(200) % 4 == 0
    w = windows(agrees)
    within = (w.middle > 12.0) & (w.middle < 28.0)
    found = _sampled(w)[within]
    assert found[:, 0] == pytest.approx(w.width)
    assert found[:, 1] == pytest.approx(4.0 * H, rel=0.1)
    assert found[:, 2] == pytest.approx(H)


@given(st.floats(0.1, 100.0), st.floats(0.01, 1.0))
def test_the_corner_by_the_jerk_is_that_of_a_smoothing_spline(jerk, noise):
    """w0^6 = q / (sigma^2 h)."""
    s = windows(jerk=jerk, noise=noise).smoothed
    assert _corner_by_jerk(s) ** 6 == pytest.approx([jerk / (noise**2 * H)] * 3)


def test_a_window_is_bridged_if_samples_of_a_channel_are_missing_for_half_a_period():
    """Of the corner; wherever the window and the gap have a time in common."""
    jerk = 0.1**2 * H * 4.0**6  # a corner of 4 rad/s, half a period of 0.785 s
    agrees = np.ones((N, 3), bool)
    agrees[201:211, 1] = False  # from 20 s to 21.1 s
    agrees[401:405, 2] = False  # shorter: 0.5 s
    w = windows(agrees, jerk)
    found = bridged(w)
    assert not found[:, [0, 2]].any()
    low, high = w.middle - 1.5, w.middle + 1.5
    assert found[:, 1].tolist() == ((low < 21.1) & (high > 20.0)).tolist()
    assert bridged(windows(agrees, 64.0 * jerk))[:, 2].any(), "a quicker motion is not known there"
    slow = np.column_stack([np.arange(N) % 20 == 0] * 3)
    assert not bridged(windows(slow, jerk)).any(), "they are as rare as that everywhere"


def test_gains_are_on_lines_between_those_of_the_grid_in_logarithms():
    gains = [FREQUENCIES[None] ** 2.0, np.stack([FREQUENCIES, FREQUENCIES**2, FREQUENCIES**3])]
    rng = np.random.default_rng(0)
    corner = np.exp(rng.uniform(np.log(FREQUENCIES[0]), np.log(FREQUENCIES[-1]), (7, 3)))
    assert _gain(gains, corner, 0) == pytest.approx(corner**2)
    assert _gain(gains, corner, 1) == pytest.approx(corner ** np.array([1.0, 2.0, 3.0]))


@pytest.mark.parametrize("missing", [0, 1, 4])
def test_a_command_of_missing_rows_may_have_changed_in_any_of_them(missing):
    """The mean square, over the rows in which it may have, of how long the later one acted before its row."""
    time = np.delete(TIME[:60], range(31, 31 + missing))
    tau = np.where(time[:, None] > 3.05, [2.0, -1.0, 0.5], 0.0)
    held = csr_array(np.tile(np.linspace(0.5, 1.5, time.size), (2, 1)) * [[1.0], [2.0]])
    thrust = np.array([[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 2.0]])
    w = SimpleNamespace(run=SimpleNamespace(time=time, tau_cmd=tau), held=held)
    found = command_variance(w, SimpleNamespace(effective_thrust=thrust))
    early = np.mean([(k * H) ** 2 for k in range(missing + 1)])  # s2, each as likely as the others
    change = thrust @ [2.0, -1.0, 0.5]
    share = early * (change / ((missing + 1) * H)) ** 2
    row = int(np.flatnonzero(time < 3.05)[-1])
    weights = np.array([1.0, 2.0]) * np.linspace(0.5, 1.5, time.size)[row]
    assert found == pytest.approx(weights[:, None] ** 2 * share)


def test_the_corner_of_a_window_is_that_of_the_variance_of_its_pose(monkeypatch):
    """A low-pass of third order lets w0 / 3 of the density of white noise through."""
    w = windows()
    w.known = np.ones(N, bool)
    w.known[:200] = False
    eta_std = 0.03 * np.ones((N, 3)) * [1.0, 2.0, 0.5]
    w.smoothed.eta_std = np.where(w.known[:, None], eta_std, np.nan)
    found = corner_frequency(w)
    late = w.middle > 22.0
    assert found[late] == pytest.approx(
        np.tile(3.0 * np.array([0.03, 0.06, 0.015]) ** 2 / (H * 0.1**2), (late.sum(), 1))
    )
    monkeypatch.setattr(uncertainty, "bridged", lambda w: np.ones((w.middle.size, 3), bool))
    assert corner_frequency(w) == pytest.approx(np.tile(_corner_by_jerk(w.smoothed), (w.middle.size, 1)))


@pytest.mark.parametrize("psi", [0.0, 0.6, np.pi / 2.0])
@pytest.mark.parametrize("steep", [False, True])
def test_a_force_varies_by_pose_velocity_and_acceleration_in_the_axes_of_the_ship(
    monkeypatch, psi, steep
):
    """M a - F(nu), nu = R(psi)^T of the velocity over ground: a heading that is off turns that, too."""
    rng = np.random.default_rng(0)
    slope = rng.standard_normal((1, 3, 3)) if steep else np.zeros((1, 3, 3))
    mass = np.array([[20.0, 0.0, 0.0], [0.0, 30.0, 2.0], [0.0, 1.0, 5.0]])
    u, v = (0.5, -0.2) if steep else (0.0, 0.0)
    of_pose = rng.uniform(0.1, 1.0, (3, 3))  # order, channel
    monkeypatch.setattr(uncertainty, "_slope", lambda w, model: slope)
    monkeypatch.setattr(uncertainty, "_by_gaps", lambda w, order: np.array([[1.0, 1.0, 1.0 + order]]))
    monkeypatch.setattr(uncertainty, "corner_frequency", lambda w: np.full((1, 3), 2.0))
    asked = []

    def variances(order, corner):
        asked.append(float(corner[0, 0]))
        return of_pose[order][None]

    n = 7
    w = SimpleNamespace(
        smoothed=SimpleNamespace(eta=np.tile([1.0, 2.0, psi], (n, 1))),
        scale=SimpleNamespace(time=3.0),
        smooth=np.full((1, n), 1.0 / n),
        known=np.ones(n, bool),
        middle=np.zeros(1),
        motion=(None, np.tile([u, v, 0.1], (n, 1))),
    )
    found = _force_variance(w, SimpleNamespace(reference_mass=mass), variances)
    assert asked == [6.0] * 3, "in units of the size of the ship"
    c, s = np.cos(psi) ** 2, np.sin(psi) ** 2
    of_pose = of_pose * [[1.0, 1.0, 1.0], [1.0, 1.0, 2.0], [1.0, 1.0, 3.0]]
    pose, velocity, acceleration = (np.array([c * x + s * y, s * x + c * y, p]) for x, y, p in of_pose)
    turned = np.array([[0.0, 0.0, v], [0.0, 0.0, -u], [0.0, 0.0, 0.0]])
    by = slope[0] - mass @ turned, slope[0] @ turned
    expected = mass**2 @ acceleration + by[0] ** 2 @ velocity + by[1] ** 2 @ pose
    assert found[0] == pytest.approx(expected)


def test_what_the_measurement_and_missing_rows_leave_uncertain_adds_up(monkeypatch):
    monkeypatch.setattr(uncertainty, "_measurement_variance", lambda w, model: np.full((4, 3), 9.0))
    monkeypatch.setattr(uncertainty, "command_variance", lambda w, model: np.full((4, 3), 16.0))
    assert omega_std(None, "model") == pytest.approx(5.0)
    assert measurement_std(None, "model") == pytest.approx(3.0)


def measured(time=1.0, rounding=0.0, response=1.0, late=0.0, noise=0.1):
    """Windows of a ship of a size, and a model with filters, or without."""
    w = windows(time=time * TIME, noise=noise, width=3.0 * time)
    w.scale = SimpleNamespace(time=time, forces=np.array([1.0, 1.0, 1.0]))
    w.smoothed.track.usual_rounding = np.full(3, rounding)

    class Filters:
        squared_time = np.full(3, late)

        def first_response(self, period):
            assert period == pytest.approx(w.smoothed.track.periods)
            return np.full(3, response)

        def __bool__(self):
            return response < 1.0

    return w, SimpleNamespace(filters=Filters())


def of_orders(monkeypatch, *args, corner=4.0, **kwargs):
    """Variances of the pose and its derivatives in a window, as forces would take them."""
    w, model = measured(*args, **kwargs)
    found = []

    def force(w, model, variances):
        found.extend(float(variances(k, np.full((1, 3), corner))[0, 0]) for k in range(3))
        return np.zeros((1, 3))

    monkeypatch.setattr(uncertainty, "_force_variance", force)
    monkeypatch.setattr(uncertainty, "_sampled", lambda w: np.full((1, 3), w.smoothed.track.periods[0]))
    variance = uncertainty._measurement_variance(w, model)
    assert (variance > 0.0).all(), "no measurement is exact"
    assert (variance < 1e-6).all()
    return np.array(found)


def test_noise_is_white_and_its_derivatives_vary_by_the_time_of_the_ship(monkeypatch):
    """Of a ship with times T-fold a derivative of order k varies by T^(-2 k), with samples T apart."""
    first = of_orders(monkeypatch)
    assert of_orders(monkeypatch, noise=0.3) == pytest.approx(9.0 * first)
    assert of_orders(monkeypatch, time=2.0) == pytest.approx(first * 2.0 ** (-2.0 * np.arange(3)))


def test_a_filter_that_is_undone_makes_noise_larger_and_rounding_by_its_lag(monkeypatch):
    """Noise entered before it, of which a new sample has a share; rounding came behind."""
    first = of_orders(monkeypatch)
    assert of_orders(monkeypatch, response=0.2) == pytest.approx(25.0 * first)
    rounded = of_orders(monkeypatch, response=0.2, rounding=0.1, late=0.0)
    assert rounded == pytest.approx(first), "all noise is rounding"
    half = of_orders(monkeypatch, response=0.2, rounding=0.06)
    assert half == pytest.approx((0.64 * 25.0 + 0.36) * first)
    late = of_orders(monkeypatch, response=0.2, rounding=0.1, late=0.5)
    assert late[:2] - first[:2] == pytest.approx(0.5 * first[1:], rel=0.02), "of the next derivative"
    assert of_orders(monkeypatch, rounding=0.5) == pytest.approx(first), (
        "rounding is a part of the noise"
    )
