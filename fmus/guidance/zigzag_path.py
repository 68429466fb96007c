"""Guidance along a smooth zig-zag, back and forth along a straight course (6.3.5); no inputs.

The path swings to either side of a straight course: its tangent, which the heading follows, alternates
smoothly between +psi_z and -psi_z. The target runs along the course at the speed u_t (on the path it is
faster by 1 / cos psi), starting from rest. After ``length`` it stops smoothly and returns on the same
path astern, with its heading as before, then ahead again and so on: it stays in its strip of the basin
and visits speeds ahead and astern. A long ``length`` makes it a zig-zag without return.

With a the way made good along the course, (x, y) = (a, tan(psi_z) J(a)) in the frame of the course,
where J' is a square wave with smooth changes of sign; all derivatives are exact, and nothing is
integrated numerically.
"""

from typing import Annotated, NamedTuple

from ..declare import FIXED, Range, component
from ..ops import Number, cos, fmin, sin
from ..signals import Nothing, Target
from .pace import PathTiming, PulseClock, tick
from .path import PathPoint, target
from .ramps import alternation, climb


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed along the course", Range(-2.0, 2.0)] = 0.06
    x_0: Annotated[float, "m", "north position at the start", FIXED] = 3.0
    y_0: Annotated[float, "m", "east position at the start", FIXED] = 0.5
    psi_c: Annotated[float, "rad", "direction of the course", FIXED] = 0.0
    psi_z: Annotated[float, "rad", "angle between leg and course", Range(-1.2, 1.2), FIXED] = 0.35
    leg: Annotated[float, "m", "distance between turns along the course", Range(min=0.01), FIXED] = 1.0
    turn: Annotated[float, "m", "length of a turn, at most a leg", Range(min=0.01), FIXED] = 0.6
    length: Annotated[float, "m", "length of the strip along the course", Range(min=0.01), FIXED] = 4.0
    stop: Annotated[
        float,
        "m",
        "distance over which the speed is reversed, at most the length",
        Range(min=0.01),
        FIXED,
    ] = 0.4
    pace: PathTiming = PathTiming()


class State(NamedTuple):
    run: float = 0.0
    clock: PulseClock = PulseClock()


def path(a: Number, p: Params) -> PathPoint:
    """The path over the way made good a [m]; the start is in the middle of a leg."""
    turn = fmin(p.turn, p.leg)
    swing = alternation(a + 0.5 * p.leg, p.leg, turn)
    north, east = cos(p.psi_c), sin(p.psi_c)
    slope = sin(p.psi_z) / cos(p.psi_z)
    y = slope * (swing.integral - 0.5 * climb(p.leg, turn))
    y1, y2, y3 = slope * swing.value, slope * swing.rate, slope * swing.curvature
    return PathPoint(
        p.x_0 + north * a - east * y,
        p.y_0 + east * a + north * y,
        north - east * y1,
        east + north * y1,
        -east * y2,
        north * y2,
        -east * y3,
        north * y3,
    )


def init(i: Nothing, p: Params) -> State:
    return State()


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    clock, beat = tick(s.clock, p.pace, h)
    run = s.run + beat.passed * p.u_t
    stop = fmin(p.stop, p.length)
    # Half a period of the way back and forth: what a reversal costs of the run comes on top.
    way = alternation(run, p.length + (p.length - climb(p.length, stop)), stop)
    rate, acceleration = beat.rates(p.u_t, 0.0)
    return State(run, clock), target(
        path(way.integral, p), way.value * rate, way.rate * rate * rate + way.value * acceleration
    )


COMPONENT = component(
    name="guidance_zigzag_path",
    description="Guidance along a smooth zig-zag in a strip of the basin, back and forth",
    init=init,
    step=step,
)
