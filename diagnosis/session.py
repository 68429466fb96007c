"""The two tasks of the commands as functions: evaluate a model on runs, and diagnose what it lacks."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.linalg import LinAlgError
from typing_extensions import deprecated

from cosim import InputError

from .assessment.regions import ErrorRegions, find_regions
from .assessment.remainder import Remainder
from .assessment.stability import OperatingRegion, Stability, check_stability, drives_on
from .execution.parallel import for_each
from .execution.progress import Advance, silent
from .predictors import (
    Bands,
    DescribedShip,
    Evaluation,
    Model,
    ModelSource,
    Predictor,
    WeakWindows,
    evaluate_run,
    nominal,
    omega,
    open_model,
    told_apart,
)
from .predictors.uncertainty import omega_std
from .predictors.weak_form import BLOCK
from .search import DEFAULT, Method, Prior, method
from .search.findings import Finding, Findings
from .search.prediction_fit.disturbance_summary import Unrecorded
from .search.prediction_fit.joint_posterior import Posterior
from .search.prediction_fit.predicted_bands import prediction_bands
from .search.prediction_fit.refit import to_predictions
from .search.prior import NominalPrior
from .search.prior import shares as prior_shares
from .verdict.calibrated_model import calibrated
from .verdict.decision import Verdict, believed, concluded, doubted, limited, remainder_of, verdict
from .verdict.pruning import NOTHING, Unseen, Withdrawn, unique_shares, withdraw
from .verdict.validation_data import harm

MIN_BLOCKS = 4  # of the training runs, so that cross-validation has folds: 60 s; chosen
REACHED = 0.9  # quantile of |nu| that counts as a speed that the ship reached; chosen


@dataclass(frozen=True, eq=False)
class Comparison:
    """The error of a model, or of the initial and the learned one, on measured runs.

    Attributes:
        evaluations: one for each run.
        omega_std: of each run the standard deviation (K, 3) of its model error [N, N, N m].
        predictor: what predicts the runs; of two models the initial one.
    """

    evaluations: Sequence[Evaluation]
    omega_std: Sequence[np.ndarray]
    predictor: Predictor

    @property
    @deprecated("Use predictor.")
    def use(self) -> Predictor | None:
        return None if self.predictor.parametric else self.predictor

    @cached_property
    def before(self) -> ErrorRegions:
        """Where the initial model fails."""
        return self._regions([e.before.omega for e in self.evaluations])

    @cached_property
    def after(self) -> ErrorRegions:
        """Where the learned model still fails."""
        return self._regions([e.after.omega for e in self.evaluations])

    def _regions(self, errors: Sequence[np.ndarray]) -> ErrorRegions:
        return find_regions([e.weak_windows for e in self.evaluations], errors, self.omega_std)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """What a model lacks, as learned from some runs.

    Attributes:
        learned: the findings, and the model with them.
        withdrawn: effects that were accepted and taken back.
        remainder: what the learned model leaves; where nothing was learned, the first one.
        refitted: whether the learned model has other nominal coefficients and no effect.
        dropped: effects that were accepted, where the learned model has other coefficients instead.
        shares: for each finding the share of the error's sum of squares that it explains.
        unique: for each the share that nothing else explains; None where that cannot be told.
        comparison: errors before and after, on the training runs and then on those held out.
        start: the initial model.
        stability: of the learned model.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
        prior: of the nominal coefficients, as it was given.
        seed: of everything random.
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
    comparison: Comparison
    start: Model
    stability: Stability
    speeds: tuple[float, float, float]
    prior: Prior
    seed: int
    posterior: Posterior
    unrecorded: Unrecorded

    @property
    def verdict(self) -> Verdict:
        return verdict(self.learned, self.refitted, self.remainder)

    @property
    def calibrated(self) -> bool:
        """Whether the learned model has other coefficients, and these are no explanation."""
        return self.refitted and self.verdict == "unexplained"

    @property
    def believed(self) -> list[bool]:
        """Of each effect of the learned model whether it is a finding, or a possibility."""
        return [believed(f) for f in self.learned.effects]

    @property
    def sound(self) -> bool:
        """Whether the learned model has a mass and stays bounded in closed loop.

        Of a predictor that is not a model of this project that is not judged.
        """
        return not self.comparison.predictor.parametric or bool(self.stability.safe)


@contextmanager
def well_posed() -> Iterator[None]:
    """Tell an ill-posed problem as one of the data, in place of an error of linear algebra.

    Raises:
        InputError: a system of equations inside is singular or not finite.
    """
    try:
        yield
    except LinAlgError as error:
        raise InputError(f"these runs do not determine what is asked of them: {error}") from None


@well_posed()
def evaluate(
    runs: Sequence[WeakWindows],
    model: Model | ModelSource | str | Path | None = None,
    after: Model | None = None,
    held_out: Sequence[WeakWindows] = (),
    advance: Advance = silent,
) -> Comparison:
    """Compare a model, or two, with measured runs.

    Args:
        runs: see :func:`diagnosis.gather`.
        model: the nominal one of the runs' ship by default; an FMU, a Python function, or the path of
            what ``--model`` takes.
        after: the learned model; None: nothing was learned.
        held_out: further runs, of which nothing was learned.
        advance: receives the name of each step when it begins.

    Raises:
        InputError: the runs are so ill-conditioned that nothing can be computed of them; the FMU is not
            what it is taken for, or fails.
    """
    every = told_apart([*runs, *held_out])
    predictor = _source(model, every).on(every, advance)
    return _compared(predictor, every[: len(runs)], after, every[len(runs) :], advance)


def _source(model: Model | ModelSource | str | Path | None, runs: Sequence[WeakWindows]) -> ModelSource:
    """The model of some runs as a source of predictions; the nominal one by default."""
    if isinstance(model, (str, Path)):
        return open_model(model)
    return DescribedShip(model or nominal(runs)) if model is None or isinstance(model, Model) else model


def _compared(
    predictor: Predictor,
    runs: Sequence[WeakWindows],
    after: Model | None,
    held_out: Sequence[WeakWindows],
    advance: Advance,
) -> Comparison:
    """The errors of a predictor, and of it with additions, on runs and on those held out."""
    every = [*runs, *held_out]
    advance(f"predicting {', '.join(w.run.name for w in every)}")

    def of_run(k: int) -> Evaluation:
        return evaluate_run(every[k], predictor, after, k >= len(runs))

    model = predictor.model
    known = [predictor, model, after, *every, *(w.smoothed for w in every)]
    each = range(len(every))
    evaluations = for_each(of_run, each, known) if predictor.forks else [of_run(k) for k in each]
    return Comparison(evaluations, [omega_std(w, model) for w in every], predictor)


@well_posed()
def diagnose(
    train: Sequence[WeakWindows],
    held_out: Sequence[WeakWindows] = (),
    prior: Prior = None,
    model: Model | ModelSource | str | Path | None = None,
    advance: Advance = silent,
    seed: int = 0,
    by: str | Method = DEFAULT,
) -> Diagnosis:
    """Learn what a model lacks.

    Args:
        train: runs to learn from, see :func:`diagnosis.gather`.
        held_out: runs to test on only.
        prior: relative standard deviation of every nominal coefficient, or of those named (coefficients
            or groups); 0: exact; None: by where each value comes from.
        model: the initial one; the nominal one of the runs' ship by default; an FMU, a Python function,
            or the path of what ``--model`` takes. The effects of the ship are tried in addition to it.
        advance: receives the name of each step when it begins.
        seed: of everything random.
        by: method of identification, or the name of one.

    Raises:
        InputError: too little data, or a prior that is negative, not finite, or of what is none.
    """
    source = _source(model, [*train, *held_out])
    prior_shares((source.start or nominal([*train, *held_out])).ship, prior)  # before any work
    blocks = sum(np.unique(w.block).size for w in train)
    if blocks < MIN_BLOCKS:
        block = BLOCK * train[0].scale.time
        raise InputError(
            f"too little to learn from: {blocks * block:.3g} s with thrusters at work, "
            f"at least {MIN_BLOCKS * block:.3g} s are needed"
        )
    runs = told_apart([*train, *held_out])
    train, held_out = runs[: len(train)], runs[len(train) :]
    predictor = source.on(runs, advance)
    start = predictor.model
    chosen = method(by) if isinstance(by, str) else by
    nu = np.concatenate([w.smoothed.nu[w.known] for w in train])
    region = OperatingRegion.of(nu, start.ship.scale)
    found = chosen.fit(train, start, prior, advance, seed)
    advance("what unseen data say")
    unseen = Unseen(train, held_out, start, found.sigma)
    kept, withdrawn = withdraw(found, unseen, start, lambda a, b: drives_on(a, b, region))
    kept = replace(kept, effects=[limited(f, start) for f in kept.effects])
    belief = NominalPrior.of(start, prior)
    learned, refitted, dropped = concluded(kept, [*train, *held_out], unseen, start, belief)
    advance("fit to predictions")
    something = bool(learned.effects) or refitted
    fit = to_predictions(learned, train, belief, something)
    if held_out and harm(*unseen.losses(fit.findings.model, start)):
        # The fit by the model error was held against these runs already.
        fit = fit.about(learned)
    left = {f.id for f in fit.findings.effects}
    withdrawn += [Withdrawn(f.id, NOTHING) for f in learned.effects if f.id not in left]
    refitted = refitted or (something and not left)
    if predictor.parametric and not any(believed(f) for f in fit.findings.effects):
        advance("calibration")
        alone = calibrated(fit.findings, train, held_out, start, belief)
        if alone is not None:
            dropped, refitted, something, fit = [*dropped, *fit.findings.effects], True, True, alone
    learned = replace(fit.findings, effects=[limited(f, start) for f in fit.findings.effects])
    final = learned.model if something else None
    comparison = _compared(predictor.in_windows(), train, final, held_out, advance)
    comparison = replace(comparison, predictor=predictor)

    def bands(e: Evaluation) -> Bands | None:
        return prediction_bands(e.smoothed, e.windows, learned.model, fit.posterior, fit.unrecorded.push)

    every = comparison.evaluations
    banded = [replace(e, bands=b) for e, b in zip(every, map(bands, every), strict=True)]
    comparison = replace(comparison, evaluations=banded)
    advance("what is left")
    # What fails at times of its own in a run held out says nothing of what was learned of others.
    judged = comparison.evaluations[: len(train) if learned.model.runs else None]
    std = comparison.omega_std[: len(judged)]
    remainder = remainder_of(judged, std, comparison.after.regions, learned)
    learned = doubted(learned, remainder, start)
    advance("stability")
    stability = check_stability(learned.model, start, advance, region)
    shares = _shares(learned, start, held_out)
    u, v, r = np.quantile(np.abs(nu), REACHED, axis=0).tolist()
    return Diagnosis(
        learned,
        withdrawn,
        remainder,
        refitted,
        dropped,
        shares,
        unique_shares(learned, start, comparison.evaluations),
        comparison,
        start,
        stability,
        (u, v, r),
        prior,
        seed,
        fit.posterior,
        fit.unrecorded,
    )


def _shares(learned: Findings, start: Model, held_out: Sequence[WeakWindows]) -> list[float]:
    """Share of the initial sum of squares that each finding explains; axes weighted by noise.

    Of runs held out; of times within a run, which no other run has, by cross-validation.
    """
    shares = [f.share for f in learned.effects]
    if held_out:
        models = [start, *(f.model for f in learned.effects)]
        sums = np.array(
            [sum(np.sum((omega(w, model) / learned.sigma) ** 2) for w in held_out) for model in models]
        )
        unseen = (-np.diff(sums) / sums[0]).tolist()
        shares = [
            f.share if f.of_runs else share for f, share in zip(learned.effects, unseen, strict=True)
        ]
    return [min(1.0, max(0.0, share)) for share in shares]
