"""A method's own choice of its settings, on the runs that it learns from and on no other."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from typing import Any

import numpy as np

from diagnosis import Smoothed, Windows

from .entry_predictor import Entry, OfLaw, Training
from .same_windows import Law, law_errors

SEED = 1  # of first weights and of what early stopping sets aside
FOLDS = 4  # 1, of the training runs at the most; chosen
FURTHER = 0.2  # s, steps of the delay beyond the edge of its grid; chosen


def searched(
    name: str,
    fit: Callable[..., Law],
    settings: Mapping[str, Sequence[Any]],
    final: Callable[..., Law] | None = None,
) -> Entry:
    """An entry that chooses its settings by leaving out parts of the training runs, and fits all.

    Args:
        name: of the method.
        fit: ``fit(runs, nominal, **setting)``.
        settings: name -> values that are tried, each with each; a delay is searched beyond the last.
        final: the fit with the settings that were chosen; None: the same.
    """

    def entry(train: Training) -> OfLaw:
        inner = [(rest, Windows(out, train.horizon)) for rest, out in _parts(train.smoothed)]

        def score(setting: Mapping[str, Any]) -> float:
            """Mean logarithm of the errors of position and heading."""
            total = 0.0
            for rest, windows in inner:
                try:
                    with np.errstate(all="ignore"):
                        law = fit(rest, train.nominal, **setting)
                except (ValueError, np.linalg.LinAlgError):
                    return np.inf
                total += float(np.log(law_errors(law, windows)).sum())
            return total

        tried = [dict(zip(settings, v, strict=True)) for v in product(*settings.values())]
        scores = [score(s) for s in tried]
        while "delay" in settings:  # while the last one is the best
            best = tried[int(np.argmin(scores))]
            if best["delay"] < max(s["delay"] for s in tried):
                break
            tried.append(best | {"delay": best["delay"] + FURTHER})
            scores.append(score(tried[-1]))
        if not np.isfinite(min(scores)):
            raise ValueError(f"{name} predicts nothing with any of its settings")
        return OfLaw((final or fit)(train.smoothed, train.nominal, **tried[int(np.argmin(scores))]))

    return entry


def _parts(runs: Sequence[Smoothed]) -> list[tuple[list[Smoothed], list[Smoothed]]]:
    """Training runs in turn without some of them, and those."""
    count = min(FOLDS, len(runs))
    return [([r for k, r in enumerate(runs) if k % count != i], [*runs[i::count]]) for i in range(count)]
