"""Unseen data: held-out runs, or parts of the training runs beside fits that have not seen them.

A part is a run; of a single training run it is one of some stretches of time. What a model misses there
is its model error, by blocks, and the error of its window predictions, by windows.
"""

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np

from cosim import InputError

from ..execution.parallel import for_each
from ..predictors import Model, WeakWindows, omega
from ..predictors.windows import Windows
from ..search.significance import worse

FITS = "the model fits {where} worse"
PREDICTS = "predictions of {where} are worse"


class Losses(NamedTuple):
    """What a model misses on unseen data.

    Attributes:
        omega: (blocks,), sum of squares of the model error in each block, axes weighted by noise.
        position, heading: (windows,), mean square error of prediction in each window [m2], [rad2].
    """

    omega: np.ndarray
    position: np.ndarray
    heading: np.ndarray


class Part:
    """A run, or a stretch of one.

    Args:
        w: windows of the run.
        blocks: numbers of the blocks of the stretch; None: all.
    """

    def __init__(self, w: WeakWindows, blocks: np.ndarray | None = None) -> None:
        self.data = w
        number = np.unique(w.block, return_inverse=True)[1]
        self._rows = np.ones(number.size, bool) if blocks is None else np.isin(number, blocks)
        self._block = number[self._rows]
        first, last = w.middle[self._rows][[0, -1]]
        self._span = (-np.inf, np.inf) if blocks is None else (first, last)
        self._windows: Windows | None = None
        with suppress(InputError):  # no window has enough samples
            self._windows = Windows([w.smoothed], w.horizon)

    def losses(self, models: Sequence[Model], sigma: np.ndarray) -> list[Losses]:
        """What each of some models misses here, sigma (3,) being what an error is divided by."""
        found, models = [], [m.during(self.data.run.name) for m in models]
        for model, (position, heading) in zip(models, self._predicted(models), strict=True):
            squares = np.sum((omega(self.data, model)[self._rows] / sigma) ** 2, axis=1)
            of_block = np.bincount(self._block, squares)
            found.append(Losses(of_block[np.unique(self._block)], position, heading))
        return found

    def _predicted(self, models: Sequence[Model]) -> list[tuple[np.ndarray, np.ndarray]]:
        """Mean square errors in the windows that begin here, of each model."""
        if self._windows is None:
            return [(np.zeros(0), np.zeros(0))] * len(models)
        inside = (self._windows.start >= self._span[0]) & (self._windows.start <= self._span[1])
        errors = self._windows.summary(np.stack(self._windows.residuals_of_each(models)))
        return [
            (position[inside] ** 2, heading[inside] ** 2)
            for position, heading in zip(errors.position, errors.heading, strict=True)
        ]


def losses(
    parts: Sequence[Part], variants: Sequence[Sequence[Model]], sigma: np.ndarray
) -> list[Losses]:
    """What each of some variants misses on all parts.

    Args:
        parts: of the unseen data.
        variants: of each variant the model of each part.
        sigma: (3,), what an error is divided by [N, N, N m].
    """
    by_part = for_each(lambda k: parts[k].losses([v[k] for v in variants], sigma), range(len(parts)))
    return [
        Losses._make(map(np.concatenate, zip(*one, strict=True))) for one in zip(*by_part, strict=True)
    ]


def gain(its: Losses, others: Losses) -> float:
    """By how much another model misses less, on a logarithmic scale, summed over the three."""
    pairs = [(a, b) for a, b in zip(its, others, strict=True) if np.size(a)]
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.nan_to_num(sum(np.log(np.sum(a) / np.sum(b)) for a, b in pairs)))


def harm(its: Losses, others: Losses) -> str:
    """In what a model is worse than another by more than two paired standard errors; empty: in nothing.

    Where it predicts positions better and headings worse by as much, or the reverse, the relative
    changes of both mean squares count together.
    """
    if worse(its.omega, others.omega):
        return FITS
    pairs = [(its.position, others.position), (its.heading, others.heading)]
    if not its.position.size or not any(worse(a, b) for a, b in pairs):
        return ""
    if any(worse(b, a) for a, b in pairs):
        change = sum(np.sum(a) / np.sum(b) - 1.0 for a, b in pairs)
        return PREDICTS if change > 0.0 else ""
    return PREDICTS
