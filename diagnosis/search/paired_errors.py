"""Two models compared block by block and window by window, on the same data."""

from typing import NamedTuple

import numpy as np

from .shortlist import TIE

FITS = "the model fits {where} worse"
PREDICTS = "predictions of {where} are worse"


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
    """Whether a model predicts worse than another by more than two paired standard errors.

    Where it predicts positions better and headings worse by as much, or the reverse, the relative
    changes of both mean squares count together.
    """
    pairs = [(its.position, others.position), (its.heading, others.heading)]
    if not its.position.size or not any(worse(a, b) for a, b in pairs):
        return False
    if any(worse(b, a) for a, b in pairs):
        return bool(sum(np.sum(a) / np.sum(b) - 1.0 for a, b in pairs) > 0.0)
    return True


def gain(its: Losses, others: Losses) -> float:
    """Fall of the losses from a model to another: logarithms of their ratios, summed over the three."""
    pairs = [(a, b) for a, b in zip(its, others, strict=True) if np.size(a)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(sum(np.log(np.sum(a) / np.sum(b)) for a, b in pairs)))
