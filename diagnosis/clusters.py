"""Means over measurements of which only whole stretches of time are independent of each other."""

from typing import NamedTuple

import numpy as np
from scipy import stats


class Mean(NamedTuple):
    """A mean with its variance and the degrees of freedom of that."""

    mean: float
    variance: float
    free: int


def clustered(total: np.ndarray, count: np.ndarray) -> Mean:
    """Mean over blocks that are independent, for the sum and the number (blocks,) of what is in each."""
    there = count > 0
    n, blocks = float(count.sum()), int(there.sum())
    mean = float(total.sum()) / max(n, 1.0)
    off = total[there] - count[there] * mean
    return Mean(mean, float(off @ off) / max(n, 1.0) ** 2 * blocks / max(blocks - 1, 1), blocks - 1)


def chance(a: Mean, b: Mean) -> float:
    """Probability that a is as far above b, or further, though they are the same (Welch)."""
    variance = a.variance + b.variance
    if a.free < 1 or b.free < 1 or variance <= 0.0:
        return 1.0
    free = variance**2 / (a.variance**2 / a.free + b.variance**2 / b.free)
    return float(stats.t.sf((a.mean - b.mean) / np.sqrt(variance), free))
