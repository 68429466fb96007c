"""The candidates: what each effect of the registry would add to the model error, as columns.

The model error of a candidate is computed by the model itself with the effect switched on, so that a
formula stands in the registry and nowhere else. An effect whose force is straight in its coefficients
has one shape; any other has several, one for each value of a grid over what bends it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fmus.declare import variables
from fmus.effects import EFFECTS, Effect
from fmus.effects.curve import NODES
from fmus.hull import Damping, Inertia
from fmus.thrusters.chain import Plant

from .model import Model
from .weak import Integrals, omega

# Step of a finite difference for a coefficient that the force may not be straight in.
SMALL = 1e-3


@dataclass(frozen=True, eq=False)
class Shape:
    """One way in which an effect may act.

    Attributes:
        given: parameter -> value that makes the shape, an addition to the model.
        free: parameters that scale it.
        offset: (K, 3), the force of what is given alone; None where that is nothing.
        columns: (K, 3, p), force for one unit of each free parameter.
        moved: (q,), how far the offset also moves what is fitted along; None: nothing is moved.
        stiff: (p, p), how unlikely the free ones are by themselves, a quadratic form; None: 0.
    """

    given: Mapping[str, float]
    free: Sequence[str]
    offset: np.ndarray | None
    columns: np.ndarray
    moved: np.ndarray | None = None
    stiff: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Candidate:
    """An effect with the shapes that it can take on these data."""

    effect: Effect
    shapes: Sequence[Shape] = field(default_factory=list)


# What bends an effect that is not straight, and the values that are tried.
GRIDS: dict[str, tuple[str, tuple[float, ...], tuple[str, ...]]] = {
    "bow_speed_loss": ("bow_speed_loss", (0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 10.0, 15.0), ()),
    "deadband": ("deadband", (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.13, 0.17, 0.22, 0.3), ()),
    "thrust_curve": (
        "thrust_curve_deadband",
        (0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4),
        ("thrust_curve_ahead", "thrust_curve_astern"),
    ),
    "lag": ("lag", (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5, 2.0), ()),
    "delay": ("delay", (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.5), ()),
    "clock_offset": ("clock_offset", (-0.5, -0.3, -0.2, -0.1, -0.05, 0.05, 0.1, 0.2, 0.3, 0.5), ()),
}
# kg, kg, kg, kg m2: heavier by about half of what moves along each axis.
HEAVY = {"mass": 7.0, "added_mass_X": 8.0, "added_mass_Y": 12.0, "added_mass_N": 1.4}
MOMENTS = 150
SATURATIONS = (0.95, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2)
# An effect that is not straight, but nearly so where it is small.
NEARLY = ("current",)
NEARLY_KINDS = ("inertia", "measurement")


def evaluate(data: Sequence[Integrals], model: Model) -> np.ndarray:
    """Model error (K, 3) [N, N, N m] of all runs one after the other."""
    return np.concatenate([omega(w, model) for w in data])


def shape(
    data: Sequence[Integrals],
    model: Model,
    base: np.ndarray,
    given: Mapping[str, float],
    free: Sequence[str],
    step: float = 1.0,
) -> Shape:
    """What the model gains by an effect: minus the change of the model error, by steps of ``step``."""
    start = evaluate(data, model.plus(given)) if given else base
    columns = [(start - evaluate(data, model.plus({**given, name: step}))) / step for name in free]
    stacked = np.stack(columns, axis=2) if columns else np.zeros((*base.shape, 0))
    return Shape(dict(given), list(free), base - start if given else None, stacked)


def moments_apart(data: Sequence[Integrals]) -> float:
    """Time between two moments [s] at which a failure is tried: long runs must not take more memory."""
    return max(5.0, float(max(w.run.time[-1] for w in data)) / MOMENTS)


def stiffness(e: Effect, base: np.ndarray, columns: np.ndarray) -> np.ndarray | None:
    """How unlikely the values of a free curve are by themselves; None for any other effect.

    A bend between neighbouring nodes is likely up to the size at which the curve, were it the same
    everywhere, would be as large as the whole model error: nodes without data follow their neighbours.

    Args:
        e: the effect.
        base: (K, 3), model error.
        columns: (K, 3, p), force for one unit of each node.
    """
    if len(e.coefficients) != NODES:
        return None
    unit = np.square(columns.sum(axis=2))
    axes = unit.sum(axis=0) > 0.0
    size = np.sqrt(np.square(base[:, axes]).sum() / max(unit.sum(), 1e-12)) + 1e-12
    bend = np.diff(np.eye(NODES), 2, axis=0) / size
    return bend.T @ bend


def candidate(data: Sequence[Integrals], model: Model, base: np.ndarray, e: Effect) -> Candidate:
    """An effect's shapes on these data."""
    if e.id in GRIDS:
        name, values, free = GRIDS[e.id]
        shapes = [shape(data, model, base, {name: v} if v else {}, free) for v in values]
    elif e.id == "bow_failure":
        spacing = moments_apart(data)
        times = np.arange(spacing, max(w.run.time[-1] for w in data), spacing)
        shapes = [shape(data, model, base, {"bow_failure_time": float(t)}, ()) for t in times]
    elif e.id == "saturation":
        most = {"saturation_vsp": 1.165, "saturation_bow": 2.629}
        shapes = [
            shape(data, model, base, {name: share * full}, ())
            for name, full in most.items()
            for share in SATURATIONS
        ]
    elif e.id == "waves":
        shapes = []
    else:
        free = [p.name for p in e.parameters if p.name in e.coefficients]
        nearly = e.id in NEARLY or e.kind in NEARLY_KINDS
        plain = shape(data, model, base, {}, free, SMALL if nearly else 1.0)
        shapes = [replace(plain, stiff=stiffness(e, base, plain.columns))]
        if e.kind == "inertia":  # a much heavier ship is not a little heavier one many times
            far = {name: HEAVY[name] for name in free if name in HEAVY}
            shapes += [shape(data, model, base, far, free, SMALL)] if far else []
    return Candidate(e, shapes)


def library(data: Sequence[Integrals], model: Model, base: np.ndarray) -> list[Candidate]:
    """All effects of the registry as candidates."""
    found = [candidate(data, model, base, e) for e in EFFECTS.values()]
    return [c for c in found if c.shapes]


# Coefficients that nobody knows exactly: those of the hull, the thrusters' forces and places.
NOMINAL = {
    v.name: v.start for group in (Inertia, Damping, Plant) for v in variables(group) if v.start != 0.0
}
# Damping is taken over from other ships; what is weighed and measured is never further off than this.
MEASURED = 0.1
_DAMPING = {v.name for v in variables(Damping)}


def beliefs(prior: float) -> dict[str, float]:
    """Standard deviation believed of each nominal coefficient, in SI.

    Args:
        prior: relative; of masses and of the thrusters' forces and places at most a tenth.
    """
    return {
        name: abs(start) * (prior if name in _DAMPING else min(prior, MEASURED))
        for name, start in NOMINAL.items()
    }
