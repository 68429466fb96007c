"""Fits smoothing splines to the three channels of a run, and finds the samples that do not belong."""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize_scalar

from .spline import Basis, Knots, gram, inverse_band, penalty, third, variance

GATE = 5.0  # standard deviations
HUBER = 2.0  # standard deviations from which on a sample pulls no harder
FAR = 10.0  # times what nearly all measurements reach; beyond, one would drag all the others along
ROUNDS = 10
SAME = 0.02  # difference of weights that makes none
LEAST = 6  # samples that must agree in a stretch
ADAPTIONS = 2
AROUND = 8.0  # s over which the jerk is averaged
CALM = 0.2  # of the mean jerk: so much there is at least
SURE = 0.002  # of a smoothness, in decades: what is less would show in the velocity


class TooFewError(Exception):
    """In some stretch hardly any sample agrees with the others.

    Args:
        rows: of the run, all samples of that stretch.
    """

    def __init__(self, rows: np.ndarray) -> None:
        self.rows = rows


class Problem(NamedTuple):
    """Measurements of one run, and the spline that is to follow them.

    Attributes:
        rows: (n,), which rows of the run they are.
        z: (n, 3), measurements, about their median.
        b: the spline's basis at them.
        grid: its knots.
        stiff: (3, 6, size), penalty K of each channel.
        sigma: (3,), standard deviation of the noise.
    """

    rows: np.ndarray
    z: np.ndarray
    b: Basis
    grid: Knots
    stiff: np.ndarray
    sigma: np.ndarray


class Fit(NamedTuple):
    """Coefficients (size, 3); lower bands (3, 6, size) of the Cholesky factors of B^T W B + lambda K."""

    coefficients: np.ndarray
    factors: np.ndarray


def trusted(p: Problem, local: np.ndarray) -> tuple[Problem, np.ndarray, np.ndarray]:
    """The samples to trust, and how smooth the spline through them is most likely.

    Args:
        p: problem with an even penalty.
        local: (3,), smoothness that follows a few samples, to find what sticks out.

    Returns:
        The problem with its penalty adapted to the jerk, smoothness (3,), weights (n,) of 0 and 1.

    Raises:
        TooFewError: in some stretch.
    """
    weights = gate(p, local, huber(p, local))
    p, smoothness = tuned(p, likeliest(p, weights)[0], weights)
    return p, smoothness, gate(p, smoothness, weights)


def tuned(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> tuple[Problem, np.ndarray]:
    """A problem with its penalty adapted to the jerk, and the likeliest smoothness (3,) then.

    Args:
        p: problem with an even penalty.
        smoothness: (3,), its likeliest.
        weights: (n,), of the samples.
    """
    for _ in range(ADAPTIONS):
        p = adapted(p, smoothness, weights)
        smoothness, _ = likeliest(p, weights)
    return p, smoothness


def solve(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> Fit:
    """The smoothing spline of each channel, for weights (n,) of the samples."""
    band = gram(p.b, weights, p.grid.size)
    right = p.b.matrix.T @ (weights[:, None] * p.z)
    sums = band + smoothness[:, None, None] * p.stiff
    factors = np.array([cholesky_banded(each, lower=True) for each in sums])
    parts = [cho_solve_banded((factors[c], True), right[:, c]) for c in range(3)]
    return Fit(np.column_stack(parts), factors)


def huber(p: Problem, smoothness: np.ndarray) -> np.ndarray:
    """Weights (n,) by which a sample that is far off pulls no harder than one that is a little off."""
    far = FAR * np.maximum(np.quantile(np.abs(p.z), 0.9, axis=0), p.sigma)
    weights = np.minimum(1.0, (far / np.maximum(np.abs(p.z), far * 1e-9)).min(axis=1))
    for _ in range(ROUNDS):
        off = np.abs(p.z - p.b(solve(p, smoothness, weights).coefficients)) / p.sigma
        before, weights = weights, np.minimum(1.0, HUBER / np.maximum(off.max(axis=1), 1e-9))
        if np.abs(weights - before).max() < SAME:
            break
    return weights


def gate(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """1 for each sample that agrees with all the others, 0 for a spike, (n,).

    A sample that had a weight is held against the fit without it, whose deviation and variance follow
    from the fit with it and its leverage.

    Raises:
        TooFewError: in some stretch.
    """
    stretch = np.searchsorted(p.grid.first, p.b.first, side="right") - 1
    for _ in range(ROUNDS):
        fit = solve(p, smoothness, weights)
        spread = variance(p.b, inverse_band(fit.factors))
        off = np.abs(p.z - p.b(fit.coefficients)) / p.sigma
        own = np.minimum(weights[:, None] * spread, 0.999)
        expected = np.where(own > 0.0, np.sqrt(1.0 - own), np.sqrt(1.0 + spread))
        kept = (off <= GATE * expected).all(axis=1).astype(float)
        if (kept == weights).all():
            break
        few = np.bincount(stretch, kept) < LEAST
        if few.any():
            raise TooFewError(p.rows[few[stretch]])
        weights = kept
    return weights


def likeliest(p: Problem, weights: np.ndarray) -> tuple[np.ndarray, float]:
    """The smoothness (3,) of each channel with the largest likelihood, and minus twice its logarithm."""
    smoothness, costs = zip(*(_likeliest(p, weights, channel) for channel in range(3)), strict=True)
    return np.array(smoothness), float(sum(costs))


def _likeliest(p: Problem, weights: np.ndarray, channel: int) -> tuple[float, float]:
    """The smoothness of one channel with the largest likelihood, and minus twice its logarithm."""
    band = gram(p.b, weights, p.grid.size)
    z = p.z[:, channel : channel + 1]
    right = p.b.matrix.T @ (weights[:, None] * z)

    def cost(log_smoothness: float) -> float:
        s = 10.0**log_smoothness
        try:
            factor = cholesky_banded(band + s * p.stiff[channel], lower=True)
        except LinAlgError:
            return np.inf
        c = cho_solve_banded((factor, True), right)
        off = float(np.sum(weights[:, None] * (z - p.b(c)) * z)) / p.sigma[channel] ** 2
        return 2.0 * float(np.log(factor[0]).sum()) - p.grid.rank * np.log(s) + off

    found: Any = minimize_scalar(cost, bounds=(-8.0, 8.0), method="bounded", options={"xatol": SURE})
    return 10.0 ** float(found.x), float(found.fun)


def adapted(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> Problem:
    """The problem with a penalty that is lower where a fit has more jerk than elsewhere."""
    square = third(p.grid, solve(p, smoothness, weights).coefficients) ** 2
    mean = np.maximum(square.mean(axis=0), 1e-30)
    local = uniform_filter1d(square, max(1, round(AROUND / p.grid.spacing)), axis=0, mode="nearest")
    share = (local / mean + CALM) / (1.0 + CALM)
    return p._replace(stiff=np.array([penalty(p.grid, 1.0 / each) for each in share.T]))
