"""Noise of the model error of each window, by the measurement, and how long such an error lasts.

In weak form the inertia force of a window is the integral of the pose times the second derivative of the
kernel, and that carries nearly all of the noise where a pose is measured to millimetres. The smoothing
spline passes the angular frequency w by H = 1 / (1 + (w / w0)^6); of noise with the density R it leaves
R H uncertain, including the jerk that it suppresses (N. Wiener, Extrapolation, Interpolation, and
Smoothing of Stationary Time Series, 1949). The corner frequency w0 follows from the variance of the
smoothed pose, R w0 / 3, known at every time.

Where a position is known to half a metre, the force of hull and thrusters is as uncertain as the
velocity that it goes with: a yaw moment by sway far more than the yaw acceleration. With
nu = B eta' + A eta, where B turns the axes and A has what an error of the heading does to u and v, a
mass M and the slope F of the force by nu make of an error of the pose at the frequency w
(-w^2 M B + i w (M A - F B) - F A) of it; the last term is counted as if it were independent.

A density holds where samples are even. In a window in which samples of a channel are missing for longer
than half a period of w0, they do not determine what the smoothing passes: there the variances of the
derivatives are those of the splines' covariance (:mod:`..runs.smoothing.spline`), which are
the same in windows without a gap.

Behind a filter of the measurement the noise of a pose is what it changes by from sample to sample: that
of the receiver is larger, by the filter's first response to an impulse, and white again once the filter
is undone. Rounding comes after the filter, and undoing it adds (w T)^2 to its density.
"""

from collections.abc import Callable, Sequence
from functools import cache, lru_cache

import numpy as np
from scipy.special import hyp0f1

from ..runs import Smoothed
from ..runs.row_order import missing_rows
from ..runs.run_constants import DIGITS, ORDER
from .filters import Filters
from .ship_model import Model
from .weak_form import BLOCK, EVERY, OVERLAP, WIDTH, WeakWindows, modelled_force

# [N, N, N m]. Chosen: below, rounding and the shape of commands between samples matter more than noise.
# Seconds and newtons are those of CyberShip Enterprise 1, times the scale of the ship.
# On a noise-free run at 20 Hz with smooth commands the true model leaves 4e-5 N and 1e-5 N m.
FLOOR = np.array([3e-4, 3e-4, 1e-4])
# rad/s, grid of the integral and of w0, which is held within it; chosen, far beyond the kernel's width
FREQUENCIES = np.geomspace(0.02, 60.0, 400)
# 1, factor within which the standard deviation is right (tests/test_diagnosis_where.py).
NOISE_TOLERANCE = 1.3
# 1, of the RMS commanded force of an axis: a force that is less matters in no manoeuvre, and may come
# from how a simulator integrates. Contract, for the residual; the same for findings.
SHARE_OF_COMMAND = 0.02

# 1, relative standard deviation of a measured coefficient. The search has no more for any coefficient;
# one prior for all has no more for masses, thrusters' forces and places, which no other ship had to
# lend. So much of the inertial force a model lacks at the least, and a steady force deviates by as much
# of the full thrust.
MEASURED = 0.1


@lru_cache  # filters; a fit asks for the same several times
def noise_gain(filters: Filters | None = None, time: float = 1.0) -> list[np.ndarray]:
    """For order k = 0 to 3, each channel and w0, (3, w0), the integral of w^2k |kernel U|^2 H [s^-2k-1].

    Args:
        filters: that are undone, which multiplies a pose by U; None: none.
        time: s at the ship's size for one at the size of CyberShip Enterprise 1.
    """
    U = 1.0 if filters is None else filters.undoing(FREQUENCIES / time)
    return [np.atleast_2d(FREQUENCIES**k * U) ** 2 @ _passed() for k in range(4)]


@cache
def _passed() -> np.ndarray:
    """(frequencies, w0), share of a density that reaches a window, times the step of the integral."""
    half = WIDTH / 2
    transform = hyp0f1(4.5, -((FREQUENCIES * half / 2) ** 2))  # of (1 - s^2)^3: of its power + 3/2
    H = 1.0 / (1.0 + (FREQUENCIES[:, None] / FREQUENCIES) ** 6)
    steps = np.gradient(FREQUENCIES)  # of the trapezoidal rule, but for its ends
    steps[[0, -1]] *= 0.5
    return (transform**2 * steps / np.pi)[:, None] * H


def omega_std(w: WeakWindows, model: Model | None = None) -> np.ndarray:
    """Standard deviation of the model error of each window, by the measurement and by missing rows.

    Args:
        w: windows of a run.
        model: by whose inertia an acceleration is a force; the nominal one by default.

    Returns:
        (K, 3) [N, N, N m].
    """
    model = model or Model()
    return np.asarray(np.sqrt(_measurement_variance(w, model) + command_variance(w, model)))


def measurement_std(w: WeakWindows, model: Model) -> np.ndarray:
    """The part (K, 3) of :func:`omega_std` by the measurement, that no force on the ship has."""
    return np.asarray(np.sqrt(_measurement_variance(w, model)))


def command_variance(w: WeakWindows, model: Model) -> np.ndarray:
    """Variance (K, 3) of the model error by commands of missing rows [N2, N2, N2 m2]; 0 without any.

    Commands are held from each row to the next. Where m rows of period h are missing between two, a
    command that changed may have done so in any of them: the later one acted for 0, h ... or m h [s]
    before its own row, each as likely as the others, h^2 m (2 m + 1) / 6 in the mean square.
    """
    step = np.diff(w.run.time)
    missing = missing_rows(w.run.time)
    early = float(np.median(step)) ** 2 * missing * (2.0 * missing + 1.0) / 6.0
    change = np.diff(w.run.tau_cmd @ model.effective_thrust.T, axis=0)
    square = early[:, None] * (change / step[:, None]) ** 2
    return np.asarray(w.held[:, :-1].power(2) @ square)


def _measurement_variance(w: WeakWindows, model: Model) -> np.ndarray:
    """(K, 3), square of :func:`measurement_std`."""
    filters = model.filters
    time, period, sampled = w.scale.time, w.smoothed.track.periods, _sampled(w)
    rounding = np.minimum(w.smoothed.noise, w.smoothed.track.usual_rounding)
    receiver = (w.smoothed.noise**2 - rounding**2) / filters.first_response(period) ** 2
    late = filters.squared_time
    gains = noise_gain()

    def variances(order: int, corner: np.ndarray) -> np.ndarray:
        gain = _gain(gains, corner, order) / time ** (2 * order + 1)
        rounded = gain
        if filters:
            rounded = gain + late * _gain(gains, corner, order + 1) / time ** (2 * order + 3)
        return sampled * (receiver * gain + rounding**2 * rounded)

    floor = (FLOOR * w.scale.forces) ** 2
    return _force_variance(w, model, variances) + floor


def corner_frequency(w: WeakWindows) -> np.ndarray:
    """(K, 3), w0 of the smoothing of each window [rad/s], by the variance of its pose."""
    smooth = w.smooth @ np.where(w.known[:, None], w.smoothed.eta_std, 0.0) ** 2
    even = 3.0 * smooth / (_sampled(w) * w.smoothed.noise**2)
    return np.where(bridged(w), _corner_by_jerk(w.smoothed), even)


def _corner_by_jerk(s: Smoothed) -> np.ndarray:
    """(3,), w0 of the smoothing of a run [rad/s], as of even samples and a jerk of constant density."""
    return np.asarray((s.jerk / (s.noise**2 * s.track.periods)) ** (0.5 / ORDER))


def bridged(w: WeakWindows) -> np.ndarray:
    """(K, 3), windows in which samples of a channel are missing for longer than half a period of w0."""
    s, half = w.smoothed, 0.5 * w.width
    found = np.zeros((w.middle.size, 3), bool)
    for k, (there, corner) in enumerate(zip(s.agrees.T, _corner_by_jerk(s), strict=True)):
        time, period = s.time[there], s.track.periods[k]
        step = np.diff(time)
        gap = (step > np.pi / corner) & (np.round(step / period) > 1.0)
        # Those that end after a window's begin, less those that begin after its end.
        begins, ends = time[:-1][gap], time[1:][gap]
        after = np.searchsorted(ends, w.middle - half, side="right")
        found[:, k] = np.searchsorted(begins, w.middle + half, side="left") > after
    return found


def undone_variance(w: WeakWindows, model: Model) -> np.ndarray:
    """Variance (K, 3) of the model error by the noise of the poses, as a model undoes its filters.

    The noise is white in the poses as they were measured, so that this is what of it a model that
    undoes a filter has in its error, whether or not there was a filter: undoing a tracker makes a motion
    slower, and noise with it.
    """
    time, power = w.scale.time, _sampled(w) * w.smoothed.noise**2
    gains = noise_gain(model.filters, time)
    return _force_variance(
        w, model, lambda k, corner: power * _gain(gains, corner, k) / time ** (2 * k + 1)
    )


def _sampled(w: WeakWindows) -> np.ndarray:
    """(K, 3), time [s] of a window for each sample of a channel in it: channels have their own rates."""
    s, period = w.smoothed, w.smoothed.track.periods
    rate = w.smooth @ (s.agrees / np.gradient(s.time)[:, None])
    # Weights of samples at uneven distances sum to a little more or less than one.
    return np.asarray(1.0 / np.clip(rate, 1.0 / w.width, 1.0 / period))


def _force_variance(
    w: WeakWindows, model: Model, variances: Callable[[int, np.ndarray], np.ndarray]
) -> np.ndarray:
    """Variance (K, 3) of the model error [N2, N2, N2 m2] by that of the pose's derivatives.

    Args:
        w: windows of a run.
        model: by whose inertia an acceleration is a force.
        variances: of a derivative's order and w0 (K, 3) that of north, east and heading (K, 3).
    """
    s, mass = w.smoothed, model.reference_mass
    corner = corner_frequency(w) * w.scale.time
    c2 = np.clip(w.smooth @ np.where(w.known, np.cos(s.eta[:, 2]) ** 2, 0.0), 0.0, 1.0)

    def in_axes(order: int) -> np.ndarray:
        """(K, 3), variance of a derivative of the pose in the ship's axes."""
        x, y, psi = (variances(order, corner) * _by_gaps(w, order)).T
        return np.column_stack([c2 * x + (1.0 - c2) * y, (1.0 - c2) * x + c2 * y, psi])

    pose, velocity, acceleration = map(in_axes, (0, 1, 2))
    slope, turned = _slope(w, model), np.zeros((w.middle.size, 3, 3))
    turned[:, :2, 2] = (w.smooth @ w.motion[1])[:, [1, 0]] * [1.0, -1.0]
    variance = acceleration @ (mass**2).T
    with np.errstate(over="ignore"):  # a force that no ship has is not known at all
        for by, of in ((slope - mass @ turned, velocity), (slope @ turned, pose)):
            variance += np.einsum("kij,kj->ki", by**2, of)
    return variance


def _by_gaps(w: WeakWindows, order: int) -> np.ndarray:
    """Factor (K, 3) by which gaps make the variance of a derivative more than that of even samples."""
    gaps = bridged(w)
    covariance = w.smoothed.covariance if gaps.any() else None
    if covariance is None:
        return np.ones((1, 3))

    def factor() -> np.ndarray:
        rows, known, s, time = gaps.any(axis=1), w.known, w.smoothed, w.scale.time
        weights, derivative = ((w.smooth, 0), (w.smooth, 1), (w.slope, 1))[order]
        posterior = covariance.variance(weights[rows][:, known], s.time[known], derivative)
        even = _sampled(w) * s.noise**2 * _gain(noise_gain(), corner_frequency(w) * time, order)
        found = np.ones(gaps.shape)
        found[rows] = posterior * time ** (2 * order + 1) / even[rows]
        return np.where(gaps, found, 1.0)

    return w.recall("gaps", order, factor)


def _gain(gains: Sequence[np.ndarray], corner: np.ndarray, order: int) -> np.ndarray:
    """An entry (K, 3) of :func:`noise_gain` at corner frequencies (K, 3) between those of its grid."""
    grid, at = np.log(FREQUENCIES), np.log(corner)
    each = zip(at.T, np.broadcast_to(gains[order], (3, FREQUENCIES.size)), strict=True)
    return np.exp(np.column_stack([np.interp(x, grid, np.log(gain)) for x, gain in each]))


def _slope(w: WeakWindows, model: Model) -> np.ndarray:
    """Force and moment (K, 3, 3) by u, v, r over steps as large as its error.

    It is that of the motion as it was measured: models that undo other filters have the same.
    """
    if model.given or model.runs:
        return _by_steps(w, model)
    values = (tuple(sorted(part.items())) for part in (model.vessel, model.thrusters))
    return w.recall("slope", (model.ship, *values, model.logging), lambda: _by_steps(w, model))


def _by_steps(w: WeakWindows, model: Model) -> np.ndarray:
    """See :func:`_slope`."""
    error = np.median(w.smoothed.nu_std[w.known], axis=0)
    steps = np.maximum(error, DIGITS * np.array(w.scale.speeds))
    _, nu = w.motion
    first = modelled_force(w, model, nu)
    changes = [modelled_force(w, model, nu + step) - first for step in np.diag(steps)]
    return np.stack(changes, axis=2) / steps


def independent(data: Sequence[WeakWindows], error: np.ndarray) -> np.ndarray:
    """Factor (3,) by which the windows that count as one are more than those that overlap, at least 1.

    Args:
        data: windows of every run.
        error: (K, 3), a model error in them.
    """
    return np.maximum(1.0, correlated_windows(data, error) / OVERLAP)


def correlated_windows(data: Sequence[WeakWindows], error: np.ndarray) -> np.ndarray:
    """Windows (3,) that carry as much as one independent window; arguments as of :func:`independent`.

    With the autocorrelation rho_l of a stationary series at a lag of l windows, the variance of its mean
    is that of independent samples times tau = 1 + 2 sum rho_l. The sum ends before the first correlation
    that is not positive, beyond which an estimate is noise (C. J. Geyer, Practical Markov chain Monte
    Carlo, Statistical Science 7, 1992).
    """
    mean = autocovariance(data, error, round(2.0 * BLOCK / EVERY))  # lags up to two blocks
    rho = mean / np.maximum(mean[0], np.finfo(float).tiny)
    positive = np.cumprod(rho[1:] > 0.0, axis=0)
    return 1.0 + 2.0 * np.sum(rho[1:] * positive, axis=0)


def autocovariance(data: Sequence[WeakWindows], error: np.ndarray, longest: int) -> np.ndarray:
    """(longest + 1, 3), mean product of a model error with itself some windows later.

    Args:
        data, error: as of :func:`independent`.
        longest: lag [windows].
    """
    sums, pairs = np.zeros((longest + 1, 3)), np.zeros(longest + 1)
    edges = np.cumsum([w.middle.size for w in data])[:-1]
    for w, part in zip(data, np.split(error, edges), strict=True):
        apart = np.minimum(np.round(np.diff(w.middle) / w.every), longest + 1.0)  # not a gap of years
        place = np.concatenate([[0], np.cumsum(apart)]).astype(int)
        series, there = np.zeros((place[-1] + 1, 3)), np.zeros(place[-1] + 1)
        series[place], there[place] = part, 1.0
        for lag in range(min(longest + 1, place[-1] + 1)):
            sums[lag] += (series[lag:] * series[: len(series) - lag]).sum(axis=0)
            pairs[lag] += there[lag:] @ there[: len(there) - lag]
    return sums / np.maximum(pairs, 1.0)[:, None]
