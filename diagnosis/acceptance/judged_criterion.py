"""Whether criteria are met: for sure, surely not, or not to be judged from these data, and why."""

from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.special import chdtr

from cosim import InputError
from cosim.errors import nearest
from fmus.frames import rotate_to_body

from ..runs.run_constants import CHANCE, NEGLIGIBLE
from .budget import Budget, Sources, budget
from .criterion import Criterion
from .predictions import Predictions, difference, judged
from .statistics import Interval, independent, needed, root_mean_square, share

Outcome = Literal["met", "not met", "cannot be judged"]
EXPANDED = 2.0  # 1, standard uncertainties in the expanded one (ASME V&V 20, JCGM 100)
# 1, of u_D: an RMS below it, with no more probability than CHANCE, is that of no prediction. Half, as
# noise may be stated too large (chosen).
FAR_BELOW = 0.5
LEARNED, FEW = "the model was learned from it", "too few samples"


class WindowCounts(NamedTuple):
    """Windows and runs: how many were offered, and why some do not count.

    Attributes:
        offered, judged: windows.
        excluded: reason -> windows.
        runs: names of those that count.
        left_out: name of another -> why it does not.
    """

    offered: int
    judged: int
    excluded: Mapping[str, int]
    runs: Sequence[str]
    left_out: Mapping[str, str]


class JudgedErrors(NamedTuple):
    """The errors in the windows that count. Numbers in SI.

    Attributes:
        run: (w,), of each window the number of its run.
        errors: (w,), predicted less measured, E = S - D; of position the distance.
        offset: mean of predicted less measured position, forward and to starboard [m].
        independent: how many of the windows are.
        interval: share, or RMS, with bounds.
        budget: uncertainty of the errors.
    """

    run: np.ndarray
    errors: np.ndarray
    offset: np.ndarray
    independent: float
    interval: Interval
    budget: Budget


class Judgement(NamedTuple):
    """What the windows say of a criterion.

    Attributes:
        criterion: that is judged.
        outcome: of it.
        reason: in a sentence.
        counts: what it rests on.
        found: the errors; None: no window counts.
        flags: what a reader must know of the outcome, a sentence each.
        windows: those that count, of each run that does.
    """

    criterion: Criterion
    outcome: Outcome
    reason: str
    counts: WindowCounts
    found: JudgedErrors | None = None
    flags: Sequence[str] = ()
    windows: Sequence[tuple["Predicted", np.ndarray]] = ()


class Predicted(NamedTuple):
    """A run that was predicted for a criterion.

    Attributes:
        name: of the run.
        predictions: in windows of the criterion's horizon.
        sources: of their uncertainty.
        signals: name -> mean (w,) in each window, of what ``operating_range`` may name.
        same: names of runs that are this one, or nearly.
        learned: whether the model was learned from it.
    """

    name: str
    predictions: Predictions
    sources: Sources
    signals: dict[str, np.ndarray]
    same: frozenset[str] = frozenset()
    learned: bool = False


def judge(
    c: Criterion,
    given: Sequence[str],
    predicted: Sequence[Predicted],
    short: Mapping[str, int] | None = None,
) -> Judgement:
    """Judge a criterion.

    Args:
        c: the criterion.
        given: names of all runs that were compared.
        predicted: those that have windows of the criterion's horizon.
        short: name of another -> windows that it would have, were no sample missing.
    """
    lacking = [name for name in c.runs or () if name not in given]
    chosen, counts = _counted(c, predicted, short or {})
    if lacking:
        return Judgement(c, "cannot be judged", f"run {', '.join(lacking)} was not compared", counts)
    if not counts.judged:
        return Judgement(c, "cannot be judged", _why_nothing(c, counts), counts)
    off = [difference(p.predictions.motion, p.predictions.measured)[rows] for p, rows in chosen]
    errors = np.concatenate([judged(c.quantity, d) for d in off])
    run = np.repeat(np.arange(len(chosen)), [int(rows.sum()) for _, rows in chosen])
    psi = np.concatenate([p.predictions.measured[rows, 2] for p, rows in chosen])
    every = np.concatenate(off)
    offset = np.array([np.mean(x) for x in rotate_to_body(psi, every[:, 0], every[:, 1])])
    sources, masks = [p.sources for p, _ in chosen], [rows for _, rows in chosen]
    stated = budget(c.quantity, sources, masks)
    n = independent(np.abs(errors), run)
    outcome, reason, interval = decide(c, errors, n, stated.u_val)
    if outcome == "met" and stated.unknown:
        reason += f"; u_val leaves out what is not known: {', '.join(stated.unknown)}"
    flags = [
        _too_good(q, judged(q, every), n, budget(q, sources, masks)) for q in ("position", "heading")
    ]
    flags.append(_too_early(c, np.concatenate([p.predictions.after[rows] for p, rows in chosen])))
    if any(p.learned for p, _ in chosen):
        flags.append("Training runs of the model count, as the criterion states.")
    found = JudgedErrors(run, errors, offset, n, interval, stated)
    return Judgement(c, outcome, reason, counts, found, [*filter(None, flags)], chosen)


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
    sure, more = f"{100.0 * c.confidence:g} % confidence", "too few independent windows"
    uncertain = f"the validation uncertainty, 2 u_val = {reach / c.factor:.3g} {c.unit}"
    if c.statistic == "rms":
        found = root_mean_square(size, n, c.confidence)
        least = root_mean_square(np.maximum(size - reach, 0.0), n, c.confidence)
        met, refused, open_ = found.high <= c.limit, least.low > c.limit, found.low <= c.limit
        bound = f"the RMS is at most {found.high / c.factor:.3g} {c.unit}, {sure}"
        floor = f"the RMS is at least {found.low / c.factor:.3g} {c.unit}, {sure}"
    else:
        found = share(size <= c.limit, n, c.confidence)
        least = share(size <= c.limit + reach, n, c.confidence)
        met, refused, open_ = found.low >= c.wanted, least.high < c.wanted, found.high >= c.wanted
        bound = f"at least {100.0 * found.low:.3g} % are within, {sure}"
        floor = f"at most {100.0 * found.high:.3g} % are within, {sure}"
        fewest = needed(c.wanted, c.confidence)
        more += f": {fewest} windows are needed, if all are within" if n < fewest else ""
    if reach > c.limit:
        return "cannot be judged", f"the tolerance is smaller than {uncertain}", found
    if met or refused:
        return ("met", bound, found) if met else ("not met", floor, found)
    beyond = f"the excess over the tolerance is smaller than {uncertain}"
    left = f"{more} ({n:.3g} independent windows of {size.size} do not decide)"
    return "cannot be judged", left if open_ else beyond, found


def _counted(
    c: Criterion, predicted: Sequence[Predicted], short: Mapping[str, int]
) -> tuple[list[tuple[Predicted, np.ndarray]], WindowCounts]:
    """The windows that count, of each run that has some, a mask (w,)."""
    excluded = {FEW: sum(short.values())}
    left_out, chosen = dict.fromkeys(short, f"no window of {c.horizon:g} s has enough samples"), []
    for p in predicted:
        excluded[FEW] += p.predictions.possible - p.predictions.rows.size
        keep = np.ones(p.predictions.rows.size, bool)
        if why := _left_out(c, p, [q.name for q, _ in chosen]):
            excluded[why] = excluded.get(why, 0) + keep.size
            left_out[p.name] = why
            continue
        for signal, (low, high) in c.operating_range.items():
            if signal not in p.signals:
                hint = nearest(signal, p.signals)
                where = f"criterion '{c.title}': operating_range"
                raise InputError(f"{where}: run {p.name} has no '{signal}'{hint}")
            inside = (p.signals[signal] >= low) & (p.signals[signal] <= high)
            why = f"mean {signal} not from {low:g} to {high:g}"
            excluded[why] = excluded.get(why, 0) + int(np.sum(keep & ~inside))
            keep &= inside
        if keep.any():
            chosen.append((p, keep))
        else:
            left_out[p.name] = f"no window has {_limits(c)}"
    offered = sum(p.predictions.possible for p in predicted) + sum(short.values())
    excluded = {why: count for why, count in excluded.items() if count}
    windows = sum(int(rows.sum()) for _, rows in chosen)
    return chosen, WindowCounts(offered, windows, excluded, [p.name for p, _ in chosen], left_out)


def _left_out(c: Criterion, p: Predicted, before: Sequence[str]) -> str:
    """Why a run does not count, of which others count before it; empty where it does."""
    if c.runs is not None and p.name not in c.runs:
        return "not among the runs of the criterion"
    if p.learned and not c.training_runs:
        return LEARNED
    again = next((name for name in before if name in p.same), None)
    return f"the same motion as {again}, which counts" if again else ""


def _why_nothing(c: Criterion, counts: WindowCounts) -> str:
    whys = {*counts.left_out.values()}
    if c.operating_range and any(why.startswith("no window") for why in whys):
        return f"outside the data: no window has {_limits(c)}"
    if LEARNED in whys:
        return "every run was used to learn the model (training_runs lets such runs count)"
    return f"no run has a window of {c.horizon:g} s with enough samples"


def _limits(c: Criterion) -> str:
    return ", ".join(f"{s} from {a:g} to {b:g}" for s, (a, b) in c.operating_range.items())


def _too_early(c: Criterion, after: np.ndarray) -> str:
    """A sentence where the samples that are judged are well before the horizon; else nothing."""
    if np.mean(after) >= (1.0 - NEGLIGIBLE) * c.horizon:
        return ""
    return (
        f"Samples are rare: what is judged is {np.mean(after):.3g} s after the start of a prediction in "
        f"the mean, not {c.horizon:g} s; errors there may be larger."
    )


def _too_good(quantity: str, errors: np.ndarray, n: float, b: Budget) -> str:
    """A sentence where errors (w,) are far smaller than the measurement's own; else nothing."""
    parts = 2 if quantity == "position" else 1  # independent errors of a measurement
    rms, u_D = float(np.sqrt(np.mean(errors**2))), b.u_D
    if not rms < FAR_BELOW * u_D or chdtr(n * parts, n * parts * (rms / u_D) ** 2) > CHANCE:
        return ""
    return (
        f"The error of {quantity} (RMS {rms:.3g}) is far below the uncertainty of its measurement "
        f"(u_D = {u_D:.3g}, SI). Either the model used the measurement, or u_D is too large."
    )
