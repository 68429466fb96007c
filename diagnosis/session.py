"""The two tasks of the commands as functions: evaluate a model on runs, and diagnose what it lacks."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.linalg import LinAlgError

from cosim import InputError
from fmus.ship import ship
from fmus.ships.naming import DEFAULT as USUAL

from .assessment.regions import ErrorRegions, find_regions
from .assessment.stability import OperatingRegion, Stability, check_stability
from .execution.parallel import for_each
from .execution.progress import Advance, silent
from .predictors import (
    Fmu,
    Model,
    Use,
    WeakWindows,
    as_model,
    by_fmu,
    evaluate_fmu,
    omega_std,
    told_apart,
    use_of,
)
from .predictors.evaluation import DataUse, Evaluation, evaluate_run
from .predictors.weak_form import BLOCK
from .search import DEFAULT, Method, Prior, method
from .search.prediction_fit.predicted_bands import prediction_bands
from .search.prior import NominalPrior
from .search.prior import shares as prior_shares
from .verdict.judging import Verdict, judge
from .verdict.pruning_criteria import USUAL as PAIRED
from .verdict.pruning_criteria import criterion
from .verdict.validation_data import ValidationData

MIN_BLOCKS = 4  # of the training runs, so that cross-validation has folds: 60 s; chosen
REACHED = 0.9  # quantile of |nu| that counts as a speed that the ship reached; chosen


@dataclass(frozen=True, eq=False)
class Comparison:
    """The error of a model, or of the initial and the learned one, on measured runs.

    Attributes:
        evaluations: one for each run.
        omega_std: of each run the standard deviation (K, 3) of its model error [N, N, N m].
        use: how an FMU predicts the runs; None: it is no FMU.
    """

    evaluations: Sequence[Evaluation]
    omega_std: Sequence[np.ndarray]
    use: Use | None = None

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
class Diagnosis(Verdict):
    """A verdict, and what it rests on.

    Attributes:
        comparison: errors before and after, on training, validation and test runs, in this order.
        start: the initial model.
        stability: of the learned model.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
        prior: of the nominal coefficients, as it was given.
        seed: of everything random.
    """

    comparison: Comparison
    start: Model
    stability: Stability
    speeds: tuple[float, float, float]
    prior: Prior
    seed: int

    @property
    def sound(self) -> bool:
        """Whether the learned model has a mass and stays bounded in closed loop; not asked of an FMU."""
        return self.comparison.use is not None or bool(self.stability.safe)


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


def nominal(runs: Sequence[WeakWindows]) -> Model:
    """The nominal model of the ship that runs are of.

    Raises:
        InputError: they are of several ships.
    """
    ships = dict.fromkeys(w.run.ship for w in runs)
    if len(ships) > 1:
        names = (USUAL if one is None else one.name for one in ships)
        raise InputError(f"the runs are of several ships: {', '.join(names)}")
    return Model(ship=ship(description=next(iter(ships), None)))


@well_posed()
def evaluate(
    runs: Sequence[WeakWindows],
    model: Model | Fmu | str | Path | None = None,
    after: Model | None = None,
    held_out: Sequence[WeakWindows] = (),
    advance: Advance = silent,
) -> Comparison:
    """Compare a model, or two, with measured runs.

    Args:
        runs: see :func:`diagnosis.gather`.
        model: the nominal one of the runs' ship by default; an FMU, or the path of one, whose variables
            are known by their names.
        after: the learned model; None: nothing was learned.
        held_out: further runs, of which nothing was learned.
        advance: receives the name of each step when it begins.

    Raises:
        InputError: the runs are so ill-conditioned that nothing can be computed of them; the FMU is not
            what it is taken for, or fails.
    """
    every = [*runs, *held_out]
    advance(f"predicting {', '.join(w.run.name for w in every)}")
    if isinstance(model, (str, Path)):
        model = Fmu(model)
    if isinstance(model, Fmu):
        every = told_apart(every)
        use = use_of(model, [w.run for w in every])
        beside = as_model(every, use, nominal(every))
        predicted = [evaluate_fmu(w, use, beside) for w in every]
        return Comparison(predicted, [omega_std(w, beside) for w in every], use)
    before = model or nominal(every)
    known = [before, after, *every, *(w.smoothed for w in every)]

    def of_run(k: int) -> Evaluation:
        return evaluate_run(every[k], before, after, k >= len(runs))

    evaluations = for_each(of_run, range(len(every)), known)
    return Comparison(evaluations, [omega_std(w, before) for w in every])


@well_posed()
def diagnose(
    train: Sequence[WeakWindows],
    held_out: Sequence[WeakWindows] = (),
    prior: Prior = None,
    model: Model | Fmu | str | Path | None = None,
    advance: Advance = silent,
    seed: int = 0,
    by: str | Method = DEFAULT,
    validate: Sequence[WeakWindows] = (),
    pruning: str = PAIRED,
) -> Diagnosis:
    """Learn what a model lacks.

    Args:
        train: runs to learn from, see :func:`diagnosis.gather`.
        held_out: test runs: they are predicted, and decide nothing.
        prior: relative standard deviation of every nominal coefficient, or of those named (coefficients
            or groups); 0: exact; None: by where each value comes from.
        model: the initial one; the nominal one of the runs' ship by default; an FMU, or the path of one,
            to which the effects of that ship are added.
        advance: receives the name of each step when it begins.
        seed: of everything random.
        by: method of identification, or the name of one.
        validate: validation runs: they decide what is kept; without any, training data left out in turn.
        pruning: criterion of pruning, see :mod:`diagnosis.verdict.pruning_criteria`.

    Raises:
        InputError: too little data, or a prior that is negative, not finite, or of what is none.
    """
    fmu = Fmu(model) if isinstance(model, (str, Path)) else model if isinstance(model, Fmu) else None
    every = told_apart([*train, *validate, *held_out])
    start = model if isinstance(model, Model) else nominal(every)
    prior_shares(start.ship, prior)  # before any work
    harms = criterion(pruning)
    chosen = method(by) if isinstance(by, str) else by
    _refuse_short(train)
    train, validate = every[: len(train)], every[len(train) : len(every) - len(held_out)]
    use = None
    if fmu is not None:
        advance(f"what {fmu.name} does in measured states")
        use = use_of(fmu, [w.run for w in every])
        start = as_model(every, use, start)
    nu = np.concatenate([w.smoothed.nu[w.known] for w in train])
    region = OperatingRegion.of(nu, start.ship.scale)

    found = chosen.fit(train, start, prior, advance, seed)
    data = ValidationData(train, validate, start, found.sigma)
    known = NominalPrior.of(start, prior)
    verdict = judge(found, data, known, harms, region, use is None, advance)
    comparison = _predicted(verdict, every, len(train), len(validate), start, use, advance)
    advance("stability")
    stability = check_stability(verdict.learned.model, start, advance, region)

    u, v, r = np.quantile(np.abs(nu), REACHED, axis=0).tolist()
    parts = {f.name: getattr(verdict, f.name) for f in fields(verdict)}
    return Diagnosis(
        **parts,
        comparison=comparison,
        start=start,
        stability=stability,
        speeds=(u, v, r),
        prior=prior,
        seed=seed,
    )


def _predicted(
    verdict: Verdict,
    runs: Sequence[WeakWindows],
    train: int,
    validate: int,
    start: Model,
    use: Use | None,
    advance: Advance,
) -> Comparison:
    """Errors of the initial and of the learned model, with bands about the predictions of the latter."""
    learned = verdict.learned.model
    decide = train + validate
    final = learned if verdict.changed else None
    comparison = evaluate(runs[:decide], start, final, runs[decide:], advance)
    evaluations = comparison.evaluations
    if use is not None:
        evaluations = by_fmu(evaluations, use)
    push = verdict.unrecorded.push

    def banded(k: int, e: Evaluation) -> Evaluation:
        bands = prediction_bands(e.smoothed, e.windows, learned, verdict.posterior, push)
        return replace(e, bands=bands, use=_use(k, train, decide))

    return replace(comparison, evaluations=[banded(k, e) for k, e in enumerate(evaluations)], use=use)


def _use(k: int, train: int, decide: int) -> DataUse:
    return "train" if k < train else "validate" if k < decide else "test"


def _refuse_short(train: Sequence[WeakWindows]) -> None:
    """Refuse training runs that are too short for folds.

    Raises:
        InputError: they are.
    """
    blocks = sum(np.unique(w.block).size for w in train)
    if blocks < MIN_BLOCKS:
        block = BLOCK * train[0].scale.time
        raise InputError(
            f"too little to learn from: {blocks * block:.3g} s with thrusters at work, "
            f"at least {MIN_BLOCKS * block:.3g} s are needed"
        )
