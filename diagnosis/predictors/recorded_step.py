"""A step of predictions as one flat function, recorded once for all models of one structure.

The functions of vessel and thrusters are called with symbols in place of a model's numbers
(:mod:`fmus.native.tape`). What comes out computes the same bits, without calls, tuples and attributes,
which is most of the time of a step.
"""

import itertools
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fmus.actuators.response import CommandLayout, PreparedThrusters
from fmus.fmi.trace import TraceError
from fmus.native.python_text import function, series_function
from fmus.native.tape import Kernels, RecordedFunction, Tape, like
from fmus.ops import when
from fmus.signals import Force
from fmus.vessel import vessel

from .compiled_step import CompiledStep, compiled_step
from .thrust import inflow

Law = Callable[..., Sequence[Any]]
STATE = tuple(f"s{k}" for k in range(len(vessel.State._fields)))


class Ready(NamedTuple):
    """What a step needs to know of a model: hull and thrusters, in the layout of a run's commands."""

    hull: vessel.PreparedVessel
    drive: PreparedThrusters

    @property
    def layout(self) -> CommandLayout:
        return self.drive.effects.layout


class Inputs(NamedTuple):
    """What acts during a step, means over it.

    Attributes:
        given, acting: (k,), commands that arrive, and shares that act.
        power: settings of the thrusters' power; None: there are none.
        air: velocity to north and east [m/s]; None: no wind is measured.
    """

    given: Sequence[Any]
    acting: Sequence[Any]
    power: Sequence[Any] | None = None
    air: Sequence[Any] | None = None


def thrust_at(s: vessel.State, i: Inputs, b: Ready, h: Any) -> tuple[Force, vessel.PreparedVessel]:
    """tau [N, N, N m] during a step, and the vessel in the wind there."""
    drive = b.drive if i.power is None else b.layout.powered(b.drive, i.power)
    hull = b.hull if i.air is None else vessel.blown(b.hull, s, *i.air)
    now = b.layout.running(s.t + h, *inflow(s, hull), tuple(i.given), drive)
    return Force(*b.layout.act(tuple(i.acting), now, drive)), hull


def step(s: vessel.State, i: Inputs, b: Ready, h: Any) -> vessel.State:
    """The ship a step of h [s] later."""
    tau, hull = thrust_at(s, i, b, h)
    return when(
        hull.disturbed,
        lambda: vessel.integrate(s, tau, hull, h, vessel.disturbed),
        lambda: vessel.integrate(s, tau, hull.hull, h),
    )


def recorded_step(b: Ready, i: Inputs, single: bool) -> Law:
    """A function of state and inputs, all in one row, and the step, that gives the next state.

    Args:
        b: of the model.
        i: the inputs of a step.
        single: whether all are numbers, not arrays.
    """
    numbers: list[Any] = []
    _mapped(b, numbers.append)
    counts = tuple([None if part is None else len(part) for part in i])
    advance = _recorded(_structure(b, counts, single, _kind))
    if advance is not None:
        return lambda *given: advance(*given, *numbers)

    def plain(*given: Any) -> vessel.State:
        flat = iter(given)
        s = vessel.State._make(itertools.islice(flat, len(STATE)))
        parts = (None if count is None else tuple(itertools.islice(flat, count)) for count in counts)
        return step(s, Inputs._make(parts), b, *flat)

    return plain


def compiled_states(
    b: Ready, s: vessel.State, inputs: Sequence[np.ndarray | None], h: float
) -> np.ndarray | None:
    """The states (steps + 1, 7, p, w) from a state on, in machine code; None: as it cannot be compiled.

    Args:
        b: of the models.
        s: the state, each number like (p, w), of p models in w windows.
        inputs: those of :class:`Inputs`, each (steps, k, ...) and like (p, w) beside that.
        h: step [s].
    """
    numbers: list[Any] = []
    _mapped(b, numbers.append)
    counts = tuple([None if part is None else part.shape[1] for part in inputs])
    law = _compiled(_structure(b, counts, False, lambda x: _kind(x) == "b"))
    if law is None:
        return None
    moving = [part[:, k] for part in inputs if part is not None for k in range(part.shape[1])]
    return law.states(s, moving, [np.array(h), *numbers])


@dataclass(frozen=True)
class _Structure:
    """What a recorded step depends on.

    Attributes:
        key: the model with the kind of each of its numbers in its place, and its effects.
        counts: how many numbers each of the inputs has.
        single: whether all are numbers.
        of: a model with this structure.
    """

    key: Hashable
    counts: tuple[int | None, ...]
    single: bool
    of: Ready = field(compare=False)


def _parts(b: Ready) -> list[dict[str, Any]]:
    """What a model has of numbers, by name."""
    return [{n: x for n, x in part._asdict().items() if n != "effects"} for part in b]


def _structure(
    b: Ready, counts: tuple[int | None, ...], single: bool, kind: Callable[[Any], Hashable]
) -> _Structure:
    """What a step depends on, with the kind that a function gives of each number or array."""
    return _Structure(
        (_kinds(_parts(b), kind), id(b.hull.effects), id(b.drive.effects)), counts, single, b
    )


def _kind(x: Any) -> Hashable:
    return x.dtype.kind if isinstance(x, np.ndarray) else float


def _kinds(x: Any, kind: Callable[[Any], Hashable]) -> Hashable:
    """The kind of each number of a model, and the classes of the tuples that they are in."""
    if isinstance(x, (tuple, list)):
        return type(x), tuple([_kinds(item, kind) for item in x])
    if isinstance(x, dict):
        return tuple([(name, _kinds(item, kind)) for name, item in x.items()])
    return kind(x) if isinstance(x, (float, np.ndarray)) else x


@lru_cache(maxsize=64)  # models of one structure follow each other in a fit
def _recorded(of: _Structure) -> Law | None:
    """The step of models of a structure; None: an effect of a user cannot be recorded."""
    tape, names, plain = Tape(Kernels()), list[str](), list[str]()

    def variable(name: str, x: Any) -> Any:
        names.append(name)
        if isinstance(x, float):
            plain.append(name)
        return tape.variable(name, _kind(x) == "b")

    after = _after(of, tape, variable)
    if after is None:
        return None
    if of.single:
        return function(after, tape.kernels, *names)
    return series_function(after, tape.kernels, names, frozenset(plain))


@lru_cache(maxsize=64)
def _compiled(of: _Structure) -> CompiledStep | None:
    """The same in machine code; None: also where there is no compiler."""
    tape, count = Tape(Kernels()), itertools.count()
    after = _after(of, tape, lambda _, x: tape.variable(f"given[{next(count)}]", _kind(x) == "b"))
    if after is None:
        return None
    return compiled_step(after, tape.kernels, sum(n or 0 for n in of.counts), next(count))


def _after(of: _Structure, tape: Tape, variable: Callable[[str, Any], Any]) -> RecordedFunction | None:
    """What a step gives, recorded with variables for state, inputs, step and the model's numbers."""
    number, array = itertools.count(), np.zeros(0)
    s = vessel.State(*(variable(name, array) for name in STATE))
    inputs = Inputs._make(
        None if count is None else [variable(f"{group}{k}", array) for k in range(count)]
        for group, count in zip(Inputs._fields, of.counts, strict=True)
    )
    h = variable("h", 0.0)
    b = _mapped(of.of, lambda x: variable(f"p{next(number)}", x))
    try:
        return tape.recording(step(s, inputs, b, h))
    except (TraceError, TypeError, AttributeError):
        return None


def _mapped(b: Ready, function: Callable[[Any], Any]) -> Ready:
    """A model with a function applied to each of its numbers and arrays."""

    def mapped(x: Any) -> Any:
        if isinstance(x, tuple):
            return like(x, [mapped(item) for item in x])
        return function(x) if isinstance(x, (float, np.ndarray)) else x

    hull, drive = _parts(b)
    return Ready(
        b.hull._replace(**{name: mapped(x) for name, x in hull.items()}),
        b.drive._replace(**{name: mapped(x) for name, x in drive.items()}),
    )
