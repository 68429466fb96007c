"""The two tasks of the commands as functions: evaluate a model on runs, and diagnose what it lacks."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.linalg import LinAlgError
from typing_extensions import deprecated

from cosim import InputError

from .assessment.gathering import distinctly_named
from .assessment.regions import ErrorRegions, find_regions
from .assessment.stability import OperatingRegion, Stability, check_stability
from .execution.parallel import in_halves, one_thread
from .execution.progress import Advance, silent
from .execution.short_text import ShortRepr
from .predictors import (
    DescribedShip,
    Evaluation,
    Model,
    ModelSource,
    Predictor,
    WeakWindows,
    evaluate_runs,
    nominal,
    open_model,
)
from .predictors.uncertainty import omega_std
from .predictors.weak_form import BLOCK
from .predictors.windows import WindowErrors
from .runs.run_constants import PARTS
from .search import DEFAULT, Findings, Method, Prior, method
from .search.prediction_fit.coefficient_calibration import Calibrator
from .search.prediction_fit.joint_posterior import JointPosterior
from .search.prediction_fit.other_runs import with_other_runs
from .search.prediction_fit.refit import RefitOutcome
from .search.prior import NominalPrior
from .search.prior import shares as prior_shares
from .search.significance import Losses
from .verdict.judging import DecidedFindings, judge
from .verdict.measured_commands import are_measured, with_measured_commands
from .verdict.prediction_gain import PredictionGain, prediction_gain
from .verdict.pruning_criteria import PAIRED, Harm, criterion
from .verdict.validation_data import ValidationData


@dataclass(frozen=True, eq=False, repr=False)
class Comparison(ShortRepr):
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


@dataclass(frozen=True, eq=False, repr=False)
class CalibratedModel(ShortRepr):
    """The initial model with other values of its coefficients, and without an effect.

    Attributes:
        learned: the findings, of which there are none, with the model.
        posterior: of the coefficients.
        start: the initial model.
        comparison: errors of the initial and of the calibrated model.
        gain: what it gains over the initial model in the data that decide; None where that is not known.
        prior: of the coefficients, as it was given.
        measured: whether commands were taken as measured values, though files do not state this.
    """

    learned: Findings
    posterior: JointPosterior
    start: Model
    comparison: Comparison
    gain: PredictionGain | None
    prior: Prior
    measured: bool = False

    @property
    def model(self) -> Model:
        """The calibrated model."""
        return self.learned.model


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosis(DecidedFindings):
    """A verdict, and what it rests on.

    Attributes:
        comparison: errors before and after, on training, validation and test runs, in this order.
        start: the initial model.
        stability: of the learned model.
        speeds: |u|, |v|, |r| that hold 99 % of the training runs [m/s, m/s, rad/s].
        prior: of the nominal coefficients, as it was given.
        seed: of everything random.
        gain: what the search for effects gains over calibration alone in the data that decide; None
            where that is not known.
        measured: whether commands were taken as measured values, though files do not state this.
    """

    comparison: Comparison
    start: Model
    stability: Stability
    speeds: tuple[float, float, float]
    prior: Prior
    seed: int
    gain: PredictionGain | None = None
    measured: bool = False

    @property
    def sound(self) -> bool:
        """Whether the learned model has a mass and stays bounded in closed loop.

        Of a predictor that is not a model of this project that is not judged.
        """
        return not self.comparison.predictor.parametric or bool(self.stability.safe)


@contextmanager
def well_posed() -> Iterator[None]:
    """Compute by one thread, and report an ill-posed problem as one of the data.

    Raises:
        InputError: a system of equations inside is singular or not finite.
    """
    try:
        with one_thread():
            yield
    except LinAlgError as error:
        raise InputError(f"these runs do not determine the requested values: {error}") from None


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
    every = distinctly_named([*runs, *held_out])
    predictor = _source(model, every).on(every, advance)
    return _compared(predictor, every[: len(runs)], after, every[len(runs) :], advance)


def _source(model: Model | ModelSource | str | Path | None, runs: Sequence[WeakWindows]) -> ModelSource:
    """The model of some runs as a source of predictions; the nominal one by default."""
    if isinstance(model, (str, Path)):
        return open_model(model)
    if model is None or isinstance(model, Model):
        return DescribedShip(model or nominal(runs))
    if not hasattr(model, "on"):
        kind = type(model).__name__
        raise InputError(f"a model is a Model, an Fmu, a PythonFunction or a path, not of type {kind}")
    return model


def _compared(
    predictor: Predictor,
    runs: Sequence[WeakWindows],
    after: Model | None,
    held_out: Sequence[WeakWindows],
    advance: Advance,
) -> Comparison:
    """The errors of a predictor, and of it with additions, on runs and on those held out."""
    every, model = [*runs, *held_out], predictor.model
    advance(f"predicting {', '.join(w.run.name for w in every)}")

    def of_some(which: Sequence[int]) -> list[Evaluation]:
        held = [k >= len(runs) for k in which]
        return evaluate_runs([every[k] for k in which], predictor, after, held)

    known = [predictor, model, after, *every, *(w.smoothed for w in every)]
    # What is not of this project may not outlive a fork.
    evaluations = in_halves(of_some, range(len(every)), known, share=predictor.parametric)
    return Comparison(evaluations, [omega_std(w, model) for w in every], predictor)


@dataclass(frozen=True, eq=False, repr=False)
class Session(ShortRepr):
    """The five steps of ``learn``, in growing order of time: each is a method, and needs those before.

    Attributes:
        train, validate, test: runs to learn from, runs that decide, and runs that judge only.
        predictor: of the initial model.
        prior: of the nominal coefficients, as it was given.
        method: of identification.
        harms: criterion of pruning.
        advance: receives the name of each step when it begins.
        seed: of everything random.
        measured: whether commands are taken as measured values, where files do not state what they are.
    """

    train: Sequence[WeakWindows]
    validate: Sequence[WeakWindows]
    test: Sequence[WeakWindows]
    predictor: Predictor
    prior: Prior
    method: Method
    harms: Harm
    advance: Advance
    seed: int
    measured: bool = False

    @property
    def runs(self) -> list[WeakWindows]:
        """All runs."""
        return [*self.train, *self.validate, *self.test]

    @property
    def start(self) -> Model:
        """The initial model."""
        return self.predictor.model

    @cached_property
    def known(self) -> NominalPrior:
        """The prior of each nominal coefficient."""
        return NominalPrior.of(self.start, self.prior)

    def data(self, sigma: np.ndarray) -> ValidationData:
        """The data that decide, by the noise (3,) of the model error [N, N, N m]."""
        return ValidationData(self.train, self.validate, self.start, sigma)

    @well_posed()
    def compare(self) -> Comparison:
        """First answer: the errors of the initial model."""
        return self._compared(None)

    @cached_property
    def calibration(self) -> RefitOutcome | None:
        """The coefficients fitted to predictions; None: runs do not determine any."""
        if not (self.predictor.parametric and any(self.known.std.values())):
            return None
        nothing = Findings(model=self.start, searched=self.known)
        calibrator = Calibrator(nothing, self.train, self.start, self.known)
        self.advance("calibration of the coefficients")
        with suppress(LinAlgError):  # the runs do not determine them
            return calibrator.coefficients() if calibrator.windows else None
        return None

    @well_posed()
    def with_likelier_commands(self) -> "Session":
        """The session with commands as measured values of the actuators, if these predict better.

        Commands stay of which files state what they are, and those of a log of this project, orders.
        """
        measured = self._with_commands(0.5)
        decide = zip([*measured.train, *measured.validate], self.runs, strict=False)
        if all(a is b for a, b in decide):
            return self
        means = measured._losses

        def worse(other: Session) -> bool:
            losses = other._losses
            return bool(means and losses and are_measured(losses, means))

        return measured if worse(self) and worse(self._with_commands(1.0)) else self

    def _with_commands(self, rows: float) -> "Session":
        """The session with commands as measured values, some rows later than orders."""
        given = self.train, self.validate, self.test
        train, validate, test = ([with_measured_commands(w, rows) for w in part] for part in given)
        return replace(self, train=train, validate=validate, test=test, measured=True)

    @property
    def _losses(self) -> list[Losses]:
        """Losses of the initial model and of the calibrated one; none if there is no calibration."""
        if self.calibration is None:
            return []
        fit = self.calibration.findings
        return self.data(fit.sigma).losses(self.start, fit)

    @well_posed()
    def calibrate(self) -> CalibratedModel | None:
        """Second answer: the coefficients alone, without an effect; None: there is none to fit."""
        fit = self.calibration
        if fit is None:
            return None
        gain = prediction_gain(self.data(fit.findings.sigma), self.start, fit.findings)
        compared = self._compared(fit.findings.model)
        return CalibratedModel(
            fit.findings, fit.posterior, self.start, compared, gain, self.prior, self.measured
        )

    @well_posed()
    def diagnose(self) -> Diagnosis:
        """Third answer: which effect is missing, and how sure that is."""
        found = self.method.fit(self.train, self.start, self.prior, self.advance, self.seed)
        data = self.data(found.sigma)
        region = OperatingRegion.of(self._velocities, self.start.ship.scale)
        calibrates = self.predictor.parametric
        verdict, gain = judge(
            found, data, self.known, self.harms, region, calibrates, self.calibration, self.advance
        )
        return self._concluded(verdict, region, gain)

    @property
    def _velocities(self) -> np.ndarray:
        """(n, 3), velocities of the training runs [m/s, m/s, rad/s]."""
        nu = np.concatenate([w.smoothed.nu[w.known] for w in self.train])
        return nu[np.isfinite(nu).all(axis=1)]

    def _compared(self, after: Model | None, predictor: Predictor | None = None) -> Comparison:
        decide, runs = len(self.train) + len(self.validate), self.runs
        return _compared(predictor or self.predictor, runs[:decide], after, runs[decide:], self.advance)

    def _calibrated_errors(self, e: Evaluation) -> WindowErrors | None:
        """Errors of the calibrated model on a run; None: there is none, or the run has no window."""
        fit = self.calibration
        return None if fit is None or e.windows is None else e.windows.errors(fit.findings.model)

    def _concluded(
        self, verdict: DecidedFindings, region: OperatingRegion, gain: PredictionGain | None
    ) -> Diagnosis:
        """The diagnosis by a verdict: errors and bands of predictions, and whether it is stable."""
        learned, posterior = with_other_runs(verdict.learned.model, verdict.posterior)
        verdict = replace(verdict, learned=replace(verdict.learned, model=learned), posterior=posterior)
        found = self._compared(learned if verdict.changed else None, self.predictor.in_windows())
        of_validation = range(len(self.train), len(self.train) + len(self.validate))
        evaluations = [
            replace(
                e,
                bands=verdict.bands(e.smoothed, e.windows),
                use="validate" if k in of_validation else e.use,
                calibrated=self._calibrated_errors(e) if e.held_out else None,
            )
            for k, e in enumerate(found.evaluations)
        ]
        self.advance("stability")
        return Diagnosis(
            **{f.name: getattr(verdict, f.name) for f in fields(verdict)},
            comparison=replace(found, evaluations=evaluations, predictor=self.predictor),
            start=self.start,
            stability=check_stability(learned, self.start, self.advance, region, self._velocities),
            speeds=region.largest,
            prior=self.prior,
            seed=self.seed,
            gain=gain,
            measured=self.measured,
        )


@well_posed()
def begin(
    train: Sequence[WeakWindows],
    held_out: Sequence[WeakWindows] = (),
    prior: Prior = None,
    model: Model | ModelSource | str | Path | None = None,
    advance: Advance = silent,
    seed: int = 0,
    by: str | Method = DEFAULT,
    validate: Sequence[WeakWindows] = (),
    pruning: str = PAIRED,
) -> Session:
    """Check what is given, before any work; arguments as of :func:`diagnosis.diagnose`, of loaded runs.

    Raises:
        InputError: too little data, or an argument that is not what it should be.
    """
    runs = distinctly_named([*train, *validate, *held_out])
    source = _source(model, runs)
    prior_shares((source.start or nominal(runs)).ship, prior)
    harms, chosen = criterion(pruning), method(by) if isinstance(by, str) else by
    blocks, block = sum(np.unique(w.block).size for w in train), BLOCK * runs[0].scale.time
    if blocks < PARTS:
        notes = "".join(f"; {w.run.name}: {note}" for w in train for note in w.smoothed.track.notes)
        raise InputError(
            f"too little data to learn from: thrusters are at work in {blocks} stretches of "
            f"{block:.3g} s; at least {PARTS} are needed{notes}"
        )
    first, last = len(train), len(runs) - len(held_out)
    parts = runs[:first], runs[first:last], runs[last:]
    predictor = source.on(runs, advance)
    if isinstance(predictor, DescribedShip):
        predictor = predictor.learning_from(runs[:last])
    return Session(*parts, predictor, prior, chosen, harms, advance, seed)
