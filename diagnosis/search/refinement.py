"""Effects and nuisance parameters moved together to their most likely values, see :mod:`.most_likely`.

The residuals are the model error in units of the noise. Its slopes by the nuisance parameters hardly
change on the way and are taken once; those of a new effect anew at each step. Times within a run have no
slope: they are found by segmentation, anew at each fit of all else.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from fmus.effects import Effect
from fmus.ship import Ship

from ..predictors import Model, WeakWindows
from ..predictors.ship_model import parameter_and_run
from ..predictors.weak_form import OVERLAP
from ..runs.run_constants import NEGLIGIBLE, STEPS
from .candidates import SMALL, CandidateShape, changed_error, model_error, removed_noise
from .gram import Nuisance, block_numbers
from .most_likely import ENOUGH, Quadratic, most_likely, ridge
from .nonlinear.multistart import limits
from .nonlinear.segmentation import likely, problem, segmented
from .prior import NominalPrior


@dataclass(frozen=True, eq=False)
class TrainingSet:
    """What a model is fitted to.

    Attributes:
        data: windows of every run.
        sigma: (3,), noise of each axis [N, N, N m]; None as long as it is not known.
        prior: of the nominal coefficients.
    """

    data: Sequence[WeakWindows]
    sigma: np.ndarray | None
    prior: NominalPrior

    @cached_property
    def blocks(self) -> np.ndarray:
        """(K, 2), run and block of each window."""
        return block_numbers(self.data)

    @property
    def weight(self) -> np.ndarray:
        """(3,), what an error counts on each axis."""
        return 1.0 / np.asarray(self.sigma) / np.sqrt(OVERLAP)

    def error(self, at: "RefinedModel") -> np.ndarray:
        """(K, 3), model error of an estimate [N, N, N m]."""
        return model_error(self.data, at.model(self.prior))


@dataclass(frozen=True, eq=False)
class RefinedModel:
    """A model on the way to the most likely one.

    Attributes:
        start: the model that the user gave.
        offset: nominal coefficients, each in prior standard deviations from its prior mean.
        values: parameters of the effects that were found, as additions.
        precision: prior precision of those of them that are fitted.
        held: values that stay as they are, as their effect is not smooth in them.
    """

    start: Model
    offset: np.ndarray
    values: Mapping[str, float] = field(default_factory=dict)
    precision: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    held: frozenset[str] = frozenset()

    @classmethod
    def at(cls, start: Model, prior: NominalPrior) -> "RefinedModel":
        """The start."""
        return cls(start, np.zeros(prior.size))

    def model(self, prior: NominalPrior) -> Model:
        """The model with all of it.

        A time constant stays within its range; a force may change sign on the way to where it belongs.
        """
        found, changes = self.start.plus(self.values), prior.changes(self.offset)
        times = {n: c for n, c in changes.items() if found.declared(n).unit == "s"}
        return found.plus(changes | {n: bounded(found, n, c) for n, c in times.items()})

    @property
    def fitted(self) -> list[str]:
        """Those values that are fitted by slopes."""
        ship = self.start.ship
        return [n for n in self.values if n not in self.held and timed(ship, n) is None]

    def theta(self, names: Iterable[str]) -> np.ndarray:
        """(q,), some of the values, then the offsets of the nominal coefficients."""
        return np.array([*[self.values[n] for n in names], *self.offset])

    def without(self, names: Collection[str]) -> "RefinedModel":
        """The estimate without the values of some effects."""
        kept = [k for k, n in enumerate(self.fitted) if n not in names]
        values = {n: v for n, v in self.values.items() if n not in names}
        return replace(self, values=values, precision=self.precision[kept][:, kept])

    def holding(self, names: Collection[str]) -> "RefinedModel":
        """The estimate with further values that stay as they are."""
        kept = [k for k, n in enumerate(self.fitted) if n not in names]
        return replace(self, precision=self.precision[kept][:, kept], held=self.held | set(names))

    def fitting(self, precision: np.ndarray) -> "RefinedModel":
        """The estimate with the prior precision (p, p) of its last values, which are fitted now."""
        return replace(self, precision=np.asarray(block_diag(self.precision, precision)))

    def plus(self, values: Mapping[str, float], offset: np.ndarray) -> "RefinedModel":
        """The estimate with additions, effects' parameters within their range."""
        names = (*self.values, *values)
        together = {n: self.values.get(n, 0.0) + values.get(n, 0.0) for n in names}
        within = {n: bounded(self.start, n, v) for n, v in together.items()}
        return replace(self, values=within, offset=self.offset + offset)


def timed(ship: Ship, name: str) -> Effect | None:
    """The effect of a ship that a value is a time within a run of; None: it is none."""
    return ship.effects.timed.get(parameter_and_run(name)[0])


def has_values_of_runs(ship: Ship, names: Iterable[str]) -> bool:
    """Whether parameters of an effect have values of each run, and are not only times of a failure."""
    return any(parameter_and_run(n)[1] and timed(ship, n) is None for n in names)


def bounded(start: Model, name: str, addition: float) -> float:
    """An addition to a parameter of a model, with which it stays within its range."""
    (low, high), present = limits(start.declared(name)), start.value(name)
    return min(max(addition, low - present), high - present)


class ValueAtLimit(NamedTuple):
    """A value of an effect at an end of its range.

    Attributes:
        name: of the parameter.
        value: in the parameter's unit.
        limit: the end of the range.
        is_upper: whether that is the upper end.
        unit: of both.
        measured: what to measure in place of estimating it, as a part of a sentence; empty: not known.
    """

    name: str
    value: float
    limit: float
    is_upper: bool
    unit: str
    measured: str = ""

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit != "1" else ""
        end = f"{'upper' if self.is_upper else 'lower'} limit of the search"
        measured = f" ({self.measured})" if self.measured else ""
        return f"{self.name} = {self.value:.4g}{unit} is at the {end}, {self.limit:.4g}{unit}{measured}"


def at_limit(start: Model, effect: str, additions: Mapping[str, float]) -> list[ValueAtLimit]:
    """Values of an effect at a limit of their range, which the data did not choose.

    A limit of zero is where an effect begins. The nodes of a free curve are not values of their own.
    """
    e, found = start.ship.effects[effect], []
    for name, addition in additions.items() if not e.search.smooth else ():
        declared, value = start.declared(name), start.value(name) + addition
        for is_upper, end in enumerate(limits(declared)):
            if 0.0 < abs(end) < np.inf and abs(value - end) <= NEGLIGIBLE * abs(end):
                measured = e.wording.measured(value, start.value) if e.wording.measured else ""
                found.append(ValueAtLimit(name, value, end, bool(is_upper), declared.unit, measured))
    return found


def slope(t: TrainingSet, model: Model, left: np.ndarray, name: str, scale: float) -> np.ndarray:
    """Force (K, 3) that the model gains by one unit of a parameter."""
    small = SMALL * max(abs(scale), SMALL * model.unit(name))
    return (left - changed_error(t.data, model, left, {name: small}, name)) / small


def nuisance_of(t: TrainingSet, at: RefinedModel, base: np.ndarray) -> Nuisance:
    """What is fitted along with every candidate: effects found before, and nominal coefficients.

    ``base`` is the model error (K, 3) of the model so far.
    """
    model = at.model(t.prior)
    fitted = at.fitted
    columns = [slope(t, model, base, n, at.values[n]) for n in fitted]
    for n, std in t.prior.std.items():
        none = np.zeros_like(base)
        columns.append(std * slope(t, model, base, n, t.prior.mean[n]) if std else none)
    precision = np.asarray(block_diag(at.precision, np.eye(t.prior.size)))
    unit = np.array([*[model.unit(n) for n in fitted], *[1.0] * t.prior.size])
    return Nuisance(np.stack(columns, axis=2), precision, at.theta(fitted), unit)


@dataclass(frozen=True, eq=False)
class CandidateStart:
    """A candidate's parameters to start from.

    Attributes:
        values: parameter -> value.
        fitted: those that are fitted by slopes.
        precision: prior precision of these.
    """

    values: Mapping[str, float]
    fitted: Sequence[str]
    precision: np.ndarray


@dataclass(frozen=True, eq=False)
class Refined:
    """A candidate at its most likely values.

    Attributes:
        estimate: the model with it.
        left: (K, 3), its model error.
        columns: (K, 3, p), slopes by the parameters of the candidate that were fitted.
        cost: sum of squares and prior penalty.
        intervals: 95 % interval of each change point [s].
    """

    estimate: RefinedModel
    left: np.ndarray
    columns: np.ndarray
    cost: float
    intervals: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    def own(self, at: RefinedModel) -> dict[str, float]:
        """The candidate's own values, beside those of a model that it was not in."""
        return {n: v for n, v in self.estimate.values.items() if n not in at.values}


def refine(t: TrainingSet, at: RefinedModel, nuisance: Nuisance, start: CandidateStart) -> Refined:
    """A candidate, from a start, and what is fitted along with it at their most likely values."""
    e = next((e for n in start.values if (e := timed(at.start.ship, n))), None)
    if e is None:
        return Refinement(t, at, nuisance, start).solved()
    return _with_intervals(t, at, nuisance, start, e)


def refit(t: TrainingSet, at: RefinedModel, nuisance: Nuisance) -> Refined:
    """The effects found and the nominal coefficients at their most likely values, without a new one."""
    return Refinement(t, at, nuisance, CandidateStart({}, (), np.zeros((0, 0)))).solved()


@dataclass(frozen=True, eq=False)
class Sloped(Quadratic[Refined]):
    """The cost with the slopes (K, 3, p) of a new effect."""

    columns: np.ndarray


@dataclass(frozen=True, eq=False)
class Refinement:
    """The fit of a candidate and all nuisance parameters by slopes; arguments as of :func:`refine`."""

    t: TrainingSet
    at: RefinedModel
    nuisance: Nuisance
    start: CandidateStart

    @cached_property
    def precision(self) -> np.ndarray:
        """(q, q), prior precision of all that is fitted."""
        return np.asarray(block_diag(self.start.precision, self.nuisance.precision))

    def theta(self, of: RefinedModel) -> np.ndarray:
        """(q,), all that is fitted: the candidate's, effects found before, nominal coefficients."""
        return of.theta((*self.start.fitted, *self.at.fitted))

    def begin(self) -> Refined:
        """The candidate as it begins."""
        return self._evaluated(self.at.plus(self.start.values, np.zeros(self.t.prior.size)))

    def rows(self, columns: np.ndarray) -> np.ndarray:
        """(3 K, q), what one unit of everything explains by slopes (K, 3, p), in units of noise."""
        return weighted_rows(np.concatenate([columns, self.nuisance.columns], axis=2), self.t.weight)

    def moved(self, r: Refined, step: np.ndarray) -> Refined:
        """An estimate after a step (q,), effects within their range."""
        names = [*self.start.fitted, *self.at.fitted]
        values = dict(zip(names, step.tolist(), strict=False))
        return self._evaluated(r.estimate.plus(values, step[len(names) :]))

    def _evaluated(self, estimate: RefinedModel) -> Refined:
        left, x = self.t.error(estimate), self.theta(estimate)
        cost = float(((left * self.t.weight) ** 2).sum() + x @ self.precision @ x)
        return Refined(estimate, left, np.zeros((*left.shape, 0)), cost)

    def about(self, r: Refined) -> Sloped:
        """The cost about an estimate."""
        model, fitted = r.estimate.model(self.t.prior), self.start.fitted
        own = [slope(self.t, model, r.left, n, r.estimate.values[n]) for n in fitted]
        columns = np.stack(own, axis=2) if own else r.columns
        A = self.rows(columns)
        H = A.T @ A + self.precision
        right = A.T @ (r.left * self.t.weight).reshape(-1) - self.precision @ self.theta(r.estimate)
        unit = np.array([*[self.at.start.unit(n) for n in fitted], *self.nuisance.unit])
        return Sloped(H + ridge(H, unit), right, lambda tried: tried.cost, columns)

    def solved(self) -> Refined:
        """The candidate at its most likely values; times within a run stay as they are."""
        found, here = most_likely(self.begin(), self.about, self.moved)
        return replace(found, columns=here.columns)


def weighted_rows(columns: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Columns (K, 3, q) as rows (3 K, q), each axis times its weight (3,)."""
    return np.moveaxis(columns * weight[:, None], 2, 0).reshape(columns.shape[2], -1).T


def _with_intervals(
    t: TrainingSet, at: RefinedModel, nuisance: Nuisance, start: CandidateStart, e: Effect
) -> Refined:
    """The same with the intervals of an effect found anew at each fit of all else, until they stay."""
    found = Refinement(t, at, nuisance, start).solved()
    present, p = dict(start.values), None
    for _ in range(STEPS):
        estimate = found.estimate
        without = {n: v for n, v in estimate.values.items() if n not in present}
        model = replace(estimate, values=without).model(t.prior)
        parts = nuisance.columns, nuisance.precision, estimate.theta(at.fitted), nuisance.unit
        whole = problem(t.data, model, model_error(t.data, model), e, parts)
        if whole is None:
            break
        p = whole.weighted(np.asarray(t.sigma))
        spans = p.spans(present)
        better = segmented(p, spans)
        if not better or not p.passing(better) or p.cost(better) > p.cost(spans) - ENOUGH:
            break
        present = p.values(better)
        found = Refinement(t, at, nuisance, replace(start, values=present)).solved()
    return found if p is None else replace(found, intervals=likely(p, p.spans(present)))


def as_shape(
    t: TrainingSet, r: Refined, base: np.ndarray, at: RefinedModel, start: CandidateStart
) -> CandidateShape:
    """A refined candidate as a shape, seen from the model ``at`` with the error ``base``."""
    given = r.own(at)
    offset = r.estimate.theta(at.fitted)
    unit = np.array([at.start.unit(n) for n in start.fitted])
    noise = removed_noise(t.data, at.model(t.prior), r.estimate.model(t.prior))
    return CandidateShape(
        given, list(start.fitted), base - r.left, r.columns, unit, offset, start.precision, noise
    )
