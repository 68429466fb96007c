"""Variance of integrals over a smoothed motion, by the posterior of its splines.

An integral over a spline and its derivatives is a linear function a of the coefficients, whose
covariance is A^-1 = (L L^T)^-1 (:mod:`.penalised`): its variance is |L^-1 a|^2. Wherever samples are
missing, that is the variance of what the jerk may have done meanwhile.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import get_lapack_funcs
from scipy.sparse import csr_matrix

from .spline import MEMORY, Knots, basis

TBTRS: Any = get_lapack_funcs("tbtrs", dtype=float)  # solves by a triangular band


class SplineCovariance(NamedTuple):
    """What the samples leave uncertain of the splines of the three channels.

    Attributes:
        grid: their knots, times counted from ``start``.
        factors: (3, 6, size), lower bands of L.
        start: time of the run's first row [s].
    """

    grid: Knots
    factors: np.ndarray
    start: float

    def variance(self, weights: csr_matrix, time: np.ndarray, derivative: int) -> np.ndarray:
        """Variance (K, 3) of sums of a derivative of the pose, of which the commands explain a part.

        Args:
            weights: (K, n), of the derivative at some times in stretches.
            time: (n,) [s].
            derivative: its order.
        """
        sums: Any = weights @ basis(self.grid, time - self.start, derivative).matrix
        found = np.zeros((sums.shape[0], len(self.factors)))
        for row, (begin, end) in enumerate(zip(sums.indptr[:-1], sums.indptr[1:], strict=True)):
            columns = sums.indices[begin:end]
            first = columns.min()
            band = self.factors[:, :, first : columns.max() + MEMORY]
            right = np.zeros((band.shape[2], 1))
            right[columns - first, 0] = sums.data[begin:end]
            found[row] = [np.sum(TBTRS(factor, right, uplo="L")[0] ** 2) for factor in band]
        return found
