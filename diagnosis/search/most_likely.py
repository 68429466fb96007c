"""The most likely parameters by Gauss-Newton steps, for fits whose evaluations are costly.

With residuals r(theta) in units of their noise, slopes J = -dr/dtheta and a prior precision P about the
prior means, the cost is |r|^2 + theta^T P theta, twice a negative log likelihood. A step solves
(J^T J + P) delta = J^T r - P theta, halved while the cost does not fall. The weights of the residuals
may depend on the parameters: they are held during a step. :func:`scipy.optimize.least_squares` takes
twice to eight times as long to the same minimum (benchmarks.fit_drivers).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from ..runs.cleaning import normal_within
from ..runs.run_constants import CHANCE, DIGITS, STEPS

# 1, of cost: where a step promises less, parameters are within a seventh of their deviation
ENOUGH = 0.02

At = TypeVar("At")


@dataclass(frozen=True, eq=False)
class Quadratic(Generic[At]):
    """The cost about an estimate.

    Attributes:
        H: (q, q), J^T J + P.
        right: (q,), J^T r - P theta.
        cost: of an estimate, with the weights of this one; infinite where it cannot be computed.
    """

    H: np.ndarray
    right: np.ndarray
    cost: Callable[[At], float]


About = TypeVar("About", bound=Quadratic[Any])


def beyond(places: int) -> float:
    """Standard deviations beyond which one of some normal values is by CHANCE (Bonferroni)."""
    return normal_within(1.0 - CHANCE / max(places, 1))


def ridge(H: np.ndarray, unit: np.ndarray | float = 1.0) -> np.ndarray:
    """(p, p), what makes an information matrix regular, for parameters with units (p,).

    It is far above the rounding of a sum, so that collinear parameters share, and far below a prior.
    """
    return DIGITS**1.5 * np.diag(np.diag(H) + np.power(unit, -2.0))


def most_likely(
    at: At, about: Callable[[At], About], moved: Callable[[At, np.ndarray], At]
) -> tuple[At, About]:
    """The estimate of least cost, and the cost about it.

    Args:
        at: where to begin.
        about: the cost about an estimate.
        moved: an estimate after a step (q,), within its limits.
    """
    here = about(at)
    for _ in range(STEPS):
        step = np.linalg.solve(here.H, here.right)
        if here.right @ step < ENOUGH:
            break
        further = _further(here, at, step, moved)
        if further is None:
            break
        at, here = further, about(further)
    return at, here


def _further(
    here: Quadratic[At], at: At, step: np.ndarray, moved: Callable[[At, np.ndarray], At]
) -> At | None:
    """The first of a step and its halves at which the cost is less; None: at none.

    Where the parabola through the cost at both ends and the middle rises from the start, the slopes do
    not hold there, and shorter steps are not tried.
    """
    least, whole = here.cost(at), np.inf
    for k in range(STEPS):
        tried = moved(at, step / 2**k)
        cost = here.cost(tried)
        if cost < least:
            return tried
        if k == 1 and 4.0 * cost - whole >= 3.0 * least:
            return None
        whole = cost
    return None
