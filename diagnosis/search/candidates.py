"""The candidates: what each effect of a ship would add to the model error, as regressors.

The regressors of a candidate are computed by the model itself with the effect switched on, so that a
formula stands in the declaration of the effect and nowhere else. An effect whose force is linear in its
coefficients has one shape; any other has several, one for each value tried of what it is nonlinear in.
"""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from fmus.effects import Effect
from fmus.scale import Scale

from ..execution.parallel import for_each
from ..predictors import Model, WeakWindows, omega
from ..predictors.ship_model import of_run, parameter_and_run
from ..predictors.uncertainty import FLOOR, undone_variance
from ..predictors.weak_form import SMALL
from ..runs.run_constants import NEGLIGIBLE
from .nonlinear.multistart import MULTIPLES, Landscape, best_values, limits
from .nonlinear.segmentation import intervals, problem

# Here forces and coefficients are in their units at the size of the ship, see :meth:`.Model.unit`.
SLIGHT = np.finfo(float).eps  # sum of squares of a force, in the units above, that is rounding


@dataclass(frozen=True, eq=False)
class CandidateShape:
    """One way in which an effect may act.

    Attributes:
        given: parameter -> value that makes the shape, an addition to the model.
        fitted: parameters that scale it.
        offset: (K, 3), the force of what is given alone; None where that is nothing.
        columns: (K, 3, p), force for one unit of each fitted parameter.
        unit: (p,), what one unit of each is at the size of the ship.
        nuisance_offset: (q,), nuisance parameters together with what is given; None: as they are.
        precision: (p, p), prior precision of the fitted ones; None: 0.
        removed_noise: (3,), sum of squares of the noise that the shape takes out of the model error, see
            :func:`removed_noise`; None: none.
    """

    given: Mapping[str, float]
    fitted: Sequence[str]
    offset: np.ndarray | None
    columns: np.ndarray
    unit: np.ndarray
    nuisance_offset: np.ndarray | None = None
    precision: np.ndarray | None = None
    removed_noise: np.ndarray | None = None

    @property
    def is_finite(self) -> bool:
        """Whether it can be computed: a function may have no value in a part of the data."""
        given = () if self.offset is None else self.offset
        return bool(np.isfinite(self.columns).all() and np.isfinite(given).all())


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect with the shapes that it can take on these data."""

    effect: Effect
    shapes: Sequence[CandidateShape] = field(default_factory=list)


def model_error(data: Sequence[WeakWindows], model: Model) -> np.ndarray:
    """Model error (K, 3) [N, N, N m] of all runs one after the other."""
    return np.concatenate([omega(w, model) for w in data])


def changed_error(
    data: Sequence[WeakWindows],
    model: Model,
    base: np.ndarray,
    changes: Mapping[str, float],
    name: str,
) -> np.ndarray:
    """Model error (K, 3) after changes; of one value's in a single run other runs keep theirs (K, 3)."""
    changed, (_, run) = model.plus(changes), parameter_and_run(name)
    if not run:
        return model_error(data, changed)
    parts = np.split(base, np.cumsum([w.block.size for w in data])[:-1])
    return np.concatenate(
        [omega(w, changed) if w.run.name == run else own for w, own in zip(data, parts, strict=True)]
    )


def removed_noise(data: Sequence[WeakWindows], model: Model, changed: Model) -> np.ndarray | None:
    """Sum of squares (3,) of the noise that a change of the measurement's filters takes out of omega.

    To undo a filter is to filter the noise of the measurement as well. What becomes less of it is
    nothing that the filter explains, and is charged to its loss: the expected optimism of a fit that
    chooses how its data are smoothed (B. Efron, The estimation of prediction error: covariance
    penalties and cross-validation, J. Am. Stat. Assoc. 99, 2004). None: the filters stay.
    """
    if model.filters == changed.filters:
        return None
    falls = [undone_variance(w, model) - undone_variance(w, changed) for w in data]
    return np.concatenate(falls).sum(axis=0)


def shape(
    data: Sequence[WeakWindows],
    model: Model,
    base: np.ndarray,
    given: Mapping[str, float],
    fitted: Sequence[str],
    step: float = 1.0,
) -> CandidateShape:
    """What the model gains by an effect: minus the change of the model error, by steps of ``step``."""
    start = model_error(data, model.plus(given)) if given else base
    unit = np.array([model.unit(n) for n in fitted])
    steps = zip(fitted, (step * unit).tolist(), strict=True)
    columns = [(start - changed_error(data, model, start, {**given, n: h}, n)) / h for n, h in steps]
    stacked = np.stack(columns, axis=2) if columns else np.zeros((*base.shape, 0))
    offset, noise = (
        (base - start, removed_noise(data, model, model.plus(given))) if given else (None, None)
    )
    return CandidateShape(dict(given), list(fitted), offset, stacked, unit, removed_noise=noise)


def covered(columns: np.ndarray) -> np.ndarray:
    """(p,), which nodes of a curve give a force that shows beside that of all, and those between them.

    Columns (K, 3, p) are by node.
    """
    weight = np.square(columns).sum(axis=(0, 1))
    reached = np.flatnonzero(weight > NEGLIGIBLE**2 * weight.sum())
    inside = np.zeros(weight.size, bool)
    if reached.size:
        inside[reached[0] : reached[-1] + 1] = True
    return inside


def smoothness(base: np.ndarray, columns: np.ndarray, inside: np.ndarray) -> np.ndarray:
    """Prior precision of the values of a curve: its second differences are N(0, size^2).

    The size is that at which the curve, were it the same everywhere, would be as large as the whole
    model error: nodes without data follow their neighbours. Beyond the data a curve goes on with its
    last value: with zero a rudder might lose half of its force within two degrees of what was learned.

    Args:
        base: (K, 3), model error.
        columns: (K, 3, p), force for one unit of each node.
        inside: (p,), the nodes that the data reach.
    """
    unit = np.square(columns.sum(axis=2))
    axes = unit.sum(axis=0) > 0.0
    size = np.sqrt(np.square(base[:, axes]).sum() / max(unit.sum(), SLIGHT)) + SLIGHT
    nodes = np.eye(columns.shape[2])
    within = inside[:-1] & inside[1:]
    bend = np.diff(nodes, 2, axis=0)[within[:-1] & within[1:]] / size
    step = np.diff(nodes, axis=0)[~within] / (SMALL * size)
    return bend.T @ bend + step.T @ step


def continued(inside: np.ndarray, is_factor: bool) -> slice:
    """The nodes of a curve that are fitted: those that the data reach, and those beyond.

    A factor of a force goes on to both sides. An addition to a force does so away from zero, which is in
    the middle of the nodes; else the ship would have it without any speed or command.
    """
    first, last = np.flatnonzero(inside)[[0, -1]].tolist()
    low, high = is_factor or 2 * first < inside.size - 1, is_factor or 2 * last > inside.size - 1
    return slice(0 if low else first, inside.size if high else last + 1)


def curve(base: np.ndarray, plain: CandidateShape, e: Effect, scale: Scale) -> list[CandidateShape]:
    """A free curve as a smooth one; none where the data reach too few of its nodes."""
    force = plain.columns * plain.unit / np.array(scale.forces)[:, None]
    inside = covered(force)
    if inside.sum() <= 2:  # without a bend
        return []
    own = continued(inside, e.parameters[0].unit == "1")
    unit = plain.unit[own]
    precision = smoothness(base / scale.forces, force[:, :, own], inside[own]) / np.outer(unit, unit)
    columns = plain.columns[:, :, own]
    return [replace(plain, fitted=plain.fitted[own], columns=columns, unit=unit, precision=precision)]


def values_to_try(
    data: Sequence[WeakWindows], model: Model, base: np.ndarray, e: Effect
) -> list[Mapping[str, float]]:
    """The values at which a nonlinear effect is tried."""
    declared = e.search.values(model.values)
    if e.search.intervals:
        return with_intervals(data, model, base, e)
    if declared or e.differentiable:
        return declared
    return [at for name in e.coefficients for at in scaled(data, model, base, e, name)]


def spread(e: Effect) -> bool:
    """Whether an effect has parameters that it is not linear in, and declares no values of them.

    One with a memory takes long to compute: it is tried at few values.
    """
    several = bool(e.shape_parameters) or (not e.differentiable and len(e.coefficients) > 1)
    stated = e.search.times or e.search.tries or e.search.smooth
    return several and not stated and e.memory is None


def by_starts(
    data: Sequence[WeakWindows], model: Model, base: np.ndarray, e: Effect, step: float
) -> list[CandidateShape]:
    """The shapes of an effect at the best values of what it is not linear in."""
    sigma = np.sqrt(np.mean(base**2, axis=0)) + FLOOR * model.ship.scale.forces

    def with_values(values: Mapping[str, float]) -> Model:
        return model.plus({n: x - model.value(n) for n, x in values.items()})

    def force(values: Mapping[str, float]) -> np.ndarray:
        return ((base - model_error(data, with_values(values))) / sigma).ravel()

    def tried(shape: Mapping[str, float]) -> list[dict[str, float]]:
        at = with_values(shape)
        return [v for name in e.coefficients for v in scaled(data, at, base, e, name)]

    poses = np.concatenate([w.smoothed.eta[w.known, :2] for w in data])
    extent = float(np.linalg.norm(np.ptp(poses, axis=0)))
    present = {p.name: model.value(p.name) for p in e.parameters}
    units = {p.name: model.unit(p.name) for p in e.parameters}
    of = Landscape(e, force, (base / sigma).ravel(), extent, present, units)
    found, fitted = best_values(of, tried)
    return [shape(data, model, base, additions(model, e, v), fitted, step) for v in found]


def with_intervals(
    data: Sequence[WeakWindows], model: Model, base: np.ndarray, e: Effect
) -> list[Mapping[str, float]]:
    """The intervals in which an effect seems to act, as additions to a model; none: no values.

    A single one without an end in each run that has any is the effect that lasts, if there is such.
    """
    p = problem(data, model, base, e)
    spans = [] if p is None else intervals(p)
    if p is None or not spans or not p.passing(spans):
        return []
    if e.search.lasting and p.without_end(spans):
        return []
    return [p.values(spans)]


def additions(model: Model, e: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """Values to try as additions to a model: those of coefficients are, others are values themselves."""
    return {n: x if n in e.coefficients else x - model.value(n) for n, x in values.items()}


def scaled(
    data: Sequence[WeakWindows], model: Model, base: np.ndarray, e: Effect, name: str
) -> Iterator[dict[str, float]]:
    """Multiples of a coefficient's value at which its force is as large as the model error.

    That is found in steps of ten, from SMALL^2 units on. Where the force never is, because it saturates,
    of the value at which it has half of its largest. The effect's other parameters are refined as well,
    from where they are.
    """
    unit, forces_of = model.unit(name), model.ship.scale.forces
    allowed = limits(next(p for p in e.parameters if p.name == name))
    low, high = np.clip(allowed, -unit / SMALL**2, unit / SMALL**2).tolist()
    wanted = float(np.square(base / forces_of).sum())
    others = {n: model.value(n) for n in e.shape_parameters}
    others |= {n: 0.0 for n in e.coefficients if n != name}
    for sign in (1.0, -1.0):
        forces: dict[float, float] = {}
        size = unit * SMALL**2
        while max(forces.values(), default=0.0) < wanted and low <= sign * size <= high:
            change = base - model_error(data, model.plus({name: sign * size}))
            forces[size] = float(np.square(change / forces_of).sum())
            size *= 10.0
        largest = max(forces.values(), default=0.0)
        if largest > SLIGHT:
            size = next(s for s, force in forces.items() if force >= largest / 2.0)
            values = [sign * k * size for k in MULTIPLES]
            yield from ({**others, name: value} for value in values if low <= value <= high)


def candidate(data: Sequence[WeakWindows], model: Model, base: np.ndarray, e: Effect) -> Candidate:
    """An effect's shapes on these data: with one value for all runs, then with values of each run."""
    shapes: list[CandidateShape] = []
    # By inertia, current and measurement the model error changes smoothly, but not linearly.
    hull = e.kind in ("force", "environment", "actuator") and e.linear
    step = 1.0 if hull or not e.differentiable else SMALL
    if e.differentiable and not e.search.times:
        plain = shape(data, model, base, {}, e.fitted, step)
        shapes += [plain] if not e.search.smooth else curve(base, plain, e, model.ship.scale)
    if e.search.of_each_run and len(data) > 1:
        own = [of_run(n, w.run.name) for w in data for n in e.fitted]
        shapes.append(shape(data, model, base, {}, own, step))
    if spread(e):
        shapes += by_starts(data, model, base, e, step)
    else:
        tries = (additions(model, e, values) for values in values_to_try(data, model, base, e))
        shapes += [shape(data, model, base, given, e.fitted, step) for given in tries]
    return Candidate(e, [s for s in shapes if s.is_finite])


def lasts(e: Effect, model: Model) -> bool:
    """Whether what an effect adds is nearly the same in a model with other effects and coefficients.

    It is so of forces. What an inertia, a current or a filter adds follows from the model's own motion,
    and the shapes of some effects from the model error.
    """
    tried = e.differentiable or bool(e.search.values(model.values))
    by_error = e.search.smooth or e.search.intervals or spread(e) or not tried
    return e.kind in ("force", "actuator") and not by_error


def candidates(
    data: Sequence[WeakWindows],
    model: Model,
    base: np.ndarray,
    known: Set[str] = frozenset(),
    earlier: Mapping[str, Candidate] = MappingProxyType({}),
) -> list[Candidate]:
    """All effects that the ship can have and that a regression can find, but those that are known.

    Those of one actuator of several with one command only where each has commands of its own.

    Args:
        data: windows of every run.
        model, base: the model so far and its error (K, 3).
        known: ids of the effects in it.
        earlier: candidates by id that stay as they are, see :func:`lasts`.
    """
    ship = model.ship
    apart = ship.layouts[-1]
    each = any(ship.layout_of(w.run.commands) is apart for w in data)
    effects = [ship.effects[name] for name in ship.candidates if name not in known]
    possible = [e for e in effects if e.search.by == "regression" and (each or not e.apart)]
    new = [e for e in possible if e.id not in earlier]
    found = for_each(lambda e: candidate(data, model, base, e), new, new)
    made = {**earlier, **dict(zip([e.id for e in new], found, strict=True))}
    return [c for c in (made[e.id] for e in possible) if c.shapes]
