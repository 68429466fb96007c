"""A method's own choice of its settings, on the runs that it learns from and on no other."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from diagnosis import Smoothed

from .same_windows import Held, Law

SEED = 1  # of first weights and of what early stopping sets aside


@dataclass
class Method:
    """A method, its settings, and what it has fitted already.

    Attributes:
        name: of the method.
        fit: ``fit(runs, nominal, **setting)``.
        settings: name -> values that are tried, each with each.
        final: the fit with the settings that were chosen.
        fits: training runs and setting -> law, and the processor time of the fit [s].
    """

    name: str
    fit: Callable[..., Law]
    settings: Mapping[str, Sequence[Any]]
    final: Callable[..., Law]
    fits: dict[Any, tuple[Law | None, float]] = field(default_factory=dict)

    def law(
        self, runs: Sequence[Smoothed], nominal: Any, setting: Mapping[str, Any]
    ) -> tuple[Law | None, float]:
        """The fitted law, None where the method itself fails, and the time that its fit took [s]."""
        key = (tuple(r.track.run.name for r in runs), *setting.values())
        if key not in self.fits:
            begin = time.process_time()
            try:
                with np.errstate(all="ignore"):
                    law = self.fit(runs, nominal, **setting)
            except (ValueError, np.linalg.LinAlgError):
                law = None
            self.fits[key] = law, time.process_time() - begin
        return self.fits[key]


@dataclass(frozen=True)
class Answer:
    """What a method says of runs that it has not seen.

    Attributes:
        position: error over the windows [m].
        heading: [rad].
        seconds: of the processor, all fits of the search included.
        setting: that it chose.
    """

    position: float
    heading: float
    seconds: float
    setting: Mapping[str, Any]


def score(law: Law | None, held: Held, reference: tuple[float, float]) -> float:
    """Mean logarithm of the errors of position and heading over those of a reference."""
    if law is None:
        return np.inf
    return float(np.mean(np.log(np.divide(held.errors(law), reference))))


def answer(
    method: Method,
    training: Sequence[Smoothed],
    left_out: Sequence[Smoothed],
    nominal: Any,
    length: float,
    reference: Law,
) -> Answer:
    """Choose the settings by leaving out each training run in turn, fit all, predict the runs left out.

    Args:
        method: to be asked.
        training: two runs or more.
        left_out: predicted at the end.
        nominal: model, as of :class:`.same_windows.Nominal`.
        length: of the windows [s].
        reference: law, whose errors those of the candidates are divided by.
    """
    begin, seconds = time.process_time(), 0.0
    inner = [([r for r in training if r is not out], Held([out], length)) for out in training]
    references = [held.errors(reference) for _, held in inner]
    best, chosen = np.inf, None
    for values in product(*method.settings.values()):
        setting = dict(zip(method.settings, values, strict=True))
        total = 0.0
        for (rest, held), by in zip(inner, references, strict=True):
            known = len(method.fits)
            law, took = method.law(rest, nominal, setting)
            seconds += took * (len(method.fits) == known)  # a fit that another fold needed as well
            total += score(law, held, by)
        if total < best:
            best, chosen = total, setting
    if chosen is None:
        raise ValueError(f"{method.name} predicts nothing with any of its settings")
    law = method.final(training, nominal, **chosen)
    position, heading = Held(left_out, length).errors(law)
    return Answer(position, heading, time.process_time() - begin + seconds, chosen)
