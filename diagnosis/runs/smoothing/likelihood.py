"""The smoothness of a spline by restricted maximum likelihood (REML), its penalty adapted to the jerk.

The smoothness s of :mod:`.penalised` has the largest restricted likelihood (Wecker and Ansley 1983,
Wahba 1985),

    -2 log L(s) = log |A| - rank(K) log s + min_c (sum_i w_i (z_i - (B c)_i)^2 + s c^T K c) / sigma^2.

As the minimum over c does not move to first order, its derivative is

    d(-2 log L) / d(log s) = s tr(A^-1 K) - rank(K) + s c^T K c / sigma^2.

A coarse minimisation finds the valley, and the root of this derivative its bottom, to rounding.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.ndimage import uniform_filter1d
from scipy.optimize import brentq, minimize_scalar, root_scalar

from .penalised import Equations, Problem, System, Weighted, solve
from .spline import third

ADAPTIONS = 2  # rounds of adapting the penalty; a third changes less than the noise does (chosen)
LEAST_JERK = 0.2  # of the mean square: where there is none, it may yet begin (chosen)
DECADES = (
    -8.0,
    8.0,
)  # of the smoothness: from none at all to motions slower than 7 s at knots of 0.05 s
COARSE = 0.1  # decades, of the search for the valley; its bottom is a root
# Decades, of the secant method's last step: it converges with order 1.6, and stands at rounding then.
LAST_STEP = 1e-7


def likeliest(p: Problem, weights: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """The smoothness (3,) with the largest restricted likelihood.

    Args:
        p: problem.
        weights: (n,), of the samples.
        near: (3,), smoothness to begin the search with; None: everywhere.
    """
    starts = (None, None, None) if near is None else np.log10(near).tolist()
    shared = Weighted(p, weights)
    return 10.0 ** np.array([Criterion(shared, k).minimum(starts[k]) for k in range(3)])


def deviance(p: Problem, weights: np.ndarray, smoothness: np.ndarray) -> float:
    """-2 log L at a smoothness (3,), the sum of all channels."""
    shared = Weighted(p, weights)
    return sum(Criterion(shared, k).cost(float(np.log10(smoothness[k]))) for k in range(3))


class Criterion:
    """-2 log L of one channel over its smoothness, in decades.

    Args:
        w: problem and weights.
        channel: 0 to 2.
    """

    def __init__(self, w: Weighted, channel: int) -> None:
        p = w.problem
        self._equations, self._rank = Equations(w, channel), p.grid.rank
        self._z, self._variance = p.right(channel), p.sigma[channel] ** 2

    def _parts(self, decades: float) -> tuple[System, float, float]:
        """The system, and the sums of squares of residuals and roughness in units of the noise."""
        system = System(self._equations, 10.0**decades)
        off, rough = system.residual(self._z, system.solve(self._z))
        return system, float(np.sum(off**2)) / self._variance, float(np.sum(rough**2)) / self._variance

    def cost(self, decades: float) -> float:
        """-2 log L, infinite where the spline is not determined."""
        try:
            system, off, rough = self._parts(decades)
        except LinAlgError:
            return np.inf
        return system.log_determinant - self._rank * np.log(system.smoothness) + off + rough

    def slope(self, decades: float) -> float:
        """d(-2 log L) / d(log s), with the natural logarithm.

        Raises:
            LinAlgError: the spline is not determined.
        """
        system, _, rough = self._parts(decades)
        found = system.trace - self._rank + rough
        if not np.isfinite(found):
            raise LinAlgError("the likelihood of its smoothness is not finite")
        return found

    def minimum(self, near: float | None) -> float:
        """Where it is least [decades]; searched from nearby or, with None, everywhere."""
        if near is None:
            search = {"bounds": DECADES, "method": "bounded", "options": {"xatol": COARSE}}
            found: Any = minimize_scalar(self.cost, **search)
            near = float(found.x)
        return _bottom(cache(self.slope), near)


def _bottom(slope: Callable[[float], float], near: float) -> float:
    """Where a slope goes from negative to positive, searched downhill from nearby, or the bound."""
    ahead = 1.0 if slope(near) < 0.0 else -1.0
    before, step = near, COARSE
    while True:
        try:
            beyond = min(max(before + ahead * step, DECADES[0]), DECADES[1])
            passed = slope(beyond) * ahead >= 0.0
        except LinAlgError:  # so little smoothing that the spline is not determined
            return before
        if passed:
            break
        if beyond in DECADES:
            return beyond
        before, step = beyond, 2.0 * step
    found: Any = root_scalar(slope, x0=before, x1=beyond, method="secant", xtol=LAST_STEP)
    if found.converged and min(before, beyond) <= found.root <= max(before, beyond):
        return float(found.root)
    between: Any = brentq(slope, before, beyond, xtol=LAST_STEP**1.5)
    return float(between)


def adapt(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> tuple[Problem, np.ndarray]:
    """A problem with its penalty adapted to the jerk, and the likeliest smoothness (3,) then.

    Args:
        p: problem with an even penalty.
        smoothness: (3,), its likeliest.
        weights: (n,), of the samples.
    """
    for _ in range(ADAPTIONS):
        p = adapted(p, smoothness, weights)
        smoothness = likeliest(p, weights, smoothness)
    return p, smoothness


def adapted(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> Problem:
    """The problem with a penalty by the inverse of the local mean square of the jerk that a fit has."""
    square = third(p.grid, solve(p, smoothness, weights).coefficients) ** 2
    mean = np.maximum(square.mean(axis=0), 1e-30)
    local = uniform_filter1d(square, p.average, axis=0, mode="nearest")
    share = (local / mean + LEAST_JERK) / (1.0 + LEAST_JERK)
    return p._replace(stiffness=1.0 / share.T)
