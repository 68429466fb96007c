"""Student's test of differences that belong together, by blocks of time or by folds."""

import numpy as np
from scipy.special import stdtrit


def surely_positive(values: np.ndarray, chance: float) -> bool:
    """Whether the mean of independent values (k,) is above zero, by Student's one-sided test."""
    k = values.size
    return k > 1 and bool(values.mean() > values.std(ddof=1) / k**0.5 * -stdtrit(k - 1, chance))
