"""What a candidate must show to be accepted: more than chance, no harm to runs that it has not seen.

Two models are compared on the same data, block by block and window by window.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import ndtr

from fmus.ship import Ship

from ..predictors.uncertainty import SHARE_OF_COMMAND
from ..runs.paired_test import surely_positive
from ..runs.run_constants import NEGLIGIBLE
from .map_regression import Scored
from .shortlist import NEW, TIE, Shortlist

FITS = "the model fits {where} worse"
PREDICTS = "predictions of {where} are worse"


def beyond_chance(nothing: Scored, best: Scored, total: float) -> bool:
    """Whether a candidate explains more than chance does, by cross-validation over blocks.

    ``nothing`` is the score without it, ``total`` the first model error in units of the noise, squared.
    """
    fall = nothing.score - best.score
    explains = float(best.blocks.sum()) < (1.0 - NEGLIGIBLE) * total
    return explains and fall > max(NEGLIGIBLE**2 * nothing.score, NEW)


def harmful(nothing: Scored, best: Scored) -> bool:
    """Whether a candidate makes runs worse that it was not fitted to.

    What the prior charges for nominal coefficients that moved is counted on both sides.
    """
    return worse(best.runs, nothing.runs, best.prior - nothing.prior)


def matters(first: np.ndarray, without: np.ndarray, left: np.ndarray, command: np.ndarray) -> bool:
    """Whether an effect takes away a force that shows, on some axis: one that a residual may not have.

    Args:
        first: (K, 3), the first model error.
        without, left: (K, 3), the model error without the effect and with it, all else the same.
        command: (K, 3), the commanded force.
    """
    fall = np.sum(without**2 - left**2, axis=0)
    of_error = NEGLIGIBLE**2 * np.sum(first**2, axis=0)
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


class Losses(NamedTuple):
    """Losses of a model on the data that decide.

    Attributes:
        omega: (blocks,), sum of squares of the model error in each block, axes weighted by noise.
        position, heading: (windows,), mean square error of prediction in each window [m2], [rad2].
    """

    omega: np.ndarray
    position: np.ndarray
    heading: np.ndarray


def worse(its: np.ndarray, others: np.ndarray, charge: float = 0.0) -> bool:
    """Whether a loss by blocks (blocks,) exceeds another by more than two paired standard errors.

    Args:
        its, others: losses; infinite where a model runs away.
        charge: added to the difference.
    """
    known = np.isfinite(others)
    if not np.isfinite(its[known]).all():
        return True
    d = its[known] - others[known]
    if not d.size:
        return charge > 0.0
    return float(d.sum()) + charge > TIE * float(np.sqrt(d.size) * d.std())


def lower_throughout(its: np.ndarray, others: np.ndarray) -> bool:
    """Whether a loss by blocks (blocks,) is below another, in most blocks or by its mean.

    One block with most of the loss makes a standard error as large as the mean; ranks do not mind
    (Wilcoxon's signed-rank test, at the level of two standard errors).
    """
    if worse(others, its):
        return True
    d = others - its
    if not np.isfinite(d).all() or not np.any(d) or d.sum() < 0.0:
        return False
    from scipy.stats import norm, wilcoxon  # half a second of import, and seldom asked for

    _, p = wilcoxon(d, alternative="greater")
    return bool(p < norm.sf(TIE))


def harm(its: Losses, others: Losses, more: int = 0) -> str:
    """In which loss a model is worse than another by more than two paired standard errors.

    Arguments and result are those of a criterion of pruning; ``more`` is not used, as the data
    were not fitted.
    """
    if worse(its.omega, others.omega):
        return FITS
    return PREDICTS if predicts_worse(its, others) else ""


def predicts_worse(its: Losses, others: Losses) -> bool:
    """Whether a model predicts worse than another: in position or heading, and in both together.

    In one of them by more than two paired standard errors; in both by the logarithms of the ratios of
    the mean squares. An error that is larger by a thousandth in each window is beyond chance as well,
    and is no loss beside a smaller one of the other kind. Of two models at most one predicts worse.
    """
    pairs = zip(its[1:], others[1:], strict=True)
    return any(worse(a, b) for a, b in pairs) and gain_of_predictions(its, others) > 0.0


def predicts_better(its: Losses, others: Losses) -> bool:
    """Whether a model predicts better than another: beyond chance, or position and heading throughout.

    A window with most of the error makes the standard error of the mean as large as the mean.
    """
    pairs = zip(its[1:], others[1:], strict=True)
    return predicts_worse(others, its) or all(lower_throughout(*pair) for pair in pairs)


def as_good(its: Losses, others: Losses) -> bool:
    """Whether a model may take the place of another with more terms.

    Its predictions are as good, position and heading together, and in no loss is it worse beyond chance.
    """
    return gain_of_predictions(its, others) <= 0.0 and not harm(its, others)


def fits_predict_worse(its: Sequence[Losses], others: Sequence[Losses]) -> bool:
    """Whether a way to fit predicts worse than another one, by the losses of folds.

    All windows of a fold are predicted by one fit. What varies by chance is the fit, so that the
    logarithms of the ratios of the mean squares count once a fold (Student's test).
    """
    lost = [[np.isinf(np.hstack(fold[1:])).any() for fold in each] for each in (its, others)]
    if any(a and not b for a, b in zip(*lost, strict=True)):
        return True
    rises = [gain_of_predictions(a, b) for a, b in zip(its, others, strict=True) if a.position.size]
    return surely_positive(np.array(rises), float(ndtr(-TIE)))


def gain(its: Sequence[np.ndarray], others: Sequence[np.ndarray]) -> float:
    """Fall of the losses from a model to another: logarithms of their ratios, summed over all."""
    pairs = [(a, b) for a, b in zip(its, others, strict=True) if np.size(a)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(sum(np.log(np.sum(a) / np.sum(b)) for a, b in pairs)))


def gain_of_predictions(its: Losses, others: Losses) -> float:
    """The same of the predictions alone."""
    return gain(its[1:], others[1:])
