"""Confidence of a finding: the posterior probability that it is a true cause.

It allows for causes outside of the list of candidates. A logistic regression makes it of the evidence of
the search (:mod:`diagnosis.search.effect_evidence`). What the evidence does not know caps it: a value at
the limit of its range, an interval that holds zero or is near it, an alternative that looks the same,
laws that make up another one, effects and coefficients that explain as much without it, coefficients
beyond their priors, a smoothing that is slower than a filter, two fits that disagree. A residual on the
same axes does so by its size, beside what the nearest other candidate would leave.
"""

from collections.abc import Collection, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from ..predictors import Model, WeakWindows
from ..predictors.uncertainty import MEASURED
from ..runs.cleaning import Z95
from ..runs.run_constants import DIGITS, EVERY, FAR_OFF
from ..search.effect_evidence import EffectEvidence, with_unknown_cause
from ..search.findings import Finding
from ..search.refinement import at_limit

# 1, constants of the logistic map, to be fitted by benchmarks.hidden_effects on other seeds and effects
# than its reliability diagram shows. These are first values, chosen: 0.99 without any doubt, one half
# where a third of what the effect explains is left, or its size varies by as much.
SURE = 4.6
PER_DOUBT = 14.0  # 1, of the shares that are left and vary; as the one before
FOUND = 0.8  # 1, confidence from which on an effect is found; contract
# 1, confidence at the most where an unknown alternative is as likely as the effect; that of a set of
# effects from which on the set is a finding, and not only a possibility; contract.
EVEN_ODDS = 0.5
MAY_BE_NONE = "the intervals of all its values include zero"
NEAR_NONE = "its values are known so badly that of all candidates one may be as far from zero by chance"
AT_REST = "it has a force at zero speed, as a constant force next to a drag has"
MAY_BE_LAGS = "faster actuators than described, or measured states as commands, have the same effect"
MAY_BE_CLOCK = "a channel was not used that indicates another clock rate, which may have the same effect"
MAY_BE_MISREAD = (
    "a run may be meant otherwise than it was read, as its note says; --anyway states that it is right"
)
RARE = "samples are too rare for fast forces: fewer than six in the averaging time of a force"
IN_PARTS = "changes of one kind on the same axis make up a law of another shape as well"
ON_ONE_LINE = "with another finding it makes up a force of another shape on the same line as well"
RESIDUAL = "a residual that it does not explain acts on the same axis"
RIVAL = "it explains the same as another finding that is not sure"
SMOOTHED = "the noise is smoothed over a longer time than that of the filter, with the same effect"
DEPENDS_ON_UNSURE = "without the findings that are not sure, another effect explains as much"
NO_GAIN = "without it, calibrated coefficients predict data left out of the fit as well"
IMPLAUSIBLE = "other coefficients are beyond their priors in the model with it"
SHAPE_CORRECTED = "it and a far smaller effect on the same axes make up a force of another shape as well"
OF_SEVERAL = "the same of another actuator changes by half as much or more in the model with it"
LESS_THAN_POSSIBLE = "what explains more of the error, in the model with it, is not sure"
DIFFERING = "fitted to accelerations it has another value than fitted to predictions"
MODULATED = "{}, which is not among the candidates, explains as much"
REPLACEABLE = "the other effects and coefficients explain as much without it"


class Doubts(NamedTuple):
    """What speaks against the findings of a model in addition to their evidence.

    Attributes:
        residual: axes on which the learned model leaves a significant residual.
        of_data: see :func:`doubt_of_data`.
        rivals: ids of the effects from which an unsure finding cannot be discriminated.
        of_parts: axes on which findings make up one law in parts.
        on_one_line: ids of the changes of actuators whose forces act on one line.
        replaceable: ids of the effects without which all else, fitted anew, explains as much.
        smoothed: ids of the filters that are faster than the smoothing.
        without_gain: ids of the effects that predictions do not show, as calibration predicts as well.
        depends_on_unsure: ids of the effects that took the place of another next to findings that are
            not sure.
        implausible: whether nominal coefficients are beyond their priors.
        shape_corrected: findings of which one explains far less than the other on the same axes, by
            their ids -> square of the force of the smaller one, as a share of that of the finding.
        of_several: ids of the changes of one actuator that another one shares.
        differing: ids of the effects whose values by the two fits differ by more than their intervals;
            those of a model of the right shape agree (Hausman 1978).
        next_to_possibility: findings that explain little beside a possibility with more, by their ids ->
            the probability of that possibility, without which they are none.
        more_than_waves: waves, by their ids -> mean square of the residual that they do not account for,
            as a share of that of their force.
    """

    residual: Collection[str] = ()
    of_data: str = ""
    rivals: Collection[str] = ()
    of_parts: Collection[str] = ()
    on_one_line: Collection[str] = ()
    replaceable: Collection[str] = ()
    smoothed: Collection[str] = ()
    without_gain: Collection[str] = ()
    depends_on_unsure: Collection[str] = ()
    implausible: bool = False
    shape_corrected: Mapping[str, float] = MappingProxyType({})
    of_several: Collection[str] = ()
    differing: Collection[str] = ()
    next_to_possibility: Mapping[str, float] = MappingProxyType({})
    more_than_waves: Mapping[str, float] = MappingProxyType({})


NO_DOUBTS = Doubts()


class Confidence(NamedTuple):
    """How sure a finding is.

    Attributes:
        own: probability that the effect is a true cause; NaN where the method has none.
        of_set: the same that it or one of those it cannot be distinguished from is.
        doubt: what speaks against it in addition to the evidence, as a part of a sentence.
    """

    own: float
    of_set: float
    doubt: str = ""

    @property
    def is_finding(self) -> bool:
        """Whether this is a finding, and not only a possibility; one without confidence is a finding."""
        return not self.of_set < EVEN_ODDS


def probability(e: EffectEvidence) -> float:
    """Probability that an effect with this evidence is a true cause."""
    a_candidate_is_right = expit(SURE - PER_DOUBT * (e.left + e.varies))
    return float(e.bagged * a_candidate_is_right)


def confidence_of(f: Finding, start: Model, doubts: Doubts = NO_DOUBTS) -> Confidence:
    """The confidence of a finding.

    Args:
        f: the finding; without evidence, what its method says of it stands.
        start: the initial model.
        doubts: of the model with it.
    """
    own = f.confidence
    of_set = own if np.isnan(f.together) else f.together
    if f.evidence is not None and f.set_evidence is not None:
        own, of_set = probability(f.evidence), probability(f.set_evidence)
    if limits := at_limit(start, f.id, f.values):
        return Confidence(0.0, 0.0, " and ".join(map(str, limits)))
    effect = start.ship.effects[f.id]
    axes = set(effect.axis)
    # Each shows an alternative that is as likely as the effect or its set.
    all_doubts = {
        MAY_BE_NONE: may_be_none(f),
        AT_REST: acts_at_rest(f, start),
        MAY_BE_LAGS: _may_be_lags(f, start),
        doubts.of_data: bool(doubts.of_data),
        RIVAL: f.id in doubts.rivals,
        IN_PARTS: effect.kind == "force" and not axes.isdisjoint(doubts.of_parts),
        ON_ONE_LINE: f.id in doubts.on_one_line,
        IMPLAUSIBLE: doubts.implausible,
        OF_SEVERAL: f.id in doubts.of_several,
        LESS_THAN_POSSIBLE: f.id in doubts.next_to_possibility,
        DIFFERING: f.id in doubts.differing,
        REPLACEABLE: f.id in doubts.replaceable,
        SMOOTHED: f.id in doubts.smoothed,
        DEPENDS_ON_UNSURE: f.id in doubts.depends_on_unsure,
        NO_GAIN: f.id in doubts.without_gain,
    }
    caps = {text: EVEN_ODDS for text, holds in all_doubts.items() if holds}
    caps[NEAR_NONE] = most_by_intervals(f, start)
    if f.evidence is not None and f.modulation:
        caps[MODULATED.format(f.modulation)] = f.evidence.listed
    if f.id in doubts.shape_corrected:  # what the smaller one explains is a residual of the larger
        nearest = 0.0 if f.evidence is None else f.evidence.nearest
        caps[SHAPE_CORRECTED] = with_unknown_cause(doubts.shape_corrected[f.id], nearest)
    if f.id in doubts.more_than_waves:  # no candidate is like waves
        caps[RESIDUAL] = with_unknown_cause(doubts.more_than_waves[f.id], 1.0)
    # Waves are a residual themselves.
    if effect.search.by != "spectrum" and not axes.isdisjoint(doubts.residual):
        e = f.evidence
        caps[RESIDUAL] = EVEN_ODDS if e is None else with_unknown_cause(e.remains**2, e.nearest)
    most, rest = min(caps.values()), doubts.next_to_possibility.get(f.id, 1.0)
    doubt = min(caps, key=caps.__getitem__) if own > most or of_set > most else ""
    return Confidence(min(own * rest, most), min(of_set * rest, most), doubt)


def doubt_of_data(runs: Sequence[WeakWindows]) -> str:
    """What speaks against any finding of some runs, as a part of a sentence; empty: nothing.

    A clock may be so far off that it looks like another model: forces go with the square of its rate,
    and it matters where that is more than what a measured coefficient is uncertain by. A file may be
    read otherwise than it is meant: a unit or a sign acts like another model, too. Samples may be
    rarer than six in a window, so that a quick force is one sample's step.
    """
    found = [f for w in runs if w.smoothed.sensors for f in w.smoothed.sensors.findings]
    rates = [f.value for f in found if f.aside and "clock_rate" in f.alike]
    if any(abs(rate**2 - 1.0) > MEASURED for rate in rates):
        return MAY_BE_CLOCK
    if any(w.smoothed.misread for w in runs):
        return MAY_BE_MISREAD
    tracks = [w.smoothed.track for w in runs]
    return RARE if any(t.period > EVERY * t.scale.time + DIGITS for t in tracks) else ""


def most_by_intervals(f: Finding, start: Model) -> float:
    """The probability at most, by the intervals of its values, that these are not zero but for chance.

    The evidence of values z standard deviations from zero is at the most exp(z^2 / 2) times that of
    zero, whatever is known of them before (Edwards, Lindman and Savage, Psychol. Rev. 70, 1963).
    Before the data it is even odds that an effect is missing, which all candidates share.
    """
    squares = [from_zero(low, high) ** 2 for low, high in f.ci95.values() if high > low]
    if not squares or len(squares) < len(f.values):
        return 1.0
    evidence = 0.5 * sum(squares)
    return max(EVEN_ODDS, float(expit(evidence - np.log(len(start.ship.candidates)))))


def from_zero(low: float, high: float) -> float:
    """Standard deviations by which a value is from zero, by the ends of its 95 % interval."""
    return Z95 * abs(low + high) / (high - low) if high > low else np.inf


def may_be_none(f: Finding) -> bool:
    """Whether the 95 % intervals of all its values hold zero; a value without one is known."""
    return bool(f.values) and all(
        name in f.ci95 and f.ci95[name][0] <= 0.0 <= f.ci95[name][1] for name in f.values
    )


def acts_at_rest(f: Finding, start: Model) -> bool:
    """Whether a free curve of the hull's force is not zero at zero speed, which is its middle node."""
    effect = start.ship.effects[f.id]
    if effect.kind != "force" or not effect.search.smooth:
        return False
    nodes = effect.coefficients
    interval = f.ci95.get(nodes[len(nodes) // 2])
    return interval is not None and from_zero(*interval) > FAR_OFF


def _may_be_lags(f: Finding, start: Model) -> bool:
    """Whether commands that are logged late or filtered would make up for lags that are too long."""
    late = f.values.get("command_lag", -f.values.get("clock_offset", 0.0))
    return 0.0 < late <= max(start.lags.values(), default=0.0)
