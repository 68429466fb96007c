"""Quintic splines on evenly spaced knots, in stretches that are independent of each other.

The smoothing spline f that minimises

    sum_i w_i (z_i - f(t_i))^2 + s h^5 int (d3f/dt3)^2 dt

is the mean of a process driven by white jerk, given noisy measurements of it (Kimeldorf and Wahba 1970):
what a Kalman filter and Rauch-Tung-Striebel smoother give, here for all samples at once, at any
sampling, as a banded linear system. With f = B c and knots every h, h^5 times the integral is c^T K c,
K the Gram matrix of the third derivatives in units of h.
"""

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import BSpline, PPoly
from scipy.linalg import cholesky_banded, get_lapack_funcs, hilbert
from scipy.sparse import csr_array, csr_matrix

from ..run_constants import DIGITS, ORDER

DEGREE = 2 * ORDER - 1  # 1, of the smoothing spline
# 1, coefficients after which the recursion of the inverse has forgotten its start: its memory falls as
# exp(-n / (2 s^(1/6))), to 5e-5 at the smoothness s = 1e6, to 1e-2 at the largest one, 1e8.
MEMORY = 200
TBTRS: Any = get_lapack_funcs("tbtrs", dtype=float)  # solves by a triangular band


@cache
def pieces(degree: int, derivative: int = 0) -> np.ndarray:
    """(power, function): derivatives of the basis functions on an interval, polynomials over [0, 1]."""
    element = BSpline.basis_element(np.arange(degree + 2.0), extrapolate=False)
    spline = PPoly.from_spline(element.tck).derivative(derivative)
    return spline.c[::-1, np.searchsorted(spline.x, np.arange(degree + 1)[::-1])]


WIDTH = len(pieces(DEGREE))  # basis functions that overlap
FIRST, SECOND = np.triu_indices(WIDTH)  # pairs of these


class Knots(NamedTuple):
    """Evenly spaced knots over each of some stretches of time.

    Attributes:
        start, end: (stretches,) [s].
        first: (stretches,), index of the first coefficient of each.
        intervals: (stretches,), number of intervals of each.
        spacing: between knots [s].
    """

    start: np.ndarray
    end: np.ndarray
    first: np.ndarray
    intervals: np.ndarray
    spacing: float

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return int(self.first[-1] + self.intervals[-1] + DEGREE)

    @property
    def rank(self) -> int:
        """Rank of the penalty: its null space is a parabola in each stretch."""
        return self.size - ORDER * self.start.size


def knots(start: np.ndarray, end: np.ndarray, spacing: float) -> Knots:
    """Knots for stretches from ``start`` to ``end`` [s], no closer than ``spacing`` [s]."""
    intervals = np.maximum(1, np.ceil((end - start) / spacing - DIGITS)).astype(int)
    first = np.concatenate([[0], np.cumsum(intervals + DEGREE)[:-1]])
    return Knots(start, end, first, intervals, spacing)


@dataclass(frozen=True, eq=False)
class Basis:
    """Rows of a matrix with six successive entries each, such as the basis functions at some times.

    Attributes:
        first: (n,), column of the first entry.
        values: (n, 6), the entries.
        size: number of columns.
    """

    first: np.ndarray
    values: np.ndarray
    size: int

    @cached_property
    def matrix(self) -> csr_array:
        """(n, size), the same as a sparse matrix."""
        return self._sparse(self.values, np.arange(WIDTH), 1)

    @cached_property
    def _pairs(self) -> csr_array:
        """(n, 6 size): products of entries, those of the diagonal first."""
        return self._sparse(
            self.values[:, FIRST] * self.values[:, SECOND], FIRST + (SECOND - FIRST) * self.size, WIDTH
        )

    def _sparse(self, values: np.ndarray, columns: np.ndarray, many: int) -> csr_array:
        at, ends = self.first[:, None] + columns, np.arange(0, values.size + 1, columns.size)
        return csr_array((values.ravel(), at.ravel(), ends), shape=(len(values), many * self.size))

    def __call__(self, coefficients: np.ndarray) -> np.ndarray:
        """(n, channels): the spline, for coefficients (size, channels)."""
        return self.matrix @ coefficients

    def gram(self, weights: np.ndarray) -> np.ndarray:
        """(6, size): lower band of B^T W B, for weights (n,)."""
        return (self._pairs.T @ weights).reshape(WIDTH, self.size)

    def variance(self, inverse: np.ndarray) -> np.ndarray:
        """(n, channels): variance of a spline, by that (6, size, channels) of its coefficients."""
        twice = np.where(np.arange(WIDTH) == 0, 1.0, 2.0)[:, None, None] * inverse
        return self._pairs @ twice.reshape(WIDTH * self.size, -1)


def basis(grid: Knots, time: np.ndarray, derivative: int = 0) -> Basis:
    """The basis at times [s] that lie in stretches, or one of its derivatives."""
    stretch = np.clip(np.searchsorted(grid.start, time, side="right") - 1, 0, None)
    place = (time - grid.start[stretch]) / grid.spacing
    interval = np.clip(np.floor(place), 0, grid.intervals[stretch] - 1).astype(int)
    powers = np.vander(place - interval, WIDTH - derivative, increasing=True)
    values = powers @ pieces(DEGREE, derivative) / grid.spacing**derivative
    return Basis(grid.first[stretch] + interval, values, grid.size)


def roughness(grid: Knots, weights: np.ndarray) -> tuple[Basis, np.ndarray]:
    """R and K = R^T R with c^T K c the integral of squared third derivatives times the spacing^5.

    The third derivative is a spline of degree two with the third differences of the coefficients: R is a
    Cholesky factor of its Gram matrix times these differences. |R c|^2 is a sum of squares that loses no
    digits, where c^T K c is a small difference of large numbers.

    Weights (intervals,) are those of all stretches in a row. R has two more rows than intervals in each
    stretch, K is given by its lower band (6, size).
    """
    parabolas = pieces(DEGREE - ORDER)  # of the third derivative, and the integrals of their products
    products = parabolas.T @ hilbert(ORDER) @ parabolas
    difference = np.diff(np.eye(ORDER + 1), ORDER, axis=0)[0]
    rows = grid.intervals + 2
    band = np.zeros((ORDER, int(rows.sum())))
    at = successive(np.cumsum(rows) - rows, grid.intervals)
    for j in range(ORDER):
        for k in range(j, ORDER):
            band[k - j, at + j] += products[j, k] * weights
    values = np.zeros((band.shape[1], WIDTH))
    for j, factor in enumerate(cholesky_banded(band, lower=True)):
        values[:, j : j + difference.size] += factor[:, None] * difference
    first, normal = successive(grid.first, rows), np.zeros((WIDTH, grid.size + 2))
    for j, k in zip(FIRST, SECOND, strict=True):
        normal[k - j, first + j] += values[:, j] * values[:, k]
    for k in (1, 2):  # entries beyond a stretch are zero
        of = np.cumsum(rows) - ORDER + k
        first[of], values[of] = first[of] - k, np.roll(values[of], k, axis=1)
    return Basis(first, values, grid.size), normal[:, : grid.size]


def successive(first: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """Of each stretch as many successive indices as are counted, all in a row."""
    return np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())


def middles(grid: Knots) -> np.ndarray:
    """(rows,): times [s] of the rows of R, middles of all intervals and of two after each stretch."""
    counts = grid.intervals + 2
    return np.repeat(grid.start, counts) + (successive(0 * counts, counts) + 0.5) * grid.spacing


def third(grid: Knots, coefficients: np.ndarray) -> np.ndarray:
    """(intervals, channels): third derivative in the middle of each interval."""
    middle = 0.5 ** np.arange(ORDER) @ pieces(DEGREE, ORDER) / grid.spacing**ORDER
    at = successive(grid.first, grid.intervals)
    return Basis(at, np.tile(middle, (at.size, 1)), grid.size)(coefficients)


def inverse_band(factors: np.ndarray) -> np.ndarray:
    """The part of the inverse of S = L L^T that lies in its band (Takahashi et al. 1973).

    The recursion runs backwards and forgets its start (:data:`MEMORY`), so that it runs in many parts at
    once. Factors are lower bands of L, (channels, 6, size), the inverses (6, size, channels).
    """
    channels, _, size = factors.shape
    parts = -(-size // MEMORY) + 1
    padded = np.zeros((channels, WIDTH, parts * MEMORY))
    padded[:, 0] = 1.0
    padded[..., :size] = factors
    # Blocks of five coefficients: (blocks, channels, parts, six, five).
    blocks = padded.reshape(channels, WIDTH, parts, -1, DEGREE).transpose(3, 0, 2, 1, 4)
    corner = np.zeros((*blocks.shape[:3], DEGREE, DEGREE))  # of L, in a block
    below = np.zeros_like(corner)  # of L, under it
    for j in range(DEGREE):
        corner[..., j:, j] = blocks[..., : DEGREE - j, j]
        below[..., : j + 1, j] = blocks[..., DEGREE - j :, j]
    back = np.linalg.inv(corner)
    own, turn = back.swapaxes(-1, -2) @ back, -below @ back
    diagonal, beside = np.zeros_like(own), np.zeros_like(own)
    later = np.zeros_like(own[0])
    for _ in range(2):  # once to forget the start
        later = np.concatenate([later[:, 1:], 0.0 * later[:, :1]], axis=1)
        for k in range(len(own) - 1, -1, -1):
            beside[k] = later @ turn[k]
            diagonal[k] = later = own[k] + turn[k].swapaxes(-1, -2) @ beside[k]
    both = np.concatenate([diagonal, beside], axis=-2)
    found = np.array([[both[..., i + j, j] for j in range(DEGREE)] for i in range(WIDTH)])
    return found.transpose(0, 3, 4, 2, 1).reshape(WIDTH, channels, -1)[..., :size].swapaxes(1, 2)


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

        A sum is a linear function a of the coefficients, whose covariance is A^-1 = (L L^T)^-1
        (:mod:`.penalised`): its variance is |L^-1 a|^2. Wherever samples are missing, that is the
        variance of what the jerk may have done meanwhile.

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
