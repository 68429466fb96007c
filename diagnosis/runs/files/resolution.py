"""To which step the numbers of a column are rounded: by decimals, or by significant digits."""

import numpy as np

from ..run_constants import CHANCE, DIGITS


def resolution(values: np.ndarray) -> np.ndarray:
    """The step to which each of some numbers (n,) is rounded; zero where they are not."""
    counted = np.isfinite(values) & (values != 0.0)
    size = np.abs(values[counted])
    if not size.size:
        return np.zeros_like(values)
    power = np.floor(np.log10(size * (1.0 + DIGITS)))  # of ten, of the first digit
    for digits in range(1, np.finfo(float).precision + 1):
        for first in (np.full_like(power, power.max()), power):  # decimals, significant digits
            step = 10.0 ** (first - digits + 1.0)
            off = np.abs(size - step * np.round(size / step))
            if np.mean(off <= DIGITS * step + np.spacing(size)) >= 1.0 - CHANCE:
                found = np.full_like(values, step.min())
                found[counted] = step
                return found
    return np.zeros_like(values)
