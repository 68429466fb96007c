"""Times to twelve decimal places, many at once, as Python's round() has each."""

import numpy as np

from ..algorithm import PLACES

SCALE = 10.0**PLACES
# Numbers from here on [s] are farther apart than two decimal numbers: they are what they are rounded to.
COARSE = 2.0**13
# Factor that splits a number into two of half the digits (Veltkamp).
SPLIT = 2.0**27 + 1.0


def _halves(x: np.ndarray | float) -> tuple[np.ndarray | float, np.ndarray | float]:
    high = SPLIT * x - (SPLIT * x - x)
    return high, x - high


def round_to_places(times: np.ndarray) -> np.ndarray:
    """Numbers rounded to :data:`PLACES` decimal places.

    Args:
        times: none negative.

    Returns:
        For each what ``round(t, PLACES)`` is, to the bit.
    """
    # The product without its rounding (Dekker, 1971): product + rest.
    product = times * SCALE
    (a, b), (c, d) = _halves(times), _halves(SCALE)
    rest = ((a * c - product) + a * d + b * c) + b * d
    whole = np.rint(product)
    off = (product - whole) + rest
    whole += np.sign(off) * (np.abs(off) > 0.5)
    # A quotient of two exact numbers is rounded once, as a decimal number that is read.
    rounded = np.where(times < COARSE, whole / SCALE, times)
    for k in np.flatnonzero(np.abs(off) == 0.5):
        rounded[k] = round(float(times[k]), PLACES)
    return rounded
