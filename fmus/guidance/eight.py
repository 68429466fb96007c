"""Guidance along a figure of eight, (4.41)-(4.42); no inputs.

The path parameter runs at a constant rate, or in pulses, so the speed is not constant: with
u_t = 0.16 it is 0.01 to 0.03 m/s and a round takes 422 s.
"""

import math
from typing import Annotated, NamedTuple

from ..declare import Range, component
from ..ops import Number, cos, sin
from ..signals import Nothing, Target
from .pace import PathTiming, PulseClock, tick
from .path import Course, PathPoint, target

# 5.33 deg/s of path parameter for each m/s of u_t.
RATE = math.radians(5.33)


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed setting; theta_dot = 5.33 deg/m u_t", Range(-20.0, 20.0)] = 0.16
    a_x: Annotated[float, "m", "half length to the north", Range(min=0.01)] = 1.0
    a_y: Annotated[float, "m", "half width to the east", Range(min=0.01)] = 1.0
    course: Course = Course()
    pace: PathTiming = PathTiming()


class State(NamedTuple):
    theta: float = 0.0
    clock: PulseClock = PulseClock()


def init(i: Nothing, p: Params) -> State:
    return State(p.course.theta_0)


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    clock, beat = tick(s.clock, p.pace, h)
    theta_dot = RATE * p.u_t
    theta = s.theta + beat.passed * theta_dot
    n, e = sin(theta), cos(theta)
    n2, e2 = 2.0 * n * e, e * e - n * n
    point = PathPoint(
        p.course.x_c + p.a_x * e,
        p.course.y_c - p.a_y * n2,
        -p.a_x * n,
        -2.0 * p.a_y * e2,
        -p.a_x * e,
        4.0 * p.a_y * n2,
        p.a_x * n,
        8.0 * p.a_y * e2,
    )
    return State(theta, clock), target(point, *beat.rates(theta_dot, 0.0))


COMPONENT = component(
    name="guidance_eight",
    description="Guidance along a figure of eight",
    init=init,
    step=step,
)
