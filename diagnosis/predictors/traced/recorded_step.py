"""A step of predictions, and as one flat function, which takes a fraction of the time."""

from collections.abc import Callable, Sequence
from itertools import islice
from typing import Any, NamedTuple

import numpy as np

from fmus.actuators.response import CommandLayout, PreparedThrusters
from fmus.hull import Triple
from fmus.ops import when
from fmus.signals import Force
from fmus.vessel import vessel

from ..thrust import inflow
from .recorded_law import in_machine_code, in_python, numbers_of, structure

STATE = len(vessel.State._fields)


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


def thrust_at(s: vessel.State, i: Inputs, b: Ready) -> tuple[Force, vessel.PreparedVessel]:
    """tau [N, N, N m] in a state, and the vessel in the wind there."""
    drive = b.drive if i.power is None else b.layout.powered(b.drive, i.power)
    hull = b.hull if i.air is None else vessel.blown(b.hull, s, *i.air)
    now = b.layout.running(s.t, *inflow(s, hull), tuple(i.given), drive)
    return Force(*b.layout.act(tuple(i.acting), now, drive)), hull


def step(s: vessel.State, i: Inputs, b: Ready, h: Any) -> vessel.State:
    """The ship a step of h [s] later."""
    return vessel.integrate(s, i, b, h, driven)


def driven(s: vessel.State, i: Inputs, b: Ready) -> Triple:
    """nu_dot of the ship by its thrusters, whose force changes with the motion within a step."""
    tau, hull = thrust_at(s, i, b)
    return when(
        hull.disturbed,
        lambda: vessel.disturbed(s, tau, hull),
        lambda: vessel.nominal(s, tau, hull.hull),
    )


def _flat_step(s: Any, *given: Any) -> vessel.State:
    """A step of groups of numbers (state, the inputs, h), and the parts of a model."""
    *inputs, (h,), hull, drive = given
    return step(vessel.State._make(s), Inputs._make(inputs), Ready(hull, drive), h)


def recorded_step(b: Ready, i: Inputs, single: bool) -> Callable[..., Sequence[Any]]:
    """A function of state and inputs, all in one row, and the step, that gives the next state.

    Args:
        b: of the model.
        i: the inputs of a step.
        single: whether all are numbers, not arrays.
    """
    counts = (STATE, *(None if part is None else len(part) for part in i), 1)
    advance, numbers = in_python(structure(_flat_step, counts, b), single), numbers_of(b)
    if advance is not None:
        return lambda *given: advance(*given, *numbers)

    def plain(*given: Any) -> vessel.State:
        flat = iter(given)
        return _flat_step(*(None if n is None else tuple(islice(flat, n)) for n in counts), *b)

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
    counts = (STATE, *(None if part is None else part.shape[1] for part in inputs), 1)
    law = in_machine_code(structure(_flat_step, counts, b, arrays=False))
    if law is None:
        return None
    moving = [part[:, k] for part in inputs if part is not None for k in range(part.shape[1])]
    steps = np.full(len(moving[0]), h)
    return law.states(s, [*moving, steps], numbers_of(b))
