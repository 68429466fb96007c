"""Outliers of a run: Huber's robust weights, then a test of each sample by its deleted residual."""

from typing import NamedTuple

import numpy as np

from ..cleaning import Z95
from ..run_constants import CHANCE, FAR, STEPS
from .likelihood import adapt, likeliest, with_noise
from .penalised import Fit, Problem, solve
from .spline import DEGREE, WIDTH

# 1, most rounds of reweighting, and of each test; two or three are the rule, but a run of the real ship
# takes more than six.
REWEIGHTINGS = 10
OUTLIER = 5.0  # 1, standard deviations: one in 1.7 million samples of normal noise is refused


class TooFewError(Exception):
    """In some stretch hardly any sample agrees with the others; its rows in the run."""

    def __init__(self, rows: np.ndarray) -> None:
        self.rows = rows


class Inliers(NamedTuple):
    """Which samples are no outliers, and the splines through them.

    Attributes:
        problem: with the likeliest noise, and its penalty adapted to the jerk.
        smoothness: (3,), of its splines.
        weights: (n, 3), 0 for an outlier, else 1.
        even: (3,), smoothness with an even penalty.
    """

    problem: Problem
    smoothness: np.ndarray
    weights: np.ndarray
    even: np.ndarray


def robust(p: Problem, local: np.ndarray, least: np.ndarray, resolved: bool) -> Inliers:
    """Which samples are no outliers, their noise, and the smoothness of the spline through them.

    The problem has an even penalty. With a local smoothness its spline follows a few samples, and
    outliers stick out; most samples do not, or its time constant is halved.

    Args:
        p: with a first guess of the noise.
        local: (3,), smoothness to begin with.
        least: (3,), see :func:`.likelihood.with_noise`.
        resolved: whether the ship's quickest motion takes several samples: what sticks out is none.

    Raises:
        TooFewError: in some stretch.
    """
    weights, halvings = robust_weights(p, local), 0
    while (slow := _mostly_outside(p, weights)).any() and halvings < STEPS:
        local, halvings = np.where(slow, local / 2.0**DEGREE, local), halvings + 1
        weights = robust_weights(p, local)
    weights, rounds = (outlier_test(p, local, weights) if resolved else weights), 0
    while True:
        p, even = with_noise(p, likeliest(p, weights), weights, least)
        adapted, smoothness = adapt(p, even, weights)
        before, weights = weights, outlier_test(adapted, smoothness, weights)
        rounds += 1
        if np.mean(weights != before) < CHANCE or rounds == REWEIGHTINGS:
            return Inliers(adapted, smoothness, weights, even)


def _mostly_outside(p: Problem, weights: np.ndarray) -> np.ndarray:
    """(3,), whether most samples of a channel are far from a spline that gives them weights (n, 3)."""
    outside = (weights < Z95 / OUTLIER) & (p.share > 0.0)
    return 2 * np.count_nonzero(outside, axis=0) > np.count_nonzero(p.share, axis=0)


def robust_weights(p: Problem, smoothness: np.ndarray) -> np.ndarray:
    """Weights (n, 3) by iterative reweighting of Huber's M-estimator (1964): 1, and Z95 / |r| far off.

    It ends when the same samples are far off, as the outlier test follows.
    """
    given = np.where(p.share > 0.0, np.abs(p.z), np.nan)
    far = FAR * np.maximum(np.nanquantile(given, 0.9, axis=0), p.sigma)
    weights, same = far / np.maximum(np.abs(p.z), far), np.zeros(0)
    for _ in range(REWEIGHTINGS):
        off = _deviations(p, solve(p, smoothness, weights))
        weights = Z95 / np.maximum(off, Z95)
        before, same = same, np.flatnonzero(off > OUTLIER)
        if np.array_equal(before, same):
            break
    return _of_receivers(weights)


def outlier_test(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """1 for each sample that agrees with all the others, 0 for an outlier, (n, 3).

    A sample that had a weight is compared with the fit without it: its deleted residual and the variance
    of that follow from the fit with it and its leverage. North and east are one sample.

    Raises:
        TooFewError: in some stretch.
    """
    b = p.spline.b
    stretch = np.searchsorted(p.spline.grid.first, b.first, side="right") - 1
    for _ in range(REWEIGHTINGS):
        fit = solve(p, smoothness, weights)
        # Rounding may leave a variance below zero, and a noise that is far smaller makes that large.
        spread = np.maximum(p.share * b.variance(fit.covariance), 0.0) / p.sigma**2
        off = _deviations(p, fit)
        leverage = np.minimum(weights * spread, 0.999)
        expected = np.where(leverage > 0.0, np.sqrt(1.0 - leverage), np.sqrt(1.0 + spread))
        kept = _of_receivers((off <= OUTLIER * expected).astype(float))
        if np.array_equal(kept, weights):
            break
        agree = np.array([np.bincount(stretch, seen) for seen in (kept * (p.share > 0.0)).T])
        few = np.any(agree < WIDTH, axis=0)  # a spline of degree 5 follows any six
        if few.any():
            raise TooFewError(p.rows[few[stretch]])
        weights = kept
    return weights


def _deviations(p: Problem, fit: Fit) -> np.ndarray:
    """(n, 3), how far samples are from a fit, in their standard deviations."""
    return np.sqrt(p.share) * np.abs(p.z - p.spline.b(fit.coefficients)) / p.sigma


def _of_receivers(weights: np.ndarray) -> np.ndarray:
    """Weights (n, 3) of which north and east, from one receiver, share the smaller one."""
    position = weights[:, :2].min(axis=1)
    return np.column_stack([position, position, weights[:, 2]])
