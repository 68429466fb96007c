"""Penalised least squares for one channel of a run, to rounding.

A channel of the pose, z = B c + noise of standard deviation sigma, is fitted by

    c(s) = argmin  sum_i w_i (z_i - (B c)_i)^2 + s c^T K c,        A(s) = B^T W B + s K,

the mean of a process whose jerk is white, of density sigma^2 / (s h^5) (Kimeldorf and Wahba 1970). All
sums of squares are those of residuals, and each solution is refined once, so that neither rounding in
B^T B nor an origin far away shows (corrected seminormal equations, Bjorck 1987).
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded, get_lapack_funcs
from scipy.sparse import csr_array, vstack

from .spline import DEGREE, POINTS, WIDTH, Basis, Knots, gram, penalty

NUDGE = 1e-30  # relative step of the complex-step derivative: its square is far below rounding
GBTRF: Any = get_lapack_funcs("gbtrf", dtype=complex)  # LU factors of a banded matrix


class Rates(NamedTuple):
    """Measured derivatives of the channels, beside the pose.

    Attributes:
        z: (m, 3), measurements [m/s, m/s, rad/s].
        b: first derivative of the spline's basis at them.
        sigma: (3,), standard deviation of their noise; infinite where a channel has none.
    """

    z: np.ndarray
    b: Basis
    sigma: np.ndarray


class Problem(NamedTuple):
    """Measurements of one run, and the spline that is to follow them.

    Attributes:
        rows: (n,), indices of the measurements among the rows of the run.
        z: (n, 3), measurements about their median [m, m, rad].
        b: the spline's basis at them.
        grid: its knots.
        rough: (3 intervals, size), R of the penalty K = R^T V R, see :func:`.spline.roughness`.
        stiffness: (3, intervals), weight V of each interval in the penalty of each channel.
        sigma: (3,), standard deviation of the noise [m, m, rad].
        average: intervals over which the squared jerk is averaged, where the penalty is adapted to it.
        rates: measured derivatives, which count as further rows of z = B c; None: there are none.
    """

    rows: np.ndarray
    z: np.ndarray
    b: Basis
    grid: Knots
    rough: csr_array
    stiffness: np.ndarray
    sigma: np.ndarray
    average: int
    rates: Rates | None = None

    def right(self, channel: int) -> np.ndarray:
        """(n + m, 1): what the spline of a channel is to follow, all with the noise of the pose."""
        if self.rates is None:
            return self.z[:, [channel]]
        return np.vstack([self.z[:, [channel]], self.share(channel) * self.rates.z[:, [channel]]])

    def share(self, channel: int) -> float:
        """Noise of a channel of the pose over that of its derivative [s]; zero where there is none."""
        assert self.rates is not None
        return float(self.sigma[channel] / self.rates.sigma[channel])


class Weighted:
    """What the equations of the three channels share: the basis with weights.

    Args:
        p: problem.
        weights: (n,), of the samples.
    """

    def __init__(self, p: Problem, weights: np.ndarray) -> None:
        self.problem = p
        self.root = np.sqrt(weights)[:, None]
        self.basis = _scaled(p.b.matrix, self.root)
        self.transposed = self.basis.T.tocsr()
        self.normal = gram(p.b, weights, p.grid.size)
        if p.rates is not None:
            self.rates = gram(p.rates.b, np.ones(len(p.rates.z)), p.grid.size)


class Equations:
    """The weighted penalised least squares of one channel, for any smoothness.

    Args:
        w: problem and weights.
        channel: 0 to 2.
    """

    def __init__(self, w: Weighted, channel: int) -> None:
        p, stiffness = w.problem, w.problem.stiffness[channel]
        self.root, self.basis, self.normal, transposed = w.root, w.basis, w.normal, w.transposed
        if p.rates is not None:
            share = p.share(channel)
            self.root = np.vstack([w.root, np.ones((len(p.rates.z), 1))])
            self.basis = csr_array(vstack([w.basis, share * p.rates.b.matrix]))
            self.normal, transposed = w.normal + share**2 * w.rates, self.basis.T.tocsr()
        self.rough = _scaled(p.rough, np.repeat(np.sqrt(stiffness), POINTS)[:, None])
        self.penalty = penalty(p.grid, stiffness)
        self.transposed = transposed, self.rough.T.tocsr()


def _scaled(matrix: csr_array, factors: np.ndarray) -> csr_array:
    """Rows, each of WIDTH numbers, times factors (rows, 1)."""
    data = (matrix.data.reshape(-1, WIDTH) * factors).ravel()
    return csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)


class System:
    """The equations at one smoothness s: A = B^T W B + s K, factored.

    Args:
        equations: of the channel.
        smoothness: s.

    Raises:
        LinAlgError: A is not positive definite to rounding.
    """

    def __init__(self, equations: Equations, smoothness: float) -> None:
        self.equations, self.smoothness = equations, smoothness
        self.factor = cholesky_banded(equations.normal + smoothness * equations.penalty, lower=True)

    def solve(self, z: np.ndarray) -> np.ndarray:
        """Coefficients (size, k) of the splines for data (n, k), by corrected seminormal equations."""
        if not np.isfinite(z).all():
            raise LinAlgError("the motion is not finite")
        basis, rough = self.equations.transposed
        c = cho_solve_banded((self.factor, True), basis @ (self.equations.root * z))
        off, r = self.residual(z, c)
        return c + cho_solve_banded(
            (self.factor, True), basis @ off + self.smoothness**0.5 * (rough @ r)
        )

    def residual(self, z: np.ndarray, c: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """sqrt(W) (z - B c) and -sqrt(s V) R c: the sum of their squares is what c minimises."""
        e = self.equations
        return e.root * z - e.basis @ c, -(self.smoothness**0.5) * (e.rough @ c)

    @cached_property
    def log_determinant(self) -> float:
        """log |A|."""
        return 2.0 * float(np.log(self.factor[0]).sum())

    @cached_property
    def trace(self) -> float:
        """s tr(A^-1 K) = d log |A| / d log s, by a complex step (Squire and Trapp 1998).

        It is the imaginary part of log |A + i s K|: exact to rounding, in the time of one factorisation.
        """
        e = self.equations
        lower = e.normal + (1.0 + 1j * NUDGE) * self.smoothness * e.penalty
        size = lower.shape[1]
        band = np.zeros((3 * DEGREE + 1, size), complex, order="F")  # as LAPACK's gbtrf wants it
        for k in range(WIDTH):
            band[2 * DEGREE + k, : size - k] = lower[k, : size - k]
            band[2 * DEGREE - k, k:] = lower[k, : size - k]
        pivots = GBTRF(band, DEGREE, DEGREE, overwrite_ab=True)[0][2 * DEGREE]
        return float((pivots.imag / pivots.real).sum()) / NUDGE


class Fit(NamedTuple):
    """The smoothing splines of the three channels.

    Attributes:
        coefficients: (size, 3).
        systems: of each channel, by which they were found.
    """

    coefficients: np.ndarray
    systems: tuple[System, System, System]

    @property
    def factors(self) -> np.ndarray:
        """(3, 6, size), lower bands of the Cholesky factors of A."""
        return np.array([system.factor for system in self.systems])


def solve(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> Fit:
    """The smoothing spline of each channel, for weights (n,) of the samples."""
    shared = Weighted(p, weights)
    a, b, c = (System(Equations(shared, k), float(smoothness[k])) for k in range(3))
    parts = [system.solve(p.right(k)) for k, system in enumerate((a, b, c))]
    return Fit(np.hstack(parts), (a, b, c))
