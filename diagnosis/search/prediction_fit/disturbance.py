"""The force that nobody recorded, as noise: on each axis an Ornstein-Uhlenbeck process.

Its covariance at a distance t is size^2 exp(-|t| / time). Both come from the autocovariance of the model
error that a model leaves: a mean over windows w(t) of such a force has the covariance
size^2 int int w(a) w(b) exp(-|l + a - b| / time) at a lag l, and the measurement's noise adds that of
its second derivative. What it does to a prediction follows from the motion about it, x' = F x + M^-1 f.

Errors of a hull's and a rudder's force grow with the speed U, and so does the effect of moving water on
them, rho A U dU. Of the variance a share grows with U^2, by least squares over the runs. Bands follow
it; the weights of a fit do not: with it errors on runs left out fall on one ship and rise on another.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import nnls

from ...predictors import WeakWindows
from ...predictors.shooting import PARTS, Linear
from ...predictors.thrust import LONGEST_STEP
from ...predictors.uncertainty import autocovariance
from ...predictors.weak_form import EVERY, WIDTH, kernel

# s, times the scale of the ship; correlation times that are tried. A shorter one is white for windows of
# the weak form, a longer one a bias.
TIMES = np.geomspace(0.2, 12.0, 25)


@dataclass(frozen=True, eq=False)
class ForceDisturbance:
    """The unrecorded force.

    Attributes:
        size: (..., 3) [N, N, N m], at ``speed``; 0: none.
        time: (3,), correlation time [s].
        growth: (3,), share of its variance that grows with the square of the ship's speed.
        speed: at which the size holds, any where nothing grows [m/s].
    """

    size: np.ndarray
    time: np.ndarray
    growth: np.ndarray = field(default_factory=lambda: np.zeros(3))
    speed: float = np.inf

    def at(self, speed: np.ndarray) -> "ForceDisturbance":
        """That of ships at some speeds (w,) [m/s]."""
        faster = np.square(speed[:, None] / self.speed)
        return ForceDisturbance(self.size * np.sqrt(1.0 + self.growth * (faster - 1.0)), self.time)

    def growing(self, each: Sequence["ForceDisturbance"], speed: np.ndarray) -> "ForceDisturbance":
        """The same with the growth that its parts show.

        Least squares of their variances, with a further one at rest that is as large as usual: few runs,
        or runs of one speed, determine no growth.

        Args:
            each: that of each run.
            speed: of each run, root mean square [m/s].
        """
        usual = float(np.sqrt(np.mean(np.square(speed))))
        variance = np.square([d.size for d in each])
        mean = variance.mean(axis=0)
        if not (usual > 0.0 and mean.any()):
            return self
        A = np.column_stack([np.ones(speed.size + 1), np.append(np.square(speed / usual), 0.0)])
        found = np.zeros(3)
        for k in np.flatnonzero(mean):
            still, moving = nnls(A, np.append(variance[:, k] / mean[k], 1.0))[0]
            found[k] = moving / (still + moving)
        return replace(self, growth=found, speed=usual)


def _kernels() -> tuple[np.ndarray, np.ndarray]:
    """Covariance of a window's mean at each lag: by TIMES (times, lags), by noise (lags,).

    Beyond lags of twice the width of a window it is hardly determined.
    """
    half = round(0.5 * WIDTH / LONGEST_STEP)  # steps that are a tenth of the shortest of these times
    t = np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, 2 * half + 1)
    w = kernel(2.0 * t / WIDTH)
    step = t[1] - t[0]
    lags = np.arange(0.0, 2.0 * WIDTH + EVERY, EVERY)
    both = np.convolve(w, w) * step / (w.sum() * step) ** 2  # of the difference of two places
    apart = step * np.arange(-2 * half, 2 * half + 1)
    force = np.exp(-np.abs(lags[:, None] + apart) / TIMES[:, None, None]) @ both * step
    bent = np.gradient(np.gradient(w, t), t)
    noise = np.interp(lags, apart, np.convolve(bent, bent), right=0.0)
    return force, noise / noise[0]


OF_FORCE, OF_NOISE = _kernels()


def estimate(
    data: Sequence[WeakWindows], error: np.ndarray, std: np.ndarray, time: np.ndarray | None = None
) -> ForceDisturbance:
    """The disturbance that a model error shows.

    Args:
        data: windows of every run.
        error, std: (K, 3), what a model leaves in them, and its standard deviation by noise [N, N, N m].
        time: (3,), correlation times among those that are tried, if they are known [s].
    """
    times = TIMES * data[0].scale.time
    left = autocovariance(data, error, OF_NOISE.size - 1) - np.mean(std**2, axis=0) * OF_NOISE[:, None]
    variance = np.maximum(OF_FORCE @ left, 0.0) / np.sum(OF_FORCE**2, axis=1)[:, None]  # (times, 3)
    missed = np.sum((left - variance[..., None, :] * OF_FORCE[..., None]) ** 2, axis=1)
    best = np.argmin(missed, axis=0) if time is None else np.searchsorted(times, time)
    return ForceDisturbance(np.sqrt(variance[best, range(3)]), times[best])


def covariance(motion: Linear, at_start: np.ndarray, disturbance: ForceDisturbance) -> np.ndarray:
    """Covariance (w, T, 3, T, 3) of predicted poses, by the initial state and a disturbance.

    Args:
        motion: about the predictions.
        at_start: (w, 6, 6), covariance of the initial state.
        disturbance: the unrecorded force, its size (3,) or that of each window (w, 3); at
            the start as large as always.
    """
    windows, instants = motion.slope.shape[:2]
    over, added = _steps(motion, disturbance)
    P = np.zeros((windows, 9, 9))
    P[:, :6, :6], P[:, range(6, 9), range(6, 9)] = at_start, disturbance.size**2
    found = np.zeros((windows, instants, 3, instants, 3))
    for i in range(instants):
        P = over[:, i] @ P @ over[:, i].transpose(0, 2, 1) + added[:, i]
        later = P[:, :, :3]
        for j in range(i, instants):
            if j > i:
                later = over[:, j] @ later
            found[:, j, :, i], found[:, i, :, j] = later[:, :3], later[:, :3].transpose(0, 2, 1)
    return found


def _steps(motion: Linear, disturbance: ForceDisturbance) -> tuple[np.ndarray, np.ndarray]:
    """Transition (w, T, 9, 9) of state and force from instant to instant, and what noise adds."""
    A = np.zeros((*motion.slope.shape[:2], 9, 9))
    A[..., :6, :6], A[..., 3:6, 6:] = motion.slope, motion.by_mass
    A[..., 6:, 6:] = -np.diag(1.0 / disturbance.time)
    if not disturbance.size.any():
        return _exponential(motion.every * A), np.zeros_like(A)
    rate = np.broadcast_to(2.0 * disturbance.size**2 / disturbance.time, (len(A), 3))[:, None, None]
    added = np.zeros_like(A)
    for x, weight in zip(*np.polynomial.legendre.leggauss(PARTS), strict=True):
        G = _exponential(0.5 * motion.every * (x + 1.0) * A)[..., 6:]
        added += 0.5 * motion.every * weight * (G * rate) @ np.swapaxes(G, -1, -2)
    return _exponential(motion.every * A), added


def _exponential(A: np.ndarray) -> np.ndarray:
    """exp(A) of matrices (..., n, n), by scaling and squaring of a Taylor series of sixth order.

    NaN where it may be beyond all numbers, as along the prediction of a ship that runs away.
    """
    size = np.abs(A).sum(axis=-1).max(axis=-1)
    known = (size < np.log(np.finfo(float).max))[..., None, None]
    largest = max(np.max(size, where=known[..., 0, 0], initial=0.0), 1e-9)
    halvings = max(0, int(np.ceil(np.log2(largest))) + 1)
    X, one = np.where(known, A, 0.0) / 2.0**halvings, np.eye(A.shape[-1])
    found = one + X / 6.0
    for k in range(5, 0, -1):
        found = one + X @ found / k
    for _ in range(halvings):
        found = found @ found
    return np.where(known, found, np.nan)
