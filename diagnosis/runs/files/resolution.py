"""To which step the numbers of a column are rounded: by decimals, or by significant digits."""

import numpy as np

MOST_DIGITS = 12  # 1, of a number that counts as rounded; double precision has 15 (chosen)
EXACT = 0.999  # 1, share of the numbers that are rounded so; chosen: a few may be of another writer
FUZZ = 1e-6  # 1, of a step or a value, by which arithmetic may have moved a number (chosen)


def resolution(values: np.ndarray) -> np.ndarray:
    """The step to which each of some numbers (n,) is rounded; zero where they are not."""
    counted = np.isfinite(values) & (values != 0.0)
    size = np.abs(values[counted])
    if not size.size:
        return np.zeros_like(values)
    power = np.floor(np.log10(size * (1.0 + FUZZ)))  # of ten, of the first digit
    for digits in range(1, MOST_DIGITS + 1):
        for first in (np.full_like(power, power.max()), power):  # decimals, significant digits
            step = 10.0 ** (first - digits + 1.0)
            off = np.abs(size - step * np.round(size / step))
            if np.mean(off <= FUZZ * step + np.spacing(size)) >= EXACT:
                found = np.full_like(values, step.min())
                found[counted] = step
                return found
    return np.zeros_like(values)
