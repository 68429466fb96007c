"""The smoothness of a spline by restricted maximum likelihood (REML), its penalty adapted to the jerk.

The smoothness s of :mod:`.penalised` has the largest restricted likelihood (Wecker and Ansley 1983,
Wahba 1985),

    -2 log L(s) = log |A| - rank(K) log s + min_c (sum_i w_i (z_i - (B c)_i)^2 + s c^T K c) / sigma^2.

As the minimum over c does not move to first order, its derivative is

    d(-2 log L) / d(log s) = s tr(A^-1 K) - rank(K) + s c^T K c / sigma^2.

It is zero where the roughness s c^T K c / sigma^2 has its expected value rank(K) - s tr(A^-1 K). The
logarithm of their ratio is nearly linear in log s: its root, the bottom of a valley of -2 log L, takes
four evaluations from a start nearby. A secant leads from there; its error is a product of theirs.

How well the noise is known follows from it, too: with h the eigenvalues of the hat matrix, the
information on the logarithms of the noise's variance and of the jerk's density is, without the
parabolas that cost nothing,

    1/2 [[sum (1 - h)^2, sum h (1 - h)], [sum h (1 - h), sum h^2]],
    sum h (1 - h) = -d sum h / d log s:

where samples are so rare that the spline goes through all of them, a residual is none of noise. A noise
is constant; where residuals are larger in some parts of a run than in others by more than chance, they
are of motions that the samples are too rare to follow. The noise is as uncertain as they differ, and the
estimate is an upper bound.
"""

from functools import cache
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError
from scipy.optimize import brentq
from scipy.special import chdtrc

from ..run_constants import CHANCE, DIGITS, ORDER
from .penalised import JERK, POSE, Equations, Fit, LinearSystem, Problem, solve
from .spline import third

# 1, of adapting the penalty to the jerk; a third changes less than noise (chosen).
ROUNDS = 2
LEAST_JERK = 0.2  # 1, of the mean square: where there is none, it may yet begin (chosen)
# 1, decades of the smoothness, to both sides of 1: from none at all to motions slower than 7 s at knots
# of 0.05 s.
DECADES = 8.0
STEP = 0.05  # 1, of log s, for the derivative (chosen: its error is a thousandth)


def likeliest(p: Problem, weights: np.ndarray, near: np.ndarray | None = None) -> np.ndarray:
    """The smoothness (3,) with the largest restricted likelihood, for weights (n, 3) of the samples.

    The search begins near a smoothness (3,), 1 by default.
    """
    starts = np.zeros(3) if near is None else np.log10(near)
    found = [c.minimum(x) for c, x in zip(criteria(p, weights), starts.tolist(), strict=True)]
    return 10.0 ** np.array(found)


def deviance(p: Problem, weights: np.ndarray, smoothness: np.ndarray) -> float:
    """-2 log L at a smoothness (3,), the sum of all channels."""
    decades = np.log10(smoothness).tolist()
    return sum(c.cost(at) for c, at in zip(criteria(p, weights), decades, strict=True))


def criteria(p: Problem, weights: np.ndarray) -> list["Likelihood"]:
    """-2 log L of each channel, for weights (n, 3) of the samples."""
    return [Likelihood(p, k, e) for k, e in enumerate(p.equations(weights))]


class Likelihood:
    """-2 log L of one channel over its smoothness, in decades."""

    def __init__(self, p: Problem, channel: int, equations: Equations) -> None:
        self._problem, self._channel, self._equations = p, channel, equations
        self._y = p.data(channel, p.z[:, [channel]])

    def _solved(self, decades: float) -> tuple[LinearSystem, np.ndarray]:
        """The system, and its residuals (rows, 1)."""
        system = LinearSystem(self._equations, self._problem.precision(self._channel, 10.0**decades))
        return system, system.residual(self._y, system.solve(self._y))

    def cost(self, decades: float) -> float:
        """-2 log L."""
        system, off = self._solved(decades)
        return system.deviance(off)

    def excess(self, decades: float) -> float:
        """Logarithm of the roughness over its expected value; of the sign of d(-2 log L) / d(log s).

        Raises:
            LinAlgError: the spline is not determined.
        """
        system, off = self._solved(decades)
        e = self._equations
        found = float(np.sum(off[e.group == JERK] ** 2))
        expected = float(e.counts[JERK]) - system.trace(JERK)
        if not (np.isfinite(found) and expected > 0.0):
            raise LinAlgError("the likelihood of its smoothness is not finite")
        return float(np.log(max(found, np.finfo(float).tiny) / expected))

    def variance(self, decades: float) -> float:
        """Likeliest variance of the noise, in units of the present one, all else given.

        The sum of squares over the degrees of freedom that the spline leaves: d(-2 log L) / d sigma is
        zero there.
        """
        system, off = self._solved(decades)
        e = self._equations
        freedom = max(float(e.counts[POSE]) - system.trace(POSE), 1.0)
        return float(np.sum(off[e.group == POSE] ** 2)) / freedom

    def minimum(self, near: float) -> float:
        """Where it is least [decades]; searched downhill from nearby.

        For white jerk the logarithm grows by 1.9 in a decade: a step as long as it leads past the root.
        """
        known: dict[float, float] = {}

        @cache
        def excess(at: float) -> float:
            """Zero where a secant leads from here to the root."""
            value, closest = self.excess(at), min(map(abs, known.values()), default=1.0)
            known[at] = value
            return 0.0 if abs(value) * closest < DIGITS else value

        before, step = near, float(np.clip(-excess(near), -1.0, 1.0))
        while step:
            try:
                beyond = float(np.clip(before + step, -DECADES, DECADES))
                if excess(beyond) * step >= 0.0:
                    low, high = sorted((before, beyond))
                    root: Any = brentq(excess, low, high, xtol=DIGITS)
                    if excess(root):
                        return float(root)
                    (a, there), (b, here) = sorted(known.items(), key=lambda point: abs(point[1]))[:2]
                    return a - there * (b - a) / (here - there)
            except LinAlgError:  # so little smoothing that the spline is not determined
                break
            if abs(beyond) == DECADES:
                return beyond
            before, step = beyond, 2.0 * step
        return before


def adapt(p: Problem, smoothness: np.ndarray, weights: np.ndarray) -> tuple[Problem, np.ndarray]:
    """A problem with its penalty adapted to the jerk, and the likeliest smoothness (3,) then.

    The weight of each interval is the inverse of the local mean square of the jerk that a fit has, which
    begins with an even penalty and its likeliest smoothness. Samples have weights (n, 3).
    """
    for _ in range(ROUNDS):
        square = third(p.spline.grid, solve(p, smoothness, weights).coefficients) ** 2
        mean = np.maximum(square.mean(axis=0), np.finfo(float).tiny)
        local = running_mean(square, p.average)
        share = (local / mean + LEAST_JERK) / (1.0 + LEAST_JERK)
        p = p.adapted(stiffness=1.0 / share.T)
        smoothness = likeliest(p, weights, smoothness)
    return p, smoothness


def with_noise(
    p: Problem, smoothness: np.ndarray, weights: np.ndarray, least: np.ndarray
) -> tuple[Problem, np.ndarray]:
    """A problem with the likeliest noise, and its smoothness (3,) then; both in turn.

    Args:
        p: the problem, with a first guess.
        smoothness: (3,), the likeliest with that.
        weights: (n, 3), of the samples.
        least: (3,), the noise is no smaller [m, m, rad]; infinite where it is given.
    """
    for _ in range(ROUNDS):
        decades = np.log10(smoothness).tolist()
        ratio = [c.variance(x) for c, x in zip(criteria(p, weights), decades, strict=True)]
        sigma = np.where(np.isinf(least), p.sigma, np.maximum(p.sigma * np.sqrt(ratio), least))
        smoothness = smoothness * (sigma / p.sigma) ** 2
        p = p._replace(sigma=sigma)
        smoothness = likeliest(p, weights, smoothness)
    return p, smoothness


def running_mean(x: np.ndarray, width: int) -> np.ndarray:
    """Means of x (n, 3) over ``width`` rows around each; the ends go on."""
    before = width // 2
    longer = np.pad(x, ((before, width - 1 - before), (0, 0)), mode="edge")
    steps = (longer[width:] - longer[:-width]) / width
    return np.cumsum(np.vstack([longer[:width].mean(axis=0), steps]), axis=0)


def noise_uncertainty(
    p: Problem, smoothness: np.ndarray, weights: np.ndarray, fit: Fit
) -> tuple[np.ndarray, np.ndarray]:
    """How well the estimated noise of a run is known.

    Args:
        p: the problem, its noise estimated.
        smoothness: (3,).
        weights: (n, 3), of the samples.
        fit: of these.

    Returns:
        (3,), its relative standard deviation, infinite where the samples say nothing of the noise; and
        (3,), whether it is an upper bound, as the residuals are not of a constant noise.
    """
    leverage = p.share * weights * p.spline.b.variance(fit.covariance) / p.sigma**2
    off = p.share * weights * (p.z - p.spline.b(fit.coefficients)) ** 2 / p.sigma**2
    # Of as many intervals as the jerk is averaged over, when the penalty is adapted to it.
    part = p.spline.b.first // p.average
    rel_std, at_most = np.full(3, np.inf), np.zeros(3, bool)
    for k, e in enumerate(p.equations(weights)):
        low, high = (
            LinearSystem(e, p.precision(k, float(smoothness[k] * np.exp(step)))).trace(POSE)
            for step in (-STEP, STEP)
        )
        followed, mixed = 0.5 * (low + high), (low - high) / (2.0 * STEP)
        of_noise = float(e.counts[POSE]) - followed - mixed
        of_jerk = followed - ORDER * p.spline.grid.start.size - mixed
        information = 0.5 * (of_noise - mixed**2 / of_jerk) if of_jerk > 0.0 else 0.0
        free = np.bincount(part, (p.share[:, k] > 0.0) * weights[:, k] - leverage[:, k])
        counted = free > 1.0
        if not (information > 0.0 and counted.any()):
            continue
        free, squares = free[counted], np.bincount(part, off[:, k])[counted]
        by_part = float(np.average((squares / free - 1.0) ** 2 - 2.0 / free, weights=free))
        rel_std[k] = 0.5 * np.sqrt(1.0 / information + max(by_part, 0.0))  # of sigma
        at_most[k] = equal_variances(squares, free, excess_kurtosis(off[:, k], part)) < CHANCE / 3.0
    return rel_std, at_most


def excess_kurtosis(squares: np.ndarray, part: np.ndarray) -> float:
    """Of residuals with squares (n,), each over the mean of its part (n,); not below zero.

    The mean of k normal residuals takes 2 / (k + 2) of their kurtosis away, which is added.
    """
    there = squares > 0.0
    counts, sums = np.bincount(part, there)[part[there]], np.bincount(part, squares)[part[there]]
    ratio = (squares[there] * counts / sums) ** 2 * (1.0 + 2.0 / counts)
    return max(float(np.mean(ratio)) - 3.0, 0.0) if ratio.size else 0.0


def equal_variances(squares: np.ndarray, free: np.ndarray, kurtosis: float = 0.0) -> float:
    """Chance of sums of squares (k,) with some degrees of freedom (k,), if all have one variance.

    It is Bartlett's test (1937), the likelihood ratio with a correction for few degrees of freedom, and
    with that of Box (1953) for an excess kurtosis.
    """
    if squares.size < 2:
        return 1.0
    whole, least = float(free.sum()), np.finfo(float).tiny
    ratio = whole * np.log(max(float(squares.sum()), least) / whole) - float(
        np.sum(free * np.log(np.maximum(squares, least) / free))
    )
    more = squares.size - 1
    correction = 1.0 + (float(np.sum(1.0 / free)) - 1.0 / whole) / (3.0 * more)
    return float(chdtrc(more, ratio / correction / (1.0 + 0.5 * kurtosis)))
