"""Guidance that moves the ship in surge, sway and yaw at once, at many frequencies; no inputs.

For identification: north, east and heading each follow two raised cosines whose frequencies have no
common period within an hour, so that velocities, accelerations and their signs come in all
combinations, crabbing and turning on the spot among them. The motion starts from rest.
"""

from typing import Annotated, NamedTuple

from ..declare import FIXED, Range, component
from ..ops import Number, cos, sin, wrap
from ..signals import Nothing, Target

# Frequencies [rad/s] of the slow and the quick part of each axis, at rate 1.
FREQUENCIES = ((0.11, 0.31), (0.13, 0.37), (0.17, 0.43))


class Params(NamedTuple):
    x_0: Annotated[float, "m", "north position at the start", FIXED] = 5.0
    y_0: Annotated[float, "m", "east position at the start", FIXED] = 2.0
    psi_0: Annotated[float, "rad", "heading at the start", FIXED] = 0.0
    slow_x: Annotated[float, "m", "slow oscillation to the north, peak to peak"] = 1.0
    slow_y: Annotated[float, "m", "slow oscillation to the east, peak to peak"] = -1.0
    slow_psi: Annotated[float, "rad", "slow oscillation of the heading, peak to peak"] = 2.0
    quick_x: Annotated[float, "m", "fast oscillation to the north, peak to peak"] = 0.3
    quick_y: Annotated[float, "m", "fast oscillation to the east, peak to peak"] = 0.3
    quick_psi: Annotated[float, "rad", "fast oscillation of the heading, peak to peak"] = -0.6
    rate: Annotated[float, "1", "factor of all frequencies", Range(0.0, 5.0), FIXED] = 1.0


class State(NamedTuple):
    t: Number = 0.0


def swing(
    slow: Number, quick: Number, frequencies: tuple[float, float], rate: Number, t: Number
) -> tuple[Number, Number, Number]:
    """Deviation of one axis from its start at time t [s], and its first two derivatives."""
    w1, w2 = rate * frequencies[0], rate * frequencies[1]
    a, b = 0.5 * slow, 0.5 * quick
    c1, c2 = cos(w1 * t), cos(w2 * t)
    return (
        a * (1.0 - c1) + b * (1.0 - c2),
        a * w1 * sin(w1 * t) + b * w2 * sin(w2 * t),
        a * w1 * w1 * c1 + b * w2 * w2 * c2,
    )


def init(i: Nothing, p: Params) -> State:
    return State()


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    t = s.t + h
    x, x_dot, x_ddot = swing(p.slow_x, p.quick_x, FREQUENCIES[0], p.rate, t)
    y, y_dot, y_ddot = swing(p.slow_y, p.quick_y, FREQUENCIES[1], p.rate, t)
    psi, psi_dot, psi_ddot = swing(p.slow_psi, p.quick_psi, FREQUENCIES[2], p.rate, t)
    return State(t), Target(
        p.x_0 + x,
        p.y_0 + y,
        wrap(p.psi_0 + psi),
        x_dot,
        y_dot,
        psi_dot,
        x_ddot,
        y_ddot,
        psi_ddot,
    )


COMPONENT = component(
    name="guidance_multisine",
    description="Guidance at many frequencies in all axes, for identification",
    init=init,
    step=step,
)
