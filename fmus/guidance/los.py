"""Line of sight along straight legs between up to 20 way points, for ships that cannot push sideways.

The ship steers for a point of the leg, the look-ahead distance Delta ahead of its own foot on it:

    psi_t = pi_p - atan((y_e + kappa y_int) / Delta),
    y_int_dot = Delta y_e / (Delta^2 + (y_e + kappa y_int)^2),

with pi_p the direction of the leg and y_e the distance from it, to starboard (T. I. Fossen, Handbook
of Marine Craft Hydrodynamics and Motion Control, 2nd ed., Wiley, 2021, ch. 12; A. M. Lekkas and
T. I. Fossen, "Integral LOS path following for curved paths based on a monotone cubic Hermite spline
parametrization", IEEE Trans. Control Systems Technology 22, 2014). The integral finds the heading that
holds the ship on the leg in a current; without it (``integral`` = 0, LOS) the ship lies off the leg.
Delta may grow with the speed. kappa is ``integral`` times the speed wanted: a ship that turns at once
then has the damping ratio 0.5 / sqrt(integral) in its cross-track error, whatever its speed and size.

The next leg begins inside the circle of acceptance of a way point, or abreast of it; of the integral the
part across that leg is kept, which is what is known of a current there. With ``loop`` = 1 the last way
point is followed by the first; else the target stops there.

The target is the foot on the leg; its velocity has the speed wanted, along the heading to steer. That
heading jumps from leg to leg: a controller's reference model is to make it smooth, so its derivatives
are zero. An input that is NaN or infinite keeps its last finite value.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import FIXED, Fields, Range, component
from ..frames import rotate_to_body
from ..ops import Number, atan2, clip, cos, not_, pick, sin, sqrt, where, wrap
from ..signals import Estimate, Target
from .waypoints import FLAG, SPEED, Easts, Norths, Size, Speeds


class Inputs(NamedTuple):
    estimate: Estimate = Estimate()


class Params(NamedTuple):
    u_t: Annotated[float, "m/s", "speed", SPEED] = 0.06
    size: Any = Size()
    loop: Annotated[
        float, "1", "1: closed route, repeated; 0: ends at the last way point", FLAG, FIXED
    ] = 1.0
    acceptance: Annotated[float, "m", "radius of the circles of acceptance", Range(0.001, 100.0)] = 0.5
    lookahead: Annotated[float, "m", "look-ahead distance at rest", Range(0.001, 100.0)] = 1.0
    lookahead_time: Annotated[
        float, "s", "growth of the look-ahead distance with the speed", Range(0.0, 100.0)
    ] = 8.0
    integral: Annotated[float, "1", "kappa over the desired speed; 0: no integral", Range(0.0, 1.0)] = (
        0.1
    )
    u_given: Annotated[float, "1", "1: speeds u_k, 0: u_t everywhere", FLAG, FIXED] = 0.0
    x: Fields = Norths()
    y: Fields = Easts()
    u: Fields = Speeds()


class State(NamedTuple):
    """The leg, from 0; whether the route is at its end; y_int [s]."""

    leg: Number = 0.0
    arrived: Number = 0.0
    y_int: Number = 0.0


class Outputs(NamedTuple):
    target: Target = Target()
    y_e: Annotated[float, "m", "cross-track error, ship to starboard of the leg"] = 0.0
    pi_p: Annotated[float, "rad", "direction of the leg in (-pi, pi]"] = 0.0
    leg: Annotated[float, "1", "number of the way point where the leg begins"] = 1.0
    arrived: Annotated[float, "1", "1 from the last way point on, else 0"] = 0.0


class PathLine(NamedTuple):
    """A leg: where it begins [m], its direction [rad] and length [m]; the ship along and off it [m]."""

    x: Number
    y: Number
    course: Number
    length: Number
    ahead: Number
    aside: Number


def following(leg: Number, p: Params) -> Number:
    """The leg behind this one, round the loop."""
    return where(leg + 1.5 < p.size.count, leg + 1.0, 0.0)


def line(leg: Number, e: Estimate, p: Params) -> PathLine:
    """A leg, and the ship beside it."""
    x, y = pick(p.x, leg), pick(p.y, leg)
    after = following(leg, p)
    north, east = pick(p.x, after) - x, pick(p.y, after) - y
    course = atan2(east, north)
    ahead, aside = rotate_to_body(course, e.x_hat - x, e.y_hat - y)
    return PathLine(x, y, course, sqrt(north * north + east * east), ahead, aside)


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]:
    e = i.estimate
    old = line(s.leg, e, p)
    left = old.length - old.ahead
    near = left * left + old.aside * old.aside < p.acceptance * p.acceptance
    passed = (h > 0.0) & (near | (left < 0.0))
    ends = not_(p.loop > 0.5) & (s.leg + 2.5 > p.size.count)
    arrived = where(passed & ends, 1.0, s.arrived)
    leg = where(passed & not_(ends), following(s.leg, p), s.leg)
    at = line(leg, e, p)
    speed = where(p.u_given > 0.5, pick(p.u, leg), p.u_t)
    kappa = p.integral * speed
    lookahead = p.lookahead + p.lookahead_time * sqrt(e.u_hat * e.u_hat + e.v_hat * e.v_hat)
    seen = where((e.frozen > 0.5) | (arrived > 0.5), 0.0, h)
    carried = s.y_int * where(leg == s.leg, 1.0, cos(at.course - old.course))
    off = at.aside + kappa * carried
    y_int = carried + seen * lookahead * at.aside / (lookahead * lookahead + off * off)
    aim = atan2(at.aside + kappa * y_int, lookahead)
    psi = wrap(at.course - where(arrived > 0.5, 0.0, aim))
    wanted = where(arrived > 0.5, 0.0, speed)
    foot = clip(at.ahead, 0.0, at.length)
    return State(leg, arrived, y_int), Outputs(
        Target(
            at.x + foot * cos(at.course),
            at.y + foot * sin(at.course),
            psi,
            wanted * cos(psi),
            wanted * sin(psi),
        ),
        at.aside,
        wrap(at.course),
        leg + 1.0,
        arrived,
    )


COMPONENT = component(
    name="guidance_los",
    description="Line-of-sight guidance along way points, by the ship's estimated position",
    init=init,
    step=step,
)
