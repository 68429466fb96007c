"""Guidance along a figure of eight, (4.41)-(4.42); no inputs.

The path parameter runs at a constant rate, so the speed is not constant: with u_t = 0.16 it is 0.01 to
0.03 m/s and a round takes 422 s. ``calls`` = 4 repeats the fault of the thesis' experiments, see
:mod:`.ellipse`.
"""

import math
from typing import Annotated, NamedTuple

from ..declare import FIXED, Component, Range
from ..ops import Number, cos, sin
from ..signals import Target
from .path import PathPoint, target

# 5.33 deg/s of path parameter for each m/s of u_t.
RATE = math.radians(5.33)


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed setting; theta_dot = 5.33 deg/m u_t", Range(-20.0, 20.0)] = 0.16
    x_c: Annotated[float, "m", "north position of the centre"] = 5.0
    y_c: Annotated[float, "m", "east position of the centre"] = 0.5
    a_x: Annotated[float, "m", "half length to the north", Range(min=0.01)] = 1.0
    a_y: Annotated[float, "m", "half width to the east", Range(min=0.01)] = 1.0
    theta_0: Annotated[float, "rad", "path parameter at the start", FIXED] = 0.0
    calls: Annotated[float, "1", "times the path is advanced each step", Range(0.0, 100.0)] = 1.0


class Inputs(NamedTuple):
    """None."""


class State(NamedTuple):
    theta: float = 0.0


def init(i: Inputs, p: Params) -> State:
    return State(p.theta_0)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Target]:
    theta_dot = RATE * p.u_t
    theta = s.theta + h * p.calls * theta_dot
    n, e = sin(theta), cos(theta)
    n2, e2 = 2.0 * n * e, e * e - n * n
    point = PathPoint(
        p.x_c + p.a_x * e,
        p.y_c - p.a_y * n2,
        -p.a_x * n,
        -2.0 * p.a_y * e2,
        -p.a_x * e,
        4.0 * p.a_y * n2,
        p.a_x * n,
        8.0 * p.a_y * e2,
    )
    return State(theta), target(point, theta_dot, 0.0)


COMPONENT = Component(
    name="guidance_eight",
    description="Guidance along a figure of eight",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Target,
    init=init,
    step=step,
)
