"""Correlated noise of a pose: the white noise that is as dense at the frequencies of the motion.

Receivers that average, and reflections of their signals, give errors that last for some samples. A
velocity then has a larger error than the scatter of the samples suggests. The third difference of
samples a time h apart has the Hadamard variance (R. A. Baugh 1971; W. J. Riley, NIST SP 1065, 2008)

    white noise                                 20 s^2,
    noise of correlation exp(-t / T) = r(t)     s^2 (20 - 30 r(h) + 12 r(2h) - 2 r(3h)),
    a mass that a force of finite variance moves: h^3 (a white force) or steeper, to h^6.

Whatever rises less steeply than h^3 is therefore noise and no motion. The shares of all follow by
nonnegative least squares. At an angular frequency w, noise of variance s^2 and correlation time T,
sampled every P, has the density of white noise of variance s^2 (2 T / P) / (1 + (w T)^2). It is taken at
the frequency w0 at which the smoother passes half, see :mod:`diagnosis.predictors.uncertainty`.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import nnls
from scipy.special import chdtri

from ..row_order import whole_periods
from ..run_constants import CHANCE, DIGITS, ORDER
from .likelihood import adapt, likeliest
from .outliers import REWEIGHTINGS, Inliers
from .penalised import Problem
from .spline import DEGREE

GROWTH = 1.5  # 1, from lag to lag, in samples; chosen


class Correlated(NamedTuple):
    """Noise of a channel as white noise and parts that last.

    Attributes:
        white: variance of the white noise.
        variance, time: (parts,), and correlation times [s].
        period: between samples [s].
    """

    white: float
    variance: np.ndarray
    time: np.ndarray
    period: float

    def as_white(self, frequency: float) -> float:
        """Standard deviation of white noise that is as dense at an angular frequency [rad/s]."""
        lasting = 2.0 * self.time / self.period / (1.0 + (frequency * self.time) ** 2)
        return float(np.sqrt(self.white + self.variance @ lasting))


def hadamard(
    time: np.ndarray, z: np.ndarray, longest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Hadamard variance of samples, by the median of squares: manoeuvres and spikes hardly count.

    Args:
        time: (n,) [s], growing; samples may be missing.
        z: (n,), values.
        longest: lag [s].

    Returns:
        lags (k,) [s], variances (k,), relative standard deviations (k,) and the period [s]; no lags
        where the samples are not even.
    """
    step = np.diff(time)
    period = float(np.median(step))
    counts = whole_periods(step, period)
    if counts is None:
        return np.zeros(0), np.zeros(0), np.zeros(0), period
    counts = np.minimum(counts, int(3.0 * longest / period) + 1)  # none reaches over a longer gap
    place = np.concatenate([[0], np.cumsum(counts)]).astype(int)
    even = np.full(place[-1] + 1, np.nan)
    even[place] = z
    most = min(int(longest / period), (even.size - 1) // 3)
    powers = np.arange(np.log(max(most, 1)) / np.log(GROWTH) + DIGITS)
    lags = np.unique(np.round(GROWTH**powers).astype(int))
    found = []
    median = float(chdtri(1.0, 1.0 / 2.0))  # of the square of a standard normal variable
    density = np.exp(-median / 2.0) / np.sqrt(2.0 * np.pi * median)
    # Relative variance of a variance by the median of n independent squares, times n.
    spread = 1.0 / (2.0 * density * median) ** 2
    for h in lags:
        d = even[3 * h :] - 3.0 * even[2 * h : -h] + 3.0 * even[h : -2 * h] - even[: -3 * h]
        d = d[np.isfinite(d)]
        if d.size > h and d.any():
            found.append((h * period, np.median(d**2) / median, np.sqrt(spread * h / d.size)))
    lag, variance, std = np.array(found).reshape(-1, 3).T
    positive = variance > 0.0
    return lag[positive], variance[positive], std[positive], period


def correlated(time: np.ndarray, z: np.ndarray, longest: float) -> Correlated | None:
    """The noise of samples, arguments as of :func:`hadamard`; None: none that lasts is known.

    It is known if it is likelier than white noise and motion alone by the chance of a false report.
    """
    h, variance, std, period = hadamard(time, z, longest)
    powers = np.arange(ORDER, 2 * ORDER + 1)  # of h, by a motion
    few = 1 + powers.size
    if h.size <= few:  # they determine no more than white noise and motion
        return None
    times = np.geomspace(period, h[-1], h.size)
    (difference,) = np.diff(np.eye(ORDER + 1), ORDER, axis=0)
    white, *further = np.correlate(difference, difference, "full")[ORDER:]  # by lags
    r = [np.exp(-k * h[:, None] / times) for k in range(1, ORDER + 1)]
    lasting = white + 2.0 * sum(factor * at for factor, at in zip(further, r, strict=True))
    motion = (h[:, None] / h[-1]) ** powers
    terms = np.column_stack([np.full(h.size, white), motion, lasting]) / (variance * std)[:, None]
    size = np.linalg.norm(terms, axis=0)
    target = 1.0 / std
    share, left = nnls(terms / size, target)
    _, without = nnls((terms / size)[:, :few], target)
    if 0.5 * (without**2 - left**2) < -np.log(CHANCE):
        return None
    share = share / size
    return Correlated(float(share[0]), share[few:], times, period)


def with_correlated(
    found: Inliers, even: Problem, time: np.ndarray, longest: float, free: np.ndarray
) -> Inliers:
    """Splines through samples whose noise may last.

    Args:
        found: the samples, and splines with white noise.
        even: the problem, with an even penalty and that noise.
        time: (n,), of its samples [s].
        longest: time over which noise is looked for [s].
        free: (3,), channels whose noise is not given.
    """
    sampled = (found.weights > 0.0) & (even.share > 0.0)
    parts = [
        correlated(time[of], z[of], longest) if of.sum() > 1 and may else None
        for of, z, may in zip(sampled.T, even.z.T, free, strict=True)
    ]
    if not any(parts):
        return found
    white, smoothness = even.sigma, found.even
    for _ in range(REWEIGHTINGS):
        before = even.sigma
        # The density of the jerk is that of the noise, sigma^2 P, over s h^5 P.
        sigma = [
            max(s, c.as_white((smooth * even.spline.grid.spacing**DEGREE * c.period) ** (-1.0 / 6.0)))
            if c
            else s
            for s, c, smooth in zip(white, parts, smoothness, strict=True)
        ]
        even = even._replace(sigma=np.array(sigma))
        smoothness = likeliest(even, found.weights, smoothness * (even.sigma / before) ** 2)
        if np.allclose(even.sigma, before, rtol=CHANCE):
            break
    adapted, smooth = adapt(even, smoothness, found.weights)
    return Inliers(adapted, smooth, found.weights, smoothness)
