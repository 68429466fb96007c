"""Least squares of a few constants on a run whose errors last: their spread is that over its parts."""

import numpy as np

from ..cleaning import noise

SURE = 4.0  # standard deviations of what is told; chosen as for all other channels
BLOCKS = 20  # parts of the run, whose spread gives the standard deviation; chosen


def blocked_fit(
    columns: np.ndarray, right: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least squares, and the standard deviation by the jackknife over blocks of time.

    Args:
        columns: (d n, k), what one unit of each unknown gives.
        right: (d n,), d quantities one after the other.
        time: (n,), of each of their rows [s].

    Returns:
        Two arrays (k,).
    """
    several = right.size // time.size
    block = np.tile(np.minimum((BLOCKS * np.arange(time.size)) // time.size, BLOCKS - 1), several)

    def solved(keep: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(columns[keep], right[keep], rcond=None)[0]

    value = solved(np.ones(right.size, bool))
    parts = np.array([solved(block != k) for k in range(BLOCKS)])
    std = np.sqrt((BLOCKS - 1) / BLOCKS * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0))
    return value, np.maximum(std, float(noise(right[:, None])[0]) / np.sqrt(right.size))
