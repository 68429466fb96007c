"""Nominal coefficients in place of effects: where they alone explain the data, or predict better."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtri

from ..assessment.residual.remainder import remains
from ..predictors import Model
from ..runs.run_constants import CHANCE
from ..search.findings import Finding, Findings
from ..search.gram import WHOLE_RUNS
from ..search.prediction_fit.coefficient_calibration import Calibrator
from ..search.prediction_fit.refit import RefitOutcome
from ..search.prior import NominalPrior
from ..search.significance import (
    Losses,
    as_good,
    gain,
    gain_of_predictions,
    harm,
    predicts_better,
    predicts_worse,
)
from .confidence import FOUND, confidence_of, may_be_none
from .pruning import judgeable, without
from .validation_data import ValidationData


def any_finding(found: Findings, start: Model) -> bool:
    """Whether any effect is a finding, and not only a possibility."""
    return any(confidence_of(f, start).is_finding for f in found.effects)


def any_sure(learned: Findings) -> bool:
    """Whether any effect with its confidence is a sure finding, or has none."""
    return not all(f.confidence < FOUND for f in learned.effects)


def concluded(
    found: Findings, data: ValidationData, prior: NominalPrior
) -> tuple[Findings, bool, Sequence[Finding]]:
    """The model that the findings amount to.

    Coefficients alone explain the data if something was missing, nothing is with them, none is further
    than FAR_OFF from its prior, by where its value is from, and the data that decide (each of two runs
    left out as a whole) are not worse than without. They then take the place of effects of which none
    is a finding, if these data are not worse either.

    Returns:
        The findings with that model; whether it is other nominal coefficients alone; and the effects
        that were accepted, of which the model has none.
    """
    start, unseen = data.start, data.of_other_runs
    if any_finding(found, start) or (found.effects and found.refit is None):
        return found, False, []
    alone = without(found, [f.id for f in found.effects], start) if found.effects else found
    other = alone.refitted
    judged = alone.plausible_by(prior) and unseen.judges(alone)
    if (
        other is not None
        and judged
        and remains(data.runs, start, start)
        and not remains(data.runs, start, other)
    ):
        now, *others = unseen.losses(alone, *([found, start] if found.effects else [start]))
        if not any(harm(now, each) for each in others):
            return replace(alone, model=other), True, found.effects
    if found.effects:
        return found, False, []
    return replace(found, model=start, suspects=[]), False, []


@dataclass(frozen=True, eq=False)
class Calibrations:
    """Calibrated models of the training runs, fitted once they are asked for.

    Attributes:
        searched: the end of the search.
        data: the data that decide.
        prior: of the nominal coefficients.
        coefficients: the calibration of the nominal ones alone; None: there is none.
    """

    searched: Findings
    data: ValidationData
    prior: NominalPrior
    coefficients: RefitOutcome | None

    @cached_property
    def _training(self) -> ValidationData:
        """Each training run, predicted without it."""
        return ValidationData(self.data.train, [], self.data.start, self.searched.sigma)

    @cached_property
    def best(self) -> tuple[RefitOutcome, Losses] | None:
        """The model that predicts each training run best without it; None: runs are too few, or right.

        Where coefficients leave a residual, a current is in it, and usual imperfections, each if that
        shows beyond chance, and is beyond its own uncertainty. Where the nominal coefficients alone
        are as good, they are taken.
        """
        train, start, runs = self.data.train, self.data.start, self._training
        if len(train) < WHOLE_RUNS or not any(self.prior.std.values()):
            return None
        calibrator = Calibrator(self.searched, train, start, self.prior)
        if not remains(train, start, start) or not calibrator.windows:
            return None
        best = calibrator.still()
        (now,) = runs.losses(best.findings)
        left = remains(train, start, best.findings.model)
        for further in filter(None, (calibrator.current, calibrator.imperfections) if left else ()):
            fit = calibrator.plus(best, further)
            (its,) = runs.losses(fit.findings)
            if harm(now, its) and gain(now, its) > 0.0 and _differs(fit, further):
                best, now = fit, its
        if self.coefficients is None:
            return best, now
        (plain,) = runs.losses(self.coefficients.findings)
        return (self.coefficients, plain) if as_good(plain, now) else (best, now)

    def in_place_of(self, found: Findings) -> RefitOutcome | None:
        """The best of them in place of findings than which it is as good, or predicts better.

        No effect follows from it. None: it predicts no better than they or the initial model, or
        validation runs reject it.
        """
        if self.best is None:
            return None
        (fit, now), start = self.best, self.data.start
        other, first = self._training.losses(found if found.effects else start, start)
        if found.effects:
            better = as_good(now, other) or predicts_better(now, other)
        else:
            better = gain(other, now) > 0.0
        if harm(now, first) or not better:
            return None
        its, others = self.data.losses(fit.findings.model, start)
        return None if self.data.validate and harm(its, others) else fit


def better_calibration(
    calibration: RefitOutcome | None,
    found: Findings | Model,
    data: ValidationData,
    drives: Callable[[Model, Model], Collection[str]],
    without_gain: Collection[str] = (),
    believed: bool = True,
    gained: bool = True,
) -> RefitOutcome | None:
    """The calibration of the coefficients alone, where a model without a sure finding predicts worse.

    It also takes the place of effects that predict no better, if none of them is a finding, each has
    intervals that hold zero, or the coefficients suffice.

    Args:
        calibration: the fit; None: there is none.
        found: the end of a search without a sure finding; the initial model if nothing was learned.
        data: the data that decide.
        drives: motions in which the hull of a model drives the ship on more than that of another.
        without_gain: ids of the effects that predictions do not show.
        believed: whether any effect is a finding.
        gained: whether the search predicts better than the calibration, beyond chance.

    Returns:
        None where it predicts no better, beyond chance, predicts worse than the initial model, be it by
        chance, or has a hull that drives the ship on; or the method does not fit its findings without a
        part of the data.
    """
    if isinstance(found, Findings) and not data.judges(found):
        return None
    if calibration is None or drives(calibration.findings.model, data.start):
        return None
    now, its, first = data.losses(found, calibration.findings, data.start)
    enough = not gained and (
        not believed or (not predicts_worse(its, now) and sufficient(calibration.findings, found, data))
    )
    better = needless(found, without_gain) or enough or predicts_better(its, now)
    return calibration if better and gain_of_predictions(its, first) <= 0.0 else None


def sufficient(its: Findings, found: Findings | Model, data: ValidationData) -> bool:
    """Whether coefficients within their priors leave nothing of what some effects explain.

    What the priors allow is no missing effect. Waves and failures at times of a run are none of theirs.
    """
    if isinstance(found, Findings):
        judged = judgeable(found, data.start, bool(data.validate))
        if len(judged) < len(found.effects):
            return False
    return its.plausible and not remains(data.runs, data.start, its.model)


def needless(found: Findings | Model, without_gain: Collection[str]) -> bool:
    """Whether each effect of some findings predicts no better, with intervals that hold zero."""
    effects = found.effects if isinstance(found, Findings) else []
    return bool(effects) and all(f.id in without_gain and may_be_none(f) for f in effects)


def worsens_training_runs(found: Findings, data: ValidationData) -> bool:
    """Whether effects predict any run that they were fitted to worse than the initial model does.

    What fails at times of one run is judged by no other, and may be paid for with coefficients of all.
    """
    if not found.effects:
        return False
    fitted = ValidationData(data.train, data.train, data.start, found.sigma)
    pairs = zip(*fitted.losses_of_folds(found.model, data.start), strict=True)
    return any(predicts_worse(its, first) for its, first in pairs)


def _differs(fit: RefitOutcome, parameters: Collection[str]) -> bool:
    """Whether parameters of a fit differ from zero by more than their uncertainty gives by chance."""
    known = fit.posterior
    at = [k for k, name in enumerate(known.names) if name.partition(".")[2] in parameters]
    if not at:
        return False
    V, C = known.mean[at], known.covariance[np.ix_(at, at)]
    return bool(V @ np.linalg.solve(C, V) > chdtri(len(at), CHANCE))
