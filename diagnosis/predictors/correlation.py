"""How long a model error lasts: the number of windows that carry as much as one independent window.

With the autocorrelation rho_l of a stationary series at a lag of l windows, the variance of its mean is
that of independent samples times tau = 1 + 2 sum rho_l. The sum ends before the first correlation that
is not positive, beyond which an estimate is noise (C. J. Geyer, Practical Markov chain Monte Carlo,
Statistical Science 7, 1992).
"""

from collections.abc import Sequence

import numpy as np

from .weak_form import BLOCK, EVERY, OVERLAP, WeakWindows


def independent(data: Sequence[WeakWindows], error: np.ndarray) -> np.ndarray:
    """Factor (3,) by which the windows that count as one are more than those that overlap, at least 1.

    Args:
        data: windows of every run.
        error: (K, 3), a model error in them.
    """
    return np.maximum(1.0, correlated_windows(data, error) / OVERLAP)


def correlated_windows(data: Sequence[WeakWindows], error: np.ndarray) -> np.ndarray:
    """tau (3,) of a model error; arguments as of :func:`independent`."""
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
