"""How many effects a search may still find, by greedy regression without cross-validation.

Only the remaining time of a search is stated by it: no effect is accepted or rejected here.
"""

from typing import NamedTuple

import numpy as np

from ..predictors import Model
from .candidates import LEAST_SHARE, CandidateShape
from .findings import MOST_REPORTED
from .gram import Entry, GramTable
from .most_likely import ridge
from .refinement import bounded
from .shortlist import NEW, Ranking


class Step(NamedTuple):
    """A shape of a candidate, and what it takes off the sum of squares, less its charge."""

    fall: float
    candidate: int
    entry: Entry


def further_effects(ranking: Ranking, start: Model) -> int:
    """The number of effects (0 to MOST_REPORTED) that regressions find one after the other.

    Args:
        ranking: all candidates in addition to the model so far.
        start: the initial model, which has the ranges of the values.
    """
    t, used = ranking.table, set[int]()
    gram = _without(t, t.total, t.nuisance, t.precision)
    while len(used) < MOST_REPORTED:
        steps = [
            Step(_fall(t, gram, shape, entry, start), k, entry)
            for k, candidate in enumerate(ranking.candidates)
            if k not in used
            for shape, entry in zip(candidate.shapes, t.entries[k], strict=True)
        ]
        best = max(steps, key=lambda step: step.fall, default=None)
        if best is None or best.fall <= max(LEAST_SHARE * gram[0, 0], NEW):
            break
        used.add(best.candidate)
        given, columns = best.entry.given, best.entry.columns
        if given >= 0:
            taken = np.eye(len(gram))
            taken[given, 0] = -1.0
            gram = taken.T @ gram @ taken
        gram = _without(t, gram, columns, best.entry.precision)
    return len(used)


def _fall(t: GramTable, gram: np.ndarray, shape: CandidateShape, entry: Entry, start: Model) -> float:
    """See :class:`Step`; minus infinity where the best values are out of their ranges."""
    given, columns = entry.given, entry.columns
    right, fall = gram[columns, 0], -(len(columns) + entry.nonlinear) * t.per_parameter - entry.quieted
    if given >= 0:
        right = right - gram[columns, given]
        fall += 2.0 * gram[given, 0] - gram[given, given]
    if columns:
        values = np.linalg.solve(_regular(t, gram, columns, entry.precision), right)
        fall += right @ values
        for name, value in zip(shape.fitted, values.tolist(), strict=True):
            whole = shape.given.get(name, 0.0) + value
            if bounded(start, name, whole) != whole:
                return -np.inf
    return float(fall) if np.isfinite(fall) else -np.inf


def _regular(t: GramTable, gram: np.ndarray, columns: list[int], precision: np.ndarray) -> np.ndarray:
    own = gram[np.ix_(columns, columns)] + precision
    return own + ridge(own, t.unit[columns])


def _without(t: GramTable, gram: np.ndarray, columns: list[int], precision: np.ndarray) -> np.ndarray:
    """A Gram matrix (p, p) of what some columns, fitted, do not explain of all."""
    own = _regular(t, gram, columns, precision)
    return np.asarray(gram - gram[:, columns] @ np.linalg.solve(own, gram[columns]))
