"""What a candidate must show to be accepted: more than chance, no harm to runs that it has not seen."""

import numpy as np

from fmus.ship import Ship

from ..predictors.uncertainty import SHARE_OF_COMMAND
from ..runs.run_constants import NEGLIGIBLE
from .candidates import LEAST_SHARE
from .map_regression import Scored
from .paired_errors import worse
from .shortlist import NEW, Shortlist


def beyond_chance(nothing: Scored, best: Scored, total: float) -> bool:
    """Whether a candidate explains more than chance does, by cross-validation over blocks.

    ``nothing`` is the score without it, ``total`` the first model error in units of the noise, squared.
    """
    fall = nothing.score - best.score
    explains = float(best.blocks.sum()) < (1.0 - NEGLIGIBLE) * total
    return explains and fall > max(LEAST_SHARE * nothing.score, NEW)


def harmful(nothing: Scored, best: Scored) -> bool:
    """Whether a candidate makes runs worse that it was not fitted to.

    What the prior charges for nominal coefficients that moved is counted on both sides.
    """
    return worse(best.runs, nothing.runs, best.prior - nothing.prior)


def matters(first: np.ndarray, without: np.ndarray, left: np.ndarray, command: np.ndarray) -> bool:
    """Whether an effect takes away a force that shows, on some axis.

    Args:
        first: (K, 3), the first model error.
        without, left: (K, 3), the model error without the effect and with it, all else the same.
        command: (K, 3), the commanded force.
    """
    fall = np.sum(without**2 - left**2, axis=0)
    of_error = SHARE_OF_COMMAND * np.sum(first**2, axis=0)
    of_command = SHARE_OF_COMMAND**2 * np.sum(command**2, axis=0)
    return bool(np.any(fall >= np.maximum(of_error, of_command)))


def better(present: str, best: Shortlist, ship: Ship) -> int | None:
    """Number of the candidate of a shortlist that takes the present effect's place; None: none does.

    A simple law goes before a free curve that is no better than two paired standard errors; else a
    candidate must be better than the present effect by as much as an effect must bring.
    """
    scored = best.scored
    ids = [best.ids[s.candidate] for s in scored]
    smooth = [ship.effects[i].search.smooth for i in ids]
    chosen = 0
    if smooth[0]:
        simple = [k for k in range(1, len(ids)) if not smooth[k] and not lower(scored[0], scored[k])]
        chosen = min(simple, default=0)
    if ids[chosen] == present:
        return None
    if present in ids:
        at = ids.index(present)
        simpler = smooth[at] and not smooth[chosen]
        if not simpler and scored[at].score < scored[chosen].score + NEW:
            return None
    return chosen


def lower(its: Scored, others: Scored) -> bool:
    """Whether a score is below another by more than two paired standard errors."""
    return worse(others.blocks, its.blocks, others.penalty - its.penalty)
