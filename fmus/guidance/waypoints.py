"""Guidance along a route through up to 20 way points, as from a file; no inputs.

Straight legs with bends of continuous curvature, see :mod:`fmus.guidance.route`. The target starts
from rest at the first way point and comes to rest at the last one; with ``loop`` = 1 it goes on to the
first one and round again (and starts where the bend there ends, ``corner`` behind the first way point).
The heading follows the path; with ``psi_given`` = 1 each leg has the heading ``psi_k`` of the way point
where it begins, and the bend carries it over to the next one's; likewise the speed with ``u_given`` = 1.

A leg straight back on the one before leaves no room to turn: the target then turns within a micrometre.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import FIXED, Fields, Range, Variable, component, group_of
from ..ops import Number, floor, where, wrap
from ..signals import Nothing, Target
from .pace import PathTiming, PulseClock, tick
from .ramps import ramp
from .route import FAR, RouteLeg, Waypoint, lay_out, place, whole_way

SIZE = 20
# A round in the basin, where no file says otherwise.
NORTHS = (5.0, 6.5, 6.5, 5.0)
EASTS = (2.0, 2.0, -1.0, -1.0)


def _column(name: str, unit: str, text: str, start: tuple[float, ...], **more: Any) -> type[Fields]:
    padded = start + start[-1:] * (SIZE - len(start))
    fields = [
        Variable(f"{name}_{k}", unit, f"{text} {k}", x, fixed=True, **more)
        for k, x in enumerate(padded, 1)
    ]
    return group_of(f"Column_{name}", fields)


SPEED = Range(0.001, 2.0)
FLAG = Range(0.0, 1.0)
Norths = _column("x", "m", "north position of way point", NORTHS)
Easts = _column("y", "m", "east position of way point", EASTS)
Headings = _column("psi", "rad", "heading from way point", (0.0,))
Speeds = _column("u", "m/s", "speed from way point", (0.06,), range=SPEED)


# A class that is made, because ``count`` is also a method of every tuple.
COUNT = Variable("count", "1", "number of way points", 4.0, Range(2.0, SIZE), fixed=True)
Size = group_of("Size", [COUNT])


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed; with u_given, a change scales all of them", SPEED] = 0.06
    size: Any = Size()
    loop: Annotated[
        float, "1", "1: closed route, repeated; 0: ends at the last way point", FLAG, FIXED
    ] = 1.0
    corner: Annotated[
        float, "m", "distance from a way point at which a bend begins", Range(0.01, 100.0), FIXED
    ] = 0.6
    run_up: Annotated[
        float, "m", "distance over which the target accelerates or stops", Range(0.01, 100.0), FIXED
    ] = 0.2
    psi_given: Annotated[float, "1", "1: headings psi_k, 0: along the path", FLAG, FIXED] = 0.0
    u_given: Annotated[float, "1", "1: speeds u_k, 0: u_t everywhere", FLAG, FIXED] = 0.0
    x: Fields = Norths()
    y: Fields = Easts()
    psi: Fields = Headings()
    u: Fields = Speeds()
    pace: PathTiming = PathTiming()


class State(NamedTuple):
    run: Number
    clock: PulseClock
    whole: Number
    legs: tuple[RouteLeg, ...]


def init(i: Nothing, p: Params) -> State:
    points = [
        Waypoint(x, y, psi, where(p.u_given > 0.5, u / p.u_t, 1.0))
        for x, y, psi, u in zip(p.x, p.y, p.psi, p.u, strict=True)
    ]
    inside = [p.size.count > k + 0.5 for k in range(SIZE)]
    legs = lay_out(points, inside, p.loop > 0.5, p.psi_given < 0.5, p.corner)
    return State(0.0, PulseClock(), whole_way(legs), legs)


def step(s: State, i: Nothing, p: Params, h: Number) -> tuple[State, Target]:
    clock, beat = tick(s.clock, p.pace, h)
    run = s.run + beat.passed * p.u_t
    loop = p.loop > 0.5
    up, down = ramp(run, p.run_up), ramp(run - where(loop, FAR, s.whole), p.run_up)
    w = up.integral - down.integral
    w = w - where(loop, floor(w / s.whole) * s.whole, 0.0)
    w1, w2 = up.value - down.value, up.rate - down.rate
    rate, acceleration = beat.rates(p.u_t, 0.0)
    w_dot, w_ddot = w1 * rate, w2 * rate * rate + w1 * acceleration
    (x, y, psi), first, second = place(s.legs, w)
    return State(run, clock, s.whole, s.legs), Target(
        x,
        y,
        wrap(psi),
        *[d1 * w_dot for d1 in first],
        *[d2 * w_dot * w_dot + d1 * w_ddot for d1, d2 in zip(first, second, strict=True)],
    )


COMPONENT = component(
    name="guidance_waypoints",
    description="Guidance along a route through way points",
    init=init,
    step=step,
)
