"""Whether criteria are met: for sure, surely not, or not to be judged from these data, and why."""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from cosim import InputError
from cosim.errors import nearest

from .budget import Budget, Sources, budget
from .criterion import Criterion
from .predictions import Predictions, difference, judged
from .statistics import Interval, independent, needed, root_mean_square, share

Outcome = Literal["met", "not met", "cannot be judged"]
EXPANDED = 2.0  # standard uncertainties in the expanded one, about 95 % of a normal distribution


class Judgement(NamedTuple):
    """What the windows say of a criterion. Numbers in SI.

    Attributes:
        criterion: that is judged.
        outcome: of it.
        reason: in a sentence.
        runs: names of those that count.
        run, start: (w,), of each window the number of its run, and when it begins [s].
        errors: (w,), measured less predicted; of position the distance.
        independent: how many of the windows are.
        interval: share, or RMS, with bounds.
        budget: uncertainty of the errors; None without windows.
    """

    criterion: Criterion
    outcome: Outcome
    reason: str
    runs: Sequence[str]
    run: np.ndarray
    start: np.ndarray
    errors: np.ndarray
    independent: float
    interval: Interval | None
    budget: Budget | None


class Predicted(NamedTuple):
    """A run that was predicted for a criterion.

    Attributes:
        name: of the run.
        predictions: in windows of the criterion's horizon.
        sources: of their uncertainty.
        signals: name -> mean (w,) in each window, of what ``within`` may name.
    """

    name: str
    predictions: Predictions
    sources: Sources
    signals: dict[str, np.ndarray]


def judge(c: Criterion, given: Sequence[str], predicted: Sequence[Predicted]) -> Judgement:
    """Judge a criterion.

    Args:
        c: the criterion.
        given: names of all runs that were compared.
        predicted: those that have windows of the criterion's horizon.
    """
    lacking = [name for name in c.runs or () if name not in given]
    chosen = [p for p in predicted if c.runs is None or p.name in c.runs]
    if lacking:
        return _unjudged(c, f"run {', '.join(lacking)} was not compared")
    if not chosen:
        return _unjudged(c, f"no run has a window of {c.horizon:g} s with enough samples")
    counted = [_counted(c, p) for p in chosen]
    off = [difference(p.predictions.measured, p.predictions.motion) for p in chosen]
    errors = np.concatenate([judged(c.quantity, d)[rows] for d, rows in zip(off, counted, strict=True)])
    if not errors.size:
        limits = ", ".join(f"{s} from {a:g} to {b:g}" for s, (a, b) in c.within.items())
        return _unjudged(c, f"outside the data: no window has {limits}")
    run = np.repeat(np.arange(len(chosen)), [int(rows.sum()) for rows in counted])
    start = np.concatenate([p.predictions.start[rows] for p, rows in zip(chosen, counted, strict=True)])
    told = budget(c.quantity, [p.sources for p in chosen], counted)
    n = independent(np.abs(errors), run)
    outcome, reason, interval = decide(c, errors, n, told.u_val)
    names = [p.name for p in chosen]
    return Judgement(c, outcome, reason, names, run, start, errors, n, interval, told)


def decide(c: Criterion, errors: np.ndarray, n: float, u_val: float) -> tuple[Outcome, str, Interval]:
    """What errors say of a criterion.

    Met is what the bound on the safe side says. Not met is what it would be, were every error smaller by
    the expanded validation uncertainty.

    Args:
        c: the criterion.
        errors: (w,) [SI].
        n: how many of them are independent.
        u_val: their standard validation uncertainty [SI].
    """
    size, reach = np.abs(np.nan_to_num(errors, nan=np.inf)), EXPANDED * u_val
    sure, more = f"{100.0 * c.confidence:g} % sure", "too few independent windows"
    uncertain = f"the validation uncertainty, 2 u_val = {reach / c.factor:.3g} {c.unit}"
    if c.statistic == "rms":
        found = root_mean_square(size, n, c.confidence)
        least = root_mean_square(np.maximum(size - reach, 0.0), n, c.confidence)
        met, refused, open_ = found.high <= c.limit, least.low > c.limit, found.low <= c.limit
        bound = f"the RMS is {found.high / c.factor:.3g} {c.unit} at the most, {sure}"
        floor = f"the RMS is {found.low / c.factor:.3g} {c.unit} at least, {sure}"
    else:
        found = share(size <= c.limit, n, c.confidence)
        least = share(size <= c.limit + reach, n, c.confidence)
        met, refused, open_ = found.low >= c.wanted, least.high < c.wanted, found.high >= c.wanted
        bound = f"{100.0 * found.low:.3g} % at least are within, {sure}"
        floor = f"{100.0 * found.high:.3g} % at the most are within, {sure}"
        fewest = needed(c.wanted, c.confidence)
        more += f": {fewest} would be needed if all are within" if n < fewest else ""
    if reach > c.limit:
        return "cannot be judged", f"the tolerance is within {uncertain}", found
    if met or refused:
        return ("met", bound, found) if met else ("not met", floor, found)
    beyond = f"what is beyond the tolerance lies within {uncertain}"
    left = f"{more} ({n:.3g} independent of {size.size} leave it open)"
    return "cannot be judged", left if open_ else beyond, found


def _counted(c: Criterion, p: Predicted) -> np.ndarray:
    """(w,), the windows of a run that count.

    Raises:
        InputError: ``within`` names what is no signal of the run.
    """
    keep = np.ones(p.predictions.rows.size, bool)
    for signal, (low, high) in c.within.items():
        if signal not in p.signals:
            hint = nearest(signal, p.signals)
            raise InputError(f"criterion '{c.title}': within: run {p.name} has no '{signal}'{hint}")
        keep &= (p.signals[signal] >= low) & (p.signals[signal] <= high)
    return keep


def _unjudged(c: Criterion, reason: str) -> Judgement:
    none = np.zeros(0)
    return Judgement(c, "cannot be judged", reason, [], none, none, none, 0.0, None, None)
