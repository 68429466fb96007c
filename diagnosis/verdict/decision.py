"""What a diagnosis comes to: which model, what that leaves, and what is believed of the findings."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, NamedTuple

import numpy as np

from ..assessment.recurrence import recurrence
from ..assessment.regions import Region
from ..assessment.remainder import AxisRemainder, Remainder, axis_remainders
from ..assessment.remainder_text import remainder_sentence
from ..predictors import Model, WeakWindows, omega
from ..predictors.evaluation import Evaluation
from ..predictors.uncertainty import omega_std
from ..search.findings import Finding, Findings
from ..search.prior import NominalPrior
from ..search.refinement import at_limit
from .pruning import AT_LIMIT, Unseen, without
from .validation_data import harm

Verdict = Literal["found", "ambiguous", "coefficients", "unexplained", "none"]

# Confidence from which on an effect is found; and of its set from which on the set is a finding, else it
# is a possibility; contract.
FOUND, BELIEVED = 0.8, 0.5
# Confidence at the most where something acts on the axes of an effect that it does not explain: whether
# it is a cause or stands in for a part of the other is even odds, as long as the other is not known.
EVEN_ODDS = 0.5
MAY_BE_NONE = "by the interval of its value it may be nothing"
MAY_BE_LAGS = (
    "actuators that are faster than described, or commands that are measured states, look the same"
)
BESIDE = "something that it does not explain acts on the same axis"


class Conclusion(NamedTuple):
    """The model that findings amount to.

    Attributes:
        learned: the findings with that model.
        refitted: whether that is other nominal coefficients alone.
        dropped: effects that were accepted, of which the model has none.
    """

    learned: Findings
    refitted: bool
    dropped: Sequence[Finding]


def believed(f: Finding) -> bool:
    """Whether a finding is one, and no mere possibility; a method without confidence is believed."""
    return not f.together < BELIEVED


def verdict(learned: Findings, refitted: bool, remainder: Remainder) -> Verdict:
    """The verdict, by the one rule that all words follow."""
    told = next((f for f in learned.effects if believed(f)), None)
    if told is not None:
        return "found" if told.confidence >= FOUND else "ambiguous"
    if refitted and learned.plausible and not remainder.significant:
        return "coefficients"
    return "unexplained" if remainder.significant or learned.effects or refitted else "none"


def concluded(
    found: Findings,
    runs: Sequence[WeakWindows],
    unseen: Unseen,
    start: Model,
    prior: NominalPrior,
) -> Conclusion:
    """The model that the findings amount to.

    Coefficients alone explain the data if something was missing, nothing is with them, none is further
    than MOST_MOVED from what is believed of it where its value is from, and unseen data are not worse
    than without. They then take the place of effects of which none is believed, if unseen data are not
    worse either.

    Args:
        found: what is left of the findings after the withdrawal.
        runs: all runs.
        unseen: the data that decide.
        start: the model at first.
        prior: of the nominal coefficients, as where their values are from has it.
    """
    if any(believed(f) for f in found.effects) or (found.effects and found.refit is None):
        return Conclusion(found, False, [])
    alone = without(found, [f.id for f in found.effects], start) if found.effects else found
    other = alone.refitted
    if other is not None and alone.plausible_by(prior):
        missing, left = (something_left(runs, start, m) for m in (start, other))
        before = [found, start] if found.effects else [start]
        if missing and not left and unseen.judges(alone):
            now, *others = unseen.losses(alone, *before)
            if not any(harm(now, each) for each in others):
                return Conclusion(replace(alone, model=other), True, found.effects)
    if found.effects:
        return Conclusion(found, False, [])
    return Conclusion(replace(found, model=start, suspects=[]), False, [])


def limited(f: Finding, start: Model) -> Finding:
    """A finding; with a value at the limit of its range it is none.

    One that may as well be nothing at all, by the interval of its only value, is even odds at the most,
    and so is a pose that is younger than its stamp by no more than the described lags of the actuators.
    """
    at = at_limit(start, f.id, f.values)
    if not at:
        doubt = MAY_BE_NONE if _may_be_none(f) else MAY_BE_LAGS if _may_be_lags(f, start) else None
        return f if doubt is None else replace(f, confidence=min(f.confidence, EVEN_ODDS), doubt=doubt)
    return replace(f, confidence=0.0, together=0.0, doubt=AT_LIMIT.format(" and ".join(at)))


def _may_be_none(f: Finding) -> bool:
    """Whether the 95 % interval of the only value holds zero, though it is more sure than even odds."""
    if len(f.values) != 1 or not f.confidence > EVEN_ODDS:
        return False
    low, high = f.ci95.get(next(iter(f.values)), (np.nan, np.nan))
    return low <= 0.0 <= high


def _may_be_lags(f: Finding, start: Model) -> bool:
    """Whether a clock that is ahead would make up for lags of the actuators that are too long."""
    lags = [start.value(n) for n in start.ship.coefficients if start.declared(n).unit == "s"]
    return -max(lags, default=0.0) <= f.values.get("clock_offset", 0.0) < 0.0


def doubted(learned: Findings, remainder: Remainder, start: Model) -> Findings:
    """The findings; those on whose axes a significant remainder is are even odds at the most.

    Waves are a remainder themselves, and account for the one that is left beside them.
    """
    effects = start.ship.effects
    left = {axis for axis, r in remainder.axes.items() if r.significant}
    if any(effects[f.id].search.by == "spectrum" and f.confidence >= FOUND for f in learned.effects):
        return learned

    def capped(f: Finding) -> Finding:
        effect = effects[f.id]
        if effect.search.by == "spectrum" or not left & set(effect.axis) or not f.confidence > EVEN_ODDS:
            return f
        return replace(f, confidence=EVEN_ODDS, together=EVEN_ODDS, doubt=BESIDE)

    return replace(learned, effects=[capped(f) for f in learned.effects])


def _any(axes: Mapping[str, AxisRemainder]) -> bool:
    return any(a.significant for a in axes.values())


def something_left(runs: Sequence[WeakWindows], start: Model, model: Model) -> bool:
    """Whether a model leaves a significant remainder, beside what the first one leaves."""
    before, after = ([omega(w, m) for w in runs] for m in (start, model))
    return _any(axis_remainders(runs, before, after, [omega_std(w, start) for w in runs], start))


def remainder_of(
    evaluations: Sequence[Evaluation],
    std: Sequence[np.ndarray],
    regions: Sequence[Region],
    learned: Findings,
) -> Remainder:
    """What the learned model leaves, in numbers and words.

    Args:
        evaluations: one for each run, held-out runs included.
        std: of each run the standard deviation (K, 3) of its model error [N, N, N m].
        regions: where the learned model fails.
        learned: the findings.
    """
    data, left = [e.weak_windows for e in evaluations], [e.after.omega for e in evaluations]
    first = [e.before.omega for e in evaluations]
    axes = axis_remainders(data, first, left, std, evaluations[0].model)
    how = recurrence(data, np.concatenate(left)) if _any(axes) else None
    effects = learned.model.ship.effects
    waves = any(effects[f.id].search.by == "spectrum" for f in learned.effects)
    return Remainder(axes, remainder_sentence(axes, how, regions, waves, data[0].scale))
