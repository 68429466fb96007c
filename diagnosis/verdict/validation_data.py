"""The data that decide: validation runs, or folds of training runs, with fits that have not seen them.

A fold is a run; of fewer than three training runs it is one of some stretches of time. The loss there is
the model error, by blocks, and the error of the window predictions, by windows.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cosim import InputError

from ..execution.parallel import in_halves
from ..predictors import Model, WeakWindows, Windows, omega
from ..predictors.windows import ANY_TIME
from ..search.findings import Findings
from ..search.gram import WHOLE_RUNS, run_folds
from ..search.significance import Losses


class Fold:
    """A run, or a stretch of one.

    Args:
        w: windows of the run.
        blocks: numbers of the blocks of the stretch; None: all.
    """

    def __init__(self, w: WeakWindows, blocks: np.ndarray | None = None) -> None:
        self.data = w
        number = np.unique(w.block, return_inverse=True)[1]
        blocks = np.unique(number) if blocks is None else blocks
        whole = blocks.size == number.max() + 1
        self._rows = np.isin(number, blocks)
        self._block = number[self._rows]
        first, last = w.middle[self._rows][[0, -1]]
        self.span = ANY_TIME if whole else (float(first), float(last))  # s, where windows begin

    def omega_loss(self, model: Model, sigma: np.ndarray) -> np.ndarray:
        """(blocks,), see :class:`Losses`; sigma (3,) is what a model error is divided by."""
        model = model.during(self.data.run.name)
        squares = np.sum((omega(self.data, model)[self._rows] / sigma) ** 2, axis=1)
        return np.bincount(self._block, squares)[np.unique(self._block)]


def fold_losses(folds: Sequence[Fold], models: Sequence[Model], sigma: np.ndarray) -> list[Losses]:
    """Losses of folds, each of a model of its own; models that are measured alike predict at once."""
    squares = [(np.zeros(0), np.zeros(0))] * len(folds)
    together: dict[tuple[Any, ...], list[int]] = {}
    for k, (fold, model) in enumerate(zip(folds, models, strict=True)):
        alike = model.logging, model.filters, id(model.given), fold.data.horizon
        together.setdefault(alike, []).append(k)
    for (*_, horizon), places in together.items():
        runs, spans = [folds[k].data.smoothed for k in places], [folds[k].span for k in places]
        try:
            windows = Windows(runs, horizon, spans)
        except InputError:  # none has a window with enough samples
            continue
        errors = windows.summary(windows.residuals_by_run([models[k] for k in places]))
        for n, k in enumerate(places):
            own = windows.run == n
            squares[k] = errors.position[own] ** 2, errors.heading[own] ** 2
    return [
        Losses(fold.omega_loss(model, sigma), *of)
        for fold, model, of in zip(folds, models, squares, strict=True)
    ]


class ValidationData:
    """The data that decide, and the losses of models there.

    Args:
        train: runs that are learned from.
        validate: further runs; where there are any, they decide, else folds of ``train`` do.
        start: the initial model.
        sigma: (3,), what a model error is divided by [N, N, N m].
        least: number of training runs from which on a fold is a whole one.
    """

    def __init__(
        self,
        train: Sequence[WeakWindows],
        validate: Sequence[WeakWindows],
        start: Model,
        sigma: np.ndarray,
        least: int = WHOLE_RUNS,
    ) -> None:
        self.train, self.validate, self.start, self.sigma = train, validate, start, sigma
        self.least = least
        self.where = "validation runs" if validate else "data left out of the fit"
        self._known: dict[int, tuple[Findings | Model, list[Losses]]] = {}

    @cached_property
    def _folds(self) -> list[Fold]:
        if self.validate:
            return [Fold(w) for w in self.validate]
        return [Fold(self.train[run], blocks) for run, blocks in run_folds(self.train, self.least)]

    @cached_property
    def of_other_runs(self) -> "ValidationData":
        """The same data, each of two runs left out as a whole: what holds in one may not in another."""
        if self.validate:
            return self
        return ValidationData(self.train, [], self.start, self.sigma, WHOLE_RUNS - 1)

    @property
    def runs(self) -> list[WeakWindows]:
        """All runs that a verdict may rest on."""
        return [*self.train, *self.validate]

    def judges(self, found: Findings) -> bool:
        """Whether these data can judge the findings of a method."""
        return bool(self.validate) or len(self._fold_models(found)) == len(self._folds)

    def _fold_models(self, found: Findings) -> Sequence[Model]:
        return found.fold_models if self.least == WHOLE_RUNS else found.run_models

    def losses(self, *found: Findings | Model) -> list[Losses]:
        """Losses of models, each fitted without the fold that it is judged on."""
        of_folds = self.losses_of_folds(*found)
        return [Losses(*map(np.concatenate, zip(*folds, strict=True))) for folds in of_folds]

    def losses_of_folds(self, *found: Findings | Model) -> list[list[Losses]]:
        """The same of each fold."""
        # The first model, which comes up again, takes hardly longer together with others.
        due = {id(f): f for f in (*found, self.start) if id(f) not in self._known}
        if any(id(f) in due for f in found):
            variants = [self._models(f) for f in due.values()]

            def of_some(which: Sequence[int]) -> list[tuple[Losses, ...]]:
                """Of each fold the losses of all variants, which are predicted at once."""
                folds = [self._folds[k] for k in which] * len(variants)
                models = [m[k] for m in variants for k in which]
                each = fold_losses(folds, models, self.sigma)
                return [tuple(each[k :: len(which)]) for k in range(len(which))]

            by_fold = in_halves(of_some, range(len(self._folds)))
            for f, parts in zip(due.values(), zip(*by_fold, strict=True), strict=True):
                self._known[id(f)] = f, list(parts)
        return [self._known[id(f)][1] for f in found]

    def _models(self, found: Findings | Model) -> Sequence[Model]:
        if isinstance(found, Findings):
            if not self.validate:
                return self._fold_models(found)
            found = found.model if found.effects else found.refitted or self.start
        return [found] * len(self._folds)
