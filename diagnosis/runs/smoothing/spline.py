"""Quintic splines on evenly spaced knots, in stretches that are independent of each other.

The smoothing spline f that minimises

    sum_i w_i (z_i - f(t_i))^2 + s h^5 int (d3f/dt3)^2 dt

is the mean of a process driven by white jerk, given noisy measurements of it (Kimeldorf and Wahba 1970):
what a Kalman filter and Rauch-Tung-Striebel smoother give, here for all samples at once, at any
sampling, as a banded linear system. With f = B c and knots every h, h^5 times the integral is c^T K c,
K the Gram matrix of the third derivatives in units of h.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, PPoly
from scipy.sparse import csr_array

DEGREE = 5  # of the smoothing spline with a penalty on the third derivative: 2 * 3 - 1
WIDTH = DEGREE + 1  # basis functions that overlap
# Coefficients after which the recursion of the inverse has forgotten its start: its memory falls as
# exp(-n / (2 s^(1/6))), to 5e-5 at the smoothness s = 1e6, to 1e-2 at the largest one, 1e8.
MEMORY = 200
ROUNDING = 1e-6  # of an interval: by so much a stretch may end beyond its last knot


def _pieces() -> np.ndarray:
    """(power, function): the six basis functions on an interval, as polynomials over [0, 1]."""
    spline = PPoly.from_spline(BSpline.basis_element(np.arange(WIDTH + 1.0), extrapolate=False).tck)
    inside = np.searchsorted(spline.x, np.arange(WIDTH)[::-1])
    return spline.c[::-1, inside]


PIECES = [_pieces()]
for _ in range(3):
    PIECES.append(np.arange(1.0, len(PIECES[-1]))[:, None] * PIECES[-1][1:])


POINTS = 3  # per interval: with them Gauss' rule is exact for the square of a parabola


def _third_at_points() -> np.ndarray:
    """(3, 6): third derivatives at Gauss' points of [0, 1], times the square roots of their weights."""
    points, weights = np.polynomial.legendre.leggauss(POINTS)
    third = np.vander(0.5 * points + 0.5, WIDTH - 3, increasing=True) @ PIECES[3]
    return np.sqrt(0.5 * weights)[:, None] * third


THIRD = _third_at_points()
PENALTY = THIRD.T @ THIRD  # (6, 6): integral of the products of third derivatives over [0, 1]


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
        return self.size - 3 * self.start.size


def knots(start: np.ndarray, end: np.ndarray, spacing: float) -> Knots:
    """Knots for stretches from ``start`` to ``end`` [s], no closer than ``spacing`` [s]."""
    intervals = np.maximum(1, np.ceil((end - start) / spacing - ROUNDING)).astype(int)
    first = np.concatenate([[0], np.cumsum(intervals + DEGREE)[:-1]])
    return Knots(start, end, first, intervals, spacing)


class Basis(NamedTuple):
    """The six basis functions that are not zero at each of some times.

    Attributes:
        first: (n,), index of the first.
        values: (n, 6), their values.
        matrix: (n, size), the same as a sparse matrix.
    """

    first: np.ndarray
    values: np.ndarray
    matrix: csr_array

    def __call__(self, coefficients: np.ndarray) -> np.ndarray:
        """(n, channels): the spline, for coefficients (size, channels)."""
        return self.matrix @ coefficients


def _basis(first: np.ndarray, values: np.ndarray, size: int) -> Basis:
    at, rows = (first[:, None] + np.arange(WIDTH)).ravel(), np.arange(0, values.size + 1, WIDTH)
    return Basis(first, values, csr_array((values.ravel(), at, rows), shape=(first.size, size)))


def basis(grid: Knots, time: np.ndarray, derivative: int = 0) -> Basis:
    """The basis at times [s] that lie in stretches, or one of its derivatives."""
    stretch = np.clip(np.searchsorted(grid.start, time, side="right") - 1, 0, None)
    place = (time - grid.start[stretch]) / grid.spacing
    interval = np.clip(np.floor(place), 0, grid.intervals[stretch] - 1).astype(int)
    powers = np.vander(place - interval, WIDTH - derivative, increasing=True)
    values = powers @ PIECES[derivative] / grid.spacing**derivative
    return _basis(grid.first[stretch] + interval, values, grid.size)


def gram(b: Basis, weights: np.ndarray, size: int) -> np.ndarray:
    """(6, size): lower band of B^T W B, for weights (n,)."""
    band = np.zeros((WIDTH, size))
    for j in range(WIDTH):
        for k in range(j, WIDTH):
            band[k - j] += np.bincount(b.first + j, weights * b.values[:, j] * b.values[:, k], size)
    return band


def penalty(grid: Knots, weights: np.ndarray) -> np.ndarray:
    """(6, size): lower band of the integral of squared third derivatives, times the spacing^5.

    Args:
        grid: knots.
        weights: (intervals,), of each interval, those of all stretches in a row.
    """
    band = np.zeros((WIDTH, grid.size))
    stretches = np.split(weights, np.cumsum(grid.intervals)[:-1])
    for first, of_stretch in zip(grid.first, stretches, strict=True):
        for j in range(WIDTH):
            at = slice(first + j, first + j + of_stretch.size)
            for k in range(j, WIDTH):
                band[k - j, at] += PENALTY[j, k] * of_stretch
    return band


def roughness(grid: Knots) -> csr_array:
    """(3 intervals, size): R with R^T R = K, the penalty of equal weights.

    The integral of squared third derivatives is |R c|^2, a sum of squares that loses no digits, where
    c^T K c is a small difference of large numbers.
    """
    intervals = int(grid.intervals.sum())
    return _basis(np.repeat(inside(grid), POINTS), np.tile(THIRD, (intervals, 1)), grid.size).matrix


def inside(grid: Knots) -> np.ndarray:
    """(intervals,): index of the first basis function of each interval of all stretches."""
    return np.concatenate([f + np.arange(n) for f, n in zip(grid.first, grid.intervals, strict=True)])


def third(grid: Knots, coefficients: np.ndarray) -> np.ndarray:
    """(intervals, channels): third derivative in the middle of each interval."""
    values = np.tile(0.5 ** np.arange(WIDTH - 3) @ PIECES[3], (int(grid.intervals.sum()), 1))
    return _basis(inside(grid), values / grid.spacing**3, grid.size)(coefficients)


def inverse_band(factors: np.ndarray) -> np.ndarray:
    """The part of the inverse of S = L L^T that lies in its band (Takahashi et al. 1973).

    The recursion runs backwards and forgets its start (:data:`MEMORY`), so that it runs in many parts at
    once.

    Args:
        factors: (channels, 6, size), lower bands of L.

    Returns:
        (size, channels, 6): entries (i, i) to (i, i + 5) of each inverse.
    """
    channels, _, size = factors.shape
    parts = -(-size // MEMORY)
    padded = np.zeros((WIDTH, (parts + 1) * MEMORY, channels))
    padded[0] = 1.0
    padded[:, :size] = factors.transpose(1, 2, 0)
    below = (padded[1:] / padded[0]).transpose(1, 2, 0).copy()
    squared = 1.0 / padded[0] ** 2
    at = MEMORY * np.arange(parts)
    found = np.empty((parts, MEMORY, channels, WIDTH))
    known = np.zeros((parts, channels, WIDTH, WIDTH))  # of the six coefficients from i on
    for i in range(2 * MEMORY - 1, -1, -1):
        later = known[..., :DEGREE, :DEGREE].copy()
        under = below[at + i]
        row = -np.matmul(later, under[..., None])[..., 0]
        known[..., 1:, 1:] = later
        known[..., 0, 0] = squared[at + i] - (under * row).sum(axis=-1)
        known[..., 0, 1:] = row
        known[..., 1:, 0] = row
        if i < MEMORY:
            found[:, i] = known[..., 0, :]
    return found.reshape(parts * MEMORY, channels, WIDTH)[:size]


def variance(b: Basis, inverse: np.ndarray) -> np.ndarray:
    """(n, channels): variance of the spline whose coefficients have this covariance."""
    total = np.zeros((b.first.size, inverse.shape[1]))
    for j in range(WIDTH):
        for apart in range(WIDTH - j):
            times = 1.0 if apart == 0 else 2.0
            weight = times * b.values[:, j] * b.values[:, j + apart]
            total += weight[:, None] * inverse[b.first + j, :, apart]
    return total
