"""Harm by paired errors: two models compared block by block and window by window, on the same data."""

import numpy as np

from ..search.significance import worse
from .validation_data import Losses

FITS = "the model fits {where} worse"
PREDICTS = "predictions of {where} are worse"


def harm(its: Losses, others: Losses, more: int = 0) -> str:
    """In which loss a model is worse than another by more than two paired standard errors.

    Arguments and result are those of :class:`.pruning_criteria.Harm`; ``more`` is not used, as the data
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
