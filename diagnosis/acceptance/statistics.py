"""How many windows are independent, and what they say for sure of all that could have been measured.

Bounds of a share are those of Clopper and Pearson (Biometrika 26, 1934). The number of independent
windows is that of Bayley and Hammersley (J. R. Stat. Soc. Suppl. 8, 1946), by the autocorrelation of
the errors up to the first lag at which it is not positive.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import betaincinv, stdtrit

from ..runs.run_constants import DIGITS


class Interval(NamedTuple):
    """An estimate between two bounds, each at a one-sided confidence."""

    estimate: float
    low: float
    high: float


def independent(errors: np.ndarray, run: np.ndarray) -> float:
    """How many of some windows are independent.

    Args:
        errors: (w,), of consecutive windows that do not overlap.
        run: (w,), number of each one's run, in order; of runs nothing is taken to correlate.

    Returns:
        From 1 to w.
    """
    n = errors.size
    known = np.where(np.isfinite(errors), errors, np.max(errors, initial=0.0, where=np.isfinite(errors)))
    off = known - known.mean()
    variance = float(np.mean(off**2))
    if n < 3 or variance == 0.0:
        return float(n)
    total, lag, correlation = 0.0, 1, variance
    while correlation > 0.0 and lag < n - 1:
        correlation = float(np.sum(off[lag:] * off[:-lag] * (run[lag:] == run[:-lag]))) / n
        total, lag = total + max(correlation, 0.0), lag + 1
    return float(np.clip(n / (1.0 + 2.0 * total / variance), 1.0, n))


def share(inside: np.ndarray, n: float, confidence: float) -> Interval:
    """The share of windows in which something is so.

    Args:
        inside: (w,), whether it is.
        n: how many of these are independent.
        confidence: of each bound.
    """
    p = float(np.mean(inside))
    k, a = p * n, 1.0 - confidence
    low = 0.0 if k <= 0.0 else float(betaincinv(k, n - k + 1.0, a))
    high = 1.0 if k >= n else float(betaincinv(k + 1.0, n - k, confidence))
    return Interval(p, low, high)


def root_mean_square(errors: np.ndarray, n: float, confidence: float) -> Interval:
    """RMS of errors (w,), of which n are independent; Student's t for the mean of squares."""
    squares = errors**2
    mean = float(np.mean(squares))
    if n < 2.0 or not np.isfinite(mean):
        return Interval(float(np.sqrt(mean)), 0.0, np.inf)
    half = float(stdtrit(n - 1.0, confidence)) * float(np.std(squares, ddof=1)) / np.sqrt(n)
    low, high = max(mean - half, 0.0), mean + half
    return Interval(*(float(np.sqrt(x)) for x in (mean, low, high)))


def needed(share: float, confidence: float) -> int:
    """Independent windows, all of them within, from which on a share is sure."""
    return int(np.ceil(np.log(1.0 - confidence) / np.log(share) - DIGITS))
