"""A route of straight legs through way points, with bends of continuous curvature between them.

A bend turns the course by ``turn``, as ``turn`` times a quintic smooth step over the length of the bend;
so heading, yaw rate and yaw acceleration are continuous. It is symmetric, begins and ends at the same
distance from its way point, and its position is the integral of the course, by a Gauss-Legendre rule
that is exact to 1e-8 of the bend's length for a right angle, to 1e-6 for a turn straight back.

Legs are laid out over the way ``w`` [m] of a target at the common speed: on a leg of twice that speed
the path is gone along two metres for each metre of ``w``. Where two speeds meet, the bend carries one
smoothly over to the other.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from ..ops import Condition, Number, atan2, choose, clip, cos, fmax, fmin, not_, sin, sqrt, where, wrap
from .ramps import ramp, smooth

# Further than anything goes [m]: where a leg starts that the route does not have.
FAR = 1e9
# Nothing is shorter [m]: keeps way points that lie upon each other from giving infinities.
SHORT = 1e-6
# Places and weights of the ten-point Gauss-Legendre rule on [0, 1].
_HALF_RULE = (
    (0.14887433898163122, 0.2955242247147528),
    (0.4333953941292472, 0.2692667193099965),
    (0.6794095682990244, 0.219086362515982),
    (0.8650633666889845, 0.1494513491505804),
    (0.9739065285171717, 0.06667134430868814),
)
RULE = tuple((0.5 + 0.5 * side * x, 0.5 * w) for x, w in _HALF_RULE for side in (-1.0, 1.0))


class Waypoint(NamedTuple):
    """A way point; heading and speed count for the leg that begins there.

    Attributes:
        x, y: north and east position [m].
        psi: heading [rad].
        speed: relative to the common speed [1].
    """

    x: Number
    y: Number
    psi: Number
    speed: Number


class RouteLeg(NamedTuple):
    """A straight piece and the bend behind it.

    Attributes:
        start: way w at its beginning [m].
        x, y: position there [m].
        course, turn: direction of the straight piece, and by how much the bend turns it [rad].
        heading, swing: heading on the straight piece, and by how much the bend turns it [rad].
        straight, bend: lengths [m].
        speed, gain: relative speed on the straight piece, and by how much the bend raises it [1].
    """

    start: Number
    x: Number
    y: Number
    course: Number
    turn: Number
    heading: Number
    swing: Number
    straight: Number
    bend: Number
    speed: Number
    gain: Number

    def span(self) -> Number:
        """Way w that straight piece and bend take [m]."""
        return self.straight / self.speed + self.carry()

    def carry(self) -> Number:
        """Way w that the bend takes, at the mean of both speeds [m]."""
        return self.bend / (self.speed + 0.5 * self.gain)


class RoutePlace(NamedTuple):
    """Position [m] and heading [rad] on a route, with their first two derivatives by w."""

    pose: tuple[Number, Number, Number]
    first: tuple[Number, Number, Number]
    second: tuple[Number, Number, Number]


def displacement(turn: Number, part: Number) -> tuple[Number, Number]:
    """Ahead and aside along the first ``part`` (0 to 1) of a bend of length 1."""
    ahead = aside = 0.0
    for place, weight in RULE:
        angle = turn * smooth(part * place)
        ahead = ahead + weight * cos(angle)
        aside = aside + weight * sin(angle)
    return part * ahead, part * aside


def bend_length(turn: Number, reach: Number) -> Number:
    """Length of the bend that begins and ends ``reach`` [m] from its way point."""
    ahead, aside = displacement(turn, 1.0)
    return 2.0 * reach * cos(0.5 * turn) / sqrt(ahead * ahead + aside * aside)


def lay_out(
    points: Sequence[Waypoint],
    inside: Sequence[Condition],
    loop: Condition,
    along: Condition,
    corner: Number,
) -> tuple[RouteLeg, ...]:
    """Legs from each way point to the next.

    Args:
        points: all way points that could be.
        inside: for each whether the route has it.
        loop: whether the route returns from the last point to the first.
        along: whether the heading follows the path in place of the points' headings.
        corner: distance from a way point at which a bend begins, at most half a leg [m].

    Returns:
        As many legs as points; those that the route does not have start at :data:`FAR`.
    """
    size = len(points)
    last = [inside[k] & not_(inside[k + 1]) for k in range(size - 1)] + [inside[size - 1]]

    def following(values: Sequence[Any], k: int) -> Any:
        """What belongs to the way point behind k."""
        return where(last[k], values[0], values[min(k + 1, size - 1)])

    x, y = [p.x for p in points], [p.y for p in points]
    psi, speed = [p.psi for p in points], [p.speed for p in points]
    norths = [following(x, k) - x[k] for k in range(size)]
    easts = [following(y, k) - y[k] for k in range(size)]
    courses = [atan2(e, n) for n, e in zip(norths, easts, strict=True)]
    lengths = [sqrt(n * n + e * e) for n, e in zip(norths, easts, strict=True)]
    # The last leg of a route that is no loop ends at a way point from which no leg goes on.
    goes_on = [loop | not_(following(last, k)) for k in range(size)]
    exists = [inside[k] & (loop | not_(last[k])) for k in range(size)]
    ends = [
        fmin(corner, 0.5 * where(goes_on[k], fmin(lengths[k], following(lengths, k)), lengths[k]))
        for k in range(size)
    ]
    begin = 0.0
    for k in range(size):
        begin = where(loop & last[k], ends[k], begin)
    legs: list[RouteLeg] = []
    start = 0.0
    for k in range(size):
        turn = where(goes_on[k], wrap(following(courses, k) - courses[k]), 0.0)
        length = where(goes_on[k], bend_length(turn, ends[k]), ends[k])
        leg = RouteLeg(
            where(exists[k], start, FAR),
            x[k] + begin * cos(courses[k]),
            y[k] + begin * sin(courses[k]),
            courses[k],
            turn,
            where(along, courses[k], psi[k]),
            where(along, turn, wrap(following(psi, k) - psi[k])),
            fmax(lengths[k] - begin - ends[k], 0.0),
            fmax(length, SHORT),
            speed[k],
            where(goes_on[k], following(speed, k) - speed[k], 0.0),
        )
        legs.append(leg)
        start = start + where(exists[k], leg.span(), 0.0)
        begin = ends[k]
    return tuple(legs)


def whole_way(legs: Sequence[RouteLeg]) -> Number:
    """Way w from the beginning of the first to the end of the last leg [m]."""
    way = 0.0
    for leg in legs:
        way = way + where(leg.start < FAR, leg.span(), 0.0)
    return way


def place(legs: Sequence[RouteLeg], w: Number) -> RoutePlace:
    """Where a route is at the way w [m]."""
    leg = legs[0]
    for other in legs[1:]:
        leg = choose(w >= other.start, other, leg)
    straight = leg.straight / leg.speed
    way = w - leg.start
    # The way along the bend, from 0 to its length, with two derivatives.
    change = ramp(way - straight, leg.carry())
    inside = clip(way - straight, 0.0, leg.carry())
    part = clip((leg.speed * inside + leg.gain * change.integral) / leg.bend, 0.0, 1.0)
    s1 = leg.speed + leg.gain * change.value
    s2 = leg.gain * change.rate
    bend = ramp(part * leg.bend, leg.bend)
    course = leg.course + leg.turn * bend.value
    north, east = cos(course), sin(course)
    yaw, yaw1 = bend.rate * s1, bend.curvature * s1 * s1 + bend.rate * s2
    ahead, aside = displacement(leg.turn, part)
    ahead = leg.speed * fmin(way, straight) + leg.bend * ahead
    aside = leg.bend * aside
    c, s = cos(leg.course), sin(leg.course)
    x, y = leg.x + c * ahead - s * aside, leg.y + s * ahead + c * aside
    return RoutePlace(
        (x, y, leg.heading + leg.swing * bend.value),
        (s1 * north, s1 * east, leg.swing * yaw),
        (
            s2 * north - s1 * leg.turn * yaw * east,
            s2 * east + s1 * leg.turn * yaw * north,
            leg.swing * yaw1,
        ),
    )
