"""The judgement: evidence of a search and data that decide in, one verdict out."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from ..assessment.regions import find_regions
from ..assessment.residual.recurrence import recurrence
from ..assessment.residual.remainder import Remainder, noise_of, remainder_sentence, remaining
from ..assessment.stability import OperatingRegion, driven_on
from ..execution.progress import Advance
from ..execution.short_text import ShortRepr
from ..predictors import Model, WeakWindows, omega
from ..predictors.evaluation import Bands
from ..predictors.uncertainty import corner_frequency
from ..predictors.windows import Windows
from ..runs import Smoothed
from ..search.findings import Finding, Findings
from ..search.prediction_fit.coefficient_calibration import HEADING
from ..search.prediction_fit.disturbance_summary import Unrecorded
from ..search.prediction_fit.joint_posterior import JointPosterior
from ..search.prediction_fit.refit import RefitOutcome, prediction_bands, to_predictions
from ..search.prior import NominalPrior
from ..search.significance import predicts_worse
from .coefficients import (
    Calibrations,
    any_finding,
    any_sure,
    better_calibration,
    concluded,
    needless,
    worsens_training_runs,
)
from .confidence import FOUND, Confidence, Doubts, confidence_of, doubt_of_data
from .effects_like_coefficients import in_place_of_coefficients
from .law_in_parts import (
    in_parts,
    next_to_possibility,
    of_several,
    on_one_line,
    shape_corrected,
    squares,
)
from .prediction_gain import PredictionGain, gain_of_search, without_gain
from .pruning import NOTHING, Withdrawn, overfits, proven, prune
from .pruning_criteria import Harm
from .shares import falls_by_axis, is_random, replaceable, share_left, shares, unique_shares
from .validation_data import ValidationData

VerdictName = Literal["found", "ambiguous", "coefficients", "unexplained", "none"]


@dataclass(frozen=True, eq=False, repr=False)
class DecidedFindings(ShortRepr):
    """What a model lacks, as the runs that decide have it.

    Attributes:
        learned: the findings with their confidence, and the model with them.
        withdrawn: effects that were accepted and rejected afterwards.
        remainder: what the learned model leaves; where nothing was learned, the first one.
        refitted: whether the learned model has other nominal coefficients and no effect.
        dropped: effects that are not in the learned model: they were accepted, but no data prove their
            gain, or coefficients do as well, or they act like a coefficient that is beyond its prior.
        shares: for each finding the share of the error's sum of squares that it explains.
        unique: for each the share that nothing else explains; None where that is not known.
        posterior: of all fitted values; of none where nothing was learned.
        unrecorded: what acts on the ship and is in no command and no effect.
    """

    learned: Findings
    withdrawn: Sequence[Withdrawn]
    remainder: Remainder
    refitted: bool
    dropped: Sequence[Finding]
    shares: Sequence[float]
    unique: Sequence[float | None]
    posterior: JointPosterior
    unrecorded: Unrecorded

    @property
    def verdict(self) -> VerdictName:
        return verdict_name(self.learned, self.refitted, self.remainder)

    @property
    def calibrated(self) -> bool:
        """Whether the learned model has other coefficients, and these are no explanation."""
        return self.refitted and self.verdict == "unexplained"

    def bands(self, smoothed: Smoothed, windows: Windows | None) -> Bands | None:
        """The bands about the learned model's predictions of a run; None: it has no window."""
        disturbance = self.unrecorded.disturbance
        return prediction_bands(smoothed, windows, self.learned.model, self.posterior, disturbance)

    @property
    def believed(self) -> list[bool]:
        """Of each effect of the learned model whether it is a finding, or a possibility."""
        return [is_finding(f) for f in self.learned.effects]

    @property
    def changed(self) -> bool:
        """Whether the learned model differs from the initial one."""
        return bool(self.learned.effects) or self.refitted


def is_finding(f: Finding) -> bool:
    """Whether an effect with its confidence is a finding, and not only a possibility."""
    return Confidence(f.confidence, f.together).is_finding


def verdict_name(learned: Findings, refitted: bool, remainder: Remainder) -> VerdictName:
    """The verdict in a word, by the one rule that JSON, terminal and page follow.

    Coefficients explain the data if the learned model has no imperfection and no current in addition.
    """
    first = next(filter(is_finding, learned.effects), None)
    if first is not None:
        return "found" if first.confidence >= FOUND else "ambiguous"
    if refitted and learned.plausible and not remainder.significant and not has_more(learned):
        return "coefficients"
    return "unexplained" if remainder.significant or learned.effects or refitted else "none"


def has_more(learned: Findings) -> bool:
    """Whether a calibrated model has imperfections or a current in addition to coefficients.

    The axis of the heading is part of what the coefficients are relative to.
    """
    at = learned.estimate
    if at is None or learned.effects:
        return False
    others = at.values.keys() - {HEADING}
    effects = at.start.ship.effects.values()
    return any(others & {*e.coefficients} for e in effects if e.usual or e.kind == "environment")


def judge(
    found: Findings,
    data: ValidationData,
    prior: NominalPrior,
    criterion: Harm,
    region: OperatingRegion,
    calibrates: bool,
    calibration: RefitOutcome | None,
    advance: Advance,
) -> tuple[DecidedFindings, PredictionGain | None]:
    """Judge what a search found: prune, conclude, fit to predictions, calibrate, say how sure it is.

    Args:
        found: the evidence of the search.
        data: the data that decide.
        prior: of the nominal coefficients.
        criterion: of pruning.
        region: motions that the training runs hold.
        calibrates: whether coefficients may take the place of effects that are no findings.
        calibration: the nominal coefficients fitted without an effect; None: there are none.
        advance: receives the name of each step when it begins.

    Returns:
        What the runs that decide say, and the gain of the search over calibration; None: not known.
    """
    start, train = data.start, data.train
    advance("effects without which validation data are predicted better")
    drives = partial(driven_on, region=region)
    kept, withdrawn = prune(found, data, drives, criterion)
    kept, unproven = proven(kept, data, criterion)
    ended, refitted, replaced = concluded(kept, data, prior)
    dropped = [*unproven, *replaced]
    changed = bool(ended.effects) or refitted
    if changed:
        advance("fit to predictions")
    fit = to_predictions(ended, train, prior, changed)
    if changed and overfits(fit.findings, ended, data, criterion):
        fit = fit.about(ended, prior)
    left = {f.id for f in fit.findings.effects}
    withdrawn += [Withdrawn(f.id, NOTHING) for f in ended.effects if f.id not in left]
    end = _Fitted(fit, data, changed, refitted or (changed and not left))
    gain, unshown = None, set[str]()
    if calibrates:
        advance("gain of the search over calibration")
        gain = end.gain_over(calibration)
        plausible = calibration is not None and calibration.findings.plausible
        unshown = without_gain(gain, fit.findings, start, train, prior, plausible)
    advance("residual")
    doubted = _in_doubt(end, unshown)
    if calibrates:
        calibrations = Calibrations(found, data, prior, calibration)
        other = _coefficients_alone(end, doubted.learned, calibrations, drives, gain, unshown)
        if other is not None:
            dropped += fit.findings.effects
            ranked = replace(other.fit.findings, ranking=found.ranking)
            end = replace(other, fit=replace(other.fit, findings=ranked))
            gain, doubted = end.gain_over(calibration), _in_doubt(end, set())
    if end.changed:
        known = {f.id for f in dropped}
        alike = in_place_of_coefficients(end.fit, train, start, prior)
        dropped += [f for f in alike if f.id not in known]
    return replace(doubted, withdrawn=withdrawn, dropped=dropped), gain


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A model that may be the end of a search: its fit, and what it differs from the initial one by.

    Attributes:
        fit: to predictions.
        data: the data that decide.
        changed: whether it differs from the initial model.
        refitted: whether it has other nominal coefficients and no effect.
    """

    fit: RefitOutcome
    data: ValidationData
    changed: bool
    refitted: bool

    @property
    def predicting(self) -> Findings | Model:
        """What the data that decide judge; of their folds each has a fit of the findings."""
        if not self.changed:
            return self.data.start
        found = self.fit.findings
        return found.model if self.data.validate else found

    def gain_over(self, calibration: RefitOutcome | None) -> PredictionGain | None:
        """What predictions gain by it, over calibration alone."""
        coefficients = calibration and calibration.findings
        return gain_of_search(self.data, coefficients, self.fit.findings, self.predicting)


def _coefficients_alone(
    end: _Fitted,
    learned: Findings,
    calibrations: Calibrations,
    drives: Callable[[Model, Model], Collection[str]],
    gain: PredictionGain | None,
    unshown: Collection[str],
) -> _Fitted | None:
    """The calibrated model, or the initial one, that takes the place of effects; None: these stay.

    Of effects that do not stay the calibrated model has the place where it predicts better than the
    initial one, even if it fits the data less than these effects do.

    Args:
        end: the end of the search.
        learned: its findings with their confidence.
        calibrations: models of other coefficients.
        drives: see :func:`better_calibration`.
        gain: of the search over the calibration.
        unshown: ids of the findings that predictions do not show.
    """
    data, found = end.data, end.fit.findings
    other = None if any_finding(found, data.start) else calibrations.in_place_of(found)
    if other is None and not any_sure(learned):
        believed = not learned.effects or any(map(is_finding, learned.effects))
        gained = gain is None or gain.gained
        now = end.predicting
        alone = calibrations.coefficients
        other = better_calibration(alone, now, data, drives, unshown, believed, gained)
    if other is not None:
        return _Fitted(other, data, True, True)
    if not found.effects:
        return None
    idle = needless(found, unshown) and not predicts_worse(*data.losses(data.start, end.predicting))
    if not idle and (any(map(is_finding, learned.effects)) or not worsens_training_runs(found, data)):
        return None
    nothing = replace(found, effects=[], model=data.start, suspects=[], moved={})
    fit = to_predictions(nothing, data.train, calibrations.prior, False)
    initial = _Fitted(fit, data, False, False)
    return _coefficients_alone(initial, nothing, calibrations, drives, None, ()) or initial


def _in_doubt(end: _Fitted, unshown: Collection[str]) -> DecidedFindings:
    """A model with the confidence of its findings, what it leaves and explains; no effect is rejected.

    ``unshown`` are the ids of the findings that predictions do not show.
    """
    found, data = end.fit.findings, end.data
    start, train = data.start, data.train
    # What fails at times of its own in a validation run says nothing of what was learned of others.
    judged = train if found.model.runs else data.runs
    remainder = remainder_of(judged, start, found)
    explained = shares(found, start, data.validate)
    alone = unique_shares(found, start, train, data.validate)
    doubts = Doubts(
        residual=unexplained_axes(found, remainder, start),
        more_than_waves=more_than_waves(found, remainder, start),
        of_data=doubt_of_data(train),
        replaceable=replaceable(
            found, explained, alone, share_left(found, start, data.validate or train)
        ),
        on_one_line=on_one_line(found, start, train),
        of_several=of_several(found, start),
        smoothed=faster_than_smoothing(found, start, train),
        without_gain=unshown,
        differing=differing(end.fit),
        implausible=not found.plausible,
    )
    each = [confidence_of(f, start, doubts) for f in found.effects]
    doubts = doubts._replace(
        shape_corrected=shape_corrected(
            found, start, falls_by_axis(found, start, train), squares(found, train), each
        ),
        next_to_possibility=next_to_possibility(found, explained, each),
    )
    return DecidedFindings(
        learned=with_confidence(found, start, doubts),
        withdrawn=(),
        remainder=remainder,
        refitted=end.refitted,
        dropped=(),
        shares=explained,
        unique=alone,
        posterior=end.fit.posterior,
        unrecorded=end.fit.unrecorded,
    )


def unexplained_axes(found: Findings, remainder: Remainder, start: Model) -> set[str]:
    """Axes with a significant residual; where waves are sure, which account for it, with a slow one."""
    waves = [f for f in found.effects if is_random(f, start)]
    are_sure = any(confidence_of(f, start).own >= FOUND for f in waves)
    return {axis for axis, r in remainder.axes.items() if r.significant and (r.is_slow or not are_sure)}


def more_than_waves(found: Findings, remainder: Remainder, start: Model) -> dict[str, float]:
    """Waves beside a residual that they do not account for, by their ids.

    The spectrum of what no effect explains may have a peak by chance, or where the ship is steered.

    Returns:
        Id -> mean square of the horizontal residual beyond noise and waves, as a share of the waves'.
    """
    left = [r for axis, r in remainder.axes.items() if axis in "XY" and r.significant]
    square = sum(r.rms**2 - r.uncertainty**2 for r in left)
    waves = {f.id: f.values["wave_force"] ** 2 for f in found.effects if is_random(f, start)}
    return {i: square / own - 1.0 for i, own in waves.items() if square > own}


def differing(fit: RefitOutcome) -> set[str]:
    """The effects with a value that the two fits differ in by more than their intervals."""
    values = fit.unrecorded.differing.keys()
    return {f.id for f in fit.findings.effects if not values.isdisjoint(f.values)}


def faster_than_smoothing(found: Findings, start: Model, runs: Sequence[WeakWindows]) -> set[str]:
    """The tracking filters with corner frequencies above those of the smoothing, in all runs.

    At low frequencies w both take w^2 off a motion, without a lag: where the smoothing ends below the
    filter's corner 1 / T, the data hold nothing that discriminates them.
    """
    trackers = {f.id: np.array(start.plus(f.values).filters.tracker) for f in found.effects}
    changed = {i: np.array(start.filters.tracker) != T for i, T in trackers.items()}
    if not any(map(np.any, changed.values())):
        return set()
    corner = np.max([np.median(corner_frequency(w), axis=0) for w in runs], axis=0)
    return {i for i, own in changed.items() if own.any() and (trackers[i] * corner < 1.0)[own].all()}


def with_confidence(found: Findings, start: Model, doubts: Doubts) -> Findings:
    """The findings with their confidence: the one place where it is set.

    Each of the doubts that holds for an effect makes it even odds at the most.
    """
    alone = [confidence_of(f, start, doubts) for f in found.effects]
    doubts = doubts._replace(
        of_parts=in_parts(found, start, alone),
        rivals={i for f, c in zip(found.effects, alone, strict=True) if c.own < FOUND for i in f.alike},
    )
    each = [confidence_of(f, start, doubts) for f in found.effects]
    doubts = doubts._replace(depends_on_unsure=depends_on_unsure(found, each))
    effects = []
    for f in found.effects:
        c = confidence_of(f, start, doubts)
        alike = [
            *f.alike,
            *(i for i in f.instead_of if f.id in doubts.depends_on_unsure and i not in f.alike),
        ]
        effects.append(replace(f, confidence=c.own, together=c.of_set, doubt=c.doubt, alike=alike))
    return replace(found, effects=effects)


def depends_on_unsure(found: Findings, each: Sequence[Confidence]) -> set[str]:
    """The effects that took the place of another beside findings that are not sure, or not left."""
    sure = {f.id for f, c in zip(found.effects, each, strict=True) if c.own >= FOUND}
    return {f.id for f in found.effects if f.instead_of and not sure.issuperset(f.beside)}


def remainder_of(runs: Sequence[WeakWindows], start: Model, learned: Findings) -> Remainder:
    """What the learned model leaves in the runs that decide, in numbers and words."""
    model = learned.model
    axes, left = remaining(runs, start, model), [omega(w, model) for w in runs]
    significant = any(axis.significant for axis in axes.values())
    how = recurrence(runs, np.concatenate(left)) if significant else None
    regions = find_regions(runs, left, noise_of(runs, start, model)).regions
    waves = any(is_random(f, start) for f in learned.effects)
    return Remainder(axes, remainder_sentence(axes, how, regions, waves, runs[0].scale))
