"""A step of predictions as one flat function, recorded once for all models of one structure.

The functions of vessel and thrusters are called with symbols in place of a model's numbers
(:mod:`fmus.native.tape`). What comes out computes the same bits, without calls, tuples and attributes,
which is most of the time of a step.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from fmus.actuators.response import CommandLayout, PreparedThrusters
from fmus.fmi.trace import TraceError
from fmus.native.python_text import function, series_function
from fmus.native.tape import Kernels, Tape, like
from fmus.ops import when
from fmus.signals import Force
from fmus.vessel import vessel

from ..thrust import inflow

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
    """A function of state and inputs, all in one row, and the step, that gives the next state."""
    numbers: list[Any] = []
    _mapped(b, numbers.append)
    counts = tuple([None if part is None else len(part) for part in i])
    advance = _recorded(
        _Structure((_kinds(_parts(b)), id(b.hull.effects), id(b.drive.effects)), counts, single, b)
    )
    if advance is not None:
        return lambda *given: advance(*given, *numbers)

    def plain(*given: Any) -> vessel.State:
        flat = iter(given)
        s = vessel.State._make(islice(flat, len(STATE)))
        parts = (None if count is None else tuple(islice(flat, count)) for count in counts)
        return step(s, Inputs._make(parts), b, *flat)

    return plain


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


def _kinds(x: Any) -> Hashable:
    """The kind of each number of a model, and the classes of the tuples that they are in."""
    if isinstance(x, (tuple, list)):
        return type(x), tuple([_kinds(item) for item in x])
    if isinstance(x, dict):
        return tuple([(name, _kinds(item)) for name, item in x.items()])
    return x.dtype.kind if isinstance(x, np.ndarray) else float if isinstance(x, float) else x


@lru_cache  # models of one structure follow each other in a fit
def _recorded(of: _Structure) -> Law | None:
    """The step of models of a structure; None: an effect of a user cannot be recorded."""
    tape, names, plain = Tape(Kernels()), [*STATE], ["h"]

    def variable(name: str, condition: bool = False) -> Any:
        names.append(name)
        return tape.variable(name, condition)

    inputs = Inputs._make(
        None if count is None else [variable(f"{group}{k}") for k in range(count)]
        for group, count in zip(Inputs._fields, of.counts, strict=True)
    )
    h = variable("h")

    def number(x: Any) -> Any:
        name = f"p{len(names)}"
        if isinstance(x, float):
            plain.append(name)
        return variable(name, isinstance(x, np.ndarray) and x.dtype.kind == "b")

    s = vessel.State(*map(tape.variable, STATE))
    try:
        after = tape.recording(step(s, inputs, _mapped(of.of, number), h))
    except (TraceError, TypeError, AttributeError):
        return None
    if of.single:
        return function(after, tape.kernels, *names)
    return series_function(after, tape.kernels, names, frozenset(plain))


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
