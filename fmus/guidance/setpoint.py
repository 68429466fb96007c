"""Guidance to a set point along a smooth reference; no inputs.

Each of north, east and heading follows its set point through three equal real poles (Fossen 2011,
10.2.1, with relative damping 1), solved exactly, so any step size gives the same reference. The set
point may be changed during a run; the heading takes the shorter way.
"""

from typing import Annotated, NamedTuple

from ..declare import FIXED, Range, component
from ..ops import Number, exp, wrap
from ..signals import Nothing, Target


class Params(NamedTuple):
    x_s: Annotated[float, "m", "north position of the set point"] = 5.0
    y_s: Annotated[float, "m", "east position of the set point"] = 0.5
    psi_s: Annotated[float, "rad", "heading of the set point"] = 0.0
    x_0: Annotated[float, "m", "north position of the reference at the start", FIXED] = 5.0
    y_0: Annotated[float, "m", "east position of the reference at the start", FIXED] = 2.0
    psi_0: Annotated[float, "rad", "heading of the reference at the start", FIXED] = 0.0
    bandwidth: Annotated[float, "rad/s", "pole of the reference", Range(0.001, 10.0)] = 0.2


class ReferenceAxis(NamedTuple):
    """One coordinate of the reference and its derivatives."""

    value: float = 0.0
    rate: float = 0.0
    acceleration: float = 0.0


class State(NamedTuple):
    x: ReferenceAxis = ReferenceAxis()
    y: ReferenceAxis = ReferenceAxis()
    psi: ReferenceAxis = ReferenceAxis()


def approach(axis: ReferenceAxis, error: Number, w: Number, h: Number) -> ReferenceAxis:
    """The axis after h [s] on its way to a set point that it misses by ``error`` (value minus goal)."""
    c0 = error
    c1 = axis.rate + w * c0
    c2 = 0.5 * (axis.acceleration + 2.0 * w * axis.rate + w * w * c0)
    decay = exp(-w * h)
    left = decay * (c0 + h * (c1 + h * c2))
    slope = decay * (c1 + 2.0 * h * c2)
    rate = slope - w * left
    return ReferenceAxis(axis.value + (left - error), rate, 2.0 * decay * c2 - w * slope - w * rate)


def init(i: Nothing, p: Params) -> State:
    return State(ReferenceAxis(p.x_0), ReferenceAxis(p.y_0), ReferenceAxis(p.psi_0))


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    x = approach(s.x, s.x.value - p.x_s, p.bandwidth, h)
    y = approach(s.y, s.y.value - p.y_s, p.bandwidth, h)
    psi = approach(s.psi, wrap(s.psi.value - p.psi_s), p.bandwidth, h)
    return State(x, y, psi), Target(
        x.value,
        y.value,
        wrap(psi.value),
        x.rate,
        y.rate,
        psi.rate,
        x.acceleration,
        y.acceleration,
        psi.acceleration,
    )


COMPONENT = component(
    name="guidance_setpoint",
    description="Guidance to a set point along a smooth reference",
    init=init,
    step=step,
)
