"""How well the noise of each channel is known by the samples that it was estimated from.

With h the eigenvalues of the hat matrix of the spline, the information on the logarithms of the noise's
variance and of the jerk's density is (restricted likelihood, without the parabolas that cost nothing)

    1/2 [[sum (1 - h)^2, sum h (1 - h)], [sum h (1 - h), sum h^2]],
    sum h (1 - h) = -d sum h / d log s:

where samples are so rare that the spline goes through all of them, a residual is none of noise. A noise
is constant; where residuals are larger in some parts of a run than in others by more than chance, they
are of motions that the samples are too rare to follow, and the noise is as uncertain as they differ.
"""

import numpy as np

from .penalised import POSE, Fit, LinearSystem, Problem
from .spline import ORDER

STEP = 0.05  # of log s, for the derivative (chosen: its error is a thousandth)


def noise_rel_std(p: Problem, smoothness: np.ndarray, weights: np.ndarray, fit: Fit) -> np.ndarray:
    """(3,), relative standard deviation of the noise; infinite where the samples say nothing of it.

    Args:
        p: the problem, its noise estimated.
        smoothness: (3,).
        weights: (n, 3), of the samples.
        fit: of these.
    """
    leverage = p.share * weights * p.spline.b.variance(fit.covariance) / p.sigma**2
    off = p.share * weights * (p.z - p.spline.b(fit.coefficients)) ** 2 / p.sigma**2
    # Of as many intervals as the jerk is averaged over, when the penalty is adapted to it.
    part = p.spline.b.first // p.average
    found = np.full(3, np.inf)
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
        ratio = np.bincount(part, off[:, k])[counted] / free[counted]
        by_part = float(np.average((ratio - 1.0) ** 2 - 2.0 / free[counted], weights=free[counted]))
        found[k] = 0.5 * np.sqrt(1.0 / information + max(by_part, 0.0))  # of sigma, not of its square
    return found
