"""Linear filters of evenly spaced signals."""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import get_lapack_funcs


def filtered(numerator: Sequence[float], denominator: Sequence[float], x: np.ndarray) -> np.ndarray:
    """A signal behind a linear filter at rest before, as a triangular system with few diagonals.

    ``scipy.signal.lfilter`` gives the same, but takes more time to import than a run takes to smooth.

    Args:
        numerator, denominator: polynomials in 1/z; the latter begins with one.
        x: (n, k), the signal.
    """
    y = np.zeros_like(x)
    for late, gain in enumerate(numerator[: len(x)]):
        if gain:
            y[late:] += gain * x[: len(x) - late]
    if len(denominator) == 1:
        return y
    diagonals = np.asarray(denominator, x.dtype)[:, None].repeat(len(x), axis=1)
    (solved,) = get_lapack_funcs(("tbtrs",), (y,))
    return solved(diagonals, y, uplo="L", diag="U")[0]
