"""What may be constantly wrong between two channels: how it would move or turn the ship that they tell.

Of each kind one function, which registers itself. It gives the path that one unit of the fault adds to
what velocity and yaw rate say, so that the fault is found by least squares together with all others.
"""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np

from fmus.scale import Scale

from .evidence import Evidence, integral

Needs = Literal["velocity", "rate"]
Deviation = Literal["deviation_sin", "deviation_cos", "deviation_sin_2", "deviation_cos_2"]
Kind = Literal["clock_rate", "clock_gap", "scale", "offset", "place", "delay", "wrap", Deviation]
# What iron aboard does to a compass, B, C, D and E of its deviation (The American Practical Navigator,
# Bowditch, chapter on compasses): kind -> function of the heading.
DEVIATIONS: Mapping[Deviation, Callable[[np.ndarray], np.ndarray]] = {
    "deviation_sin": np.sin,
    "deviation_cos": np.cos,
    "deviation_sin_2": lambda psi: np.sin(2.0 * psi),
    "deviation_cos_2": lambda psi: np.cos(2.0 * psi),
}
# Smaller faults are not told, as they matter in no manoeuvre; metres and seconds are those of CyberShip
# Enterprise 1, times the scale of the ship. All chosen.
LEAST_SCALE = 0.005  # of the channel
LEAST_ANGLE = 0.0035  # rad, 0.2 deg
LEAST_RATE = 1e-3  # rad/s: half a degree in a window of prediction
LEAST_PLACE = 0.01  # m
LEAST_DELAY = 0.5  # of the time between two samples


class Column(NamedTuple):
    """What one unit of a fault adds to the path.

    Attributes:
        channel: that is wrong.
        kind: of the fault.
        unit: of its value.
        needs: what has to be measured.
        path: (n, 3), added to north, east, heading [m, m, rad], up to a constant.
        least: value from which on it matters.
        clocked: whether it runs with the clock.
    """

    channel: str
    kind: Kind
    unit: str
    needs: Needs
    path: np.ndarray
    least: float
    clocked: bool = True


Law = Callable[[Evidence, Scale], "Column | tuple[Column, ...]"]
LAWS: list[tuple[Needs, Law]] = []


def constant(needs: Needs) -> Callable[[Law], Law]:
    """Register a constant fault; its function takes the evidence and the ship's scale."""

    def register(law: Law) -> Law:
        LAWS.append((needs, law))
        return law

    return register


def columns(e: Evidence, scale: Scale) -> list[Column]:
    """All constant faults that the channels of a run can show."""
    given = {"velocity": e.velocity is not None, "rate": e.rate is not None}
    found = [law(e, scale) for needs, law in LAWS if given[needs]]
    return [c for each in found for c in ((each,) if isinstance(each, Column) else each)]


def _path(e: Evidence, move: np.ndarray | None = None, turn: np.ndarray | None = None) -> np.ndarray:
    path = np.zeros((e.time.size, 3))
    if move is not None:
        path[:, :2] = move
    if turn is not None:
        path[:, 2] = turn
    return path


@constant("velocity")
def speed_scale(e: Evidence, scale: Scale) -> Column:
    """The velocity is measured too large by a factor 1 + value."""
    assert e.by is not None
    return Column(e.by[0], "scale", "1", "velocity", _path(e, -e.gone), LEAST_SCALE)


@constant("velocity")
def axes(e: Evidence, scale: Scale) -> Column:
    """Heading and the axes of the velocity differ: the heading is too large by the value."""
    assert e.by is not None
    channel = "psi" if e.by == ("u", "v") else e.by[1]
    across = np.column_stack([e.gone[:, 1], -e.gone[:, 0]])
    sign = 1.0 if channel != "y_dot" else -1.0
    return Column(channel, "offset", "rad", "velocity", _path(e, sign * across), LEAST_ANGLE)


@constant("velocity")
def place(e: Evidence, scale: Scale) -> tuple[Column, Column]:
    """The position is measured at a place that far ahead and to starboard of that of the velocity."""
    c, s = np.cos(e.psi), np.sin(e.psi)
    sides = (("x", np.column_stack([c, s])), ("y", np.column_stack([-s, c])))
    made = [
        Column(name, "place", "m", "velocity", _path(e, side), LEAST_PLACE * scale.length, False)
        for name, side in sides
    ]
    return made[0], made[1]


@constant("velocity")
def velocity_delay(e: Evidence, scale: Scale) -> Column:
    """The velocity is stamped later than the position by the value.

    In the ship's own axes it is turned by the heading of now, so that what turns of the ship change in
    the velocity over ground is not late.
    """
    assert e.by is not None
    assert e.velocity is not None
    path = _path(e, e.velocity)
    if e.by == ("u", "v"):
        mean, turn = 0.5 * (e.velocity[1:] + e.velocity[:-1]), np.diff(e.psi)
        path[1:, :2] -= np.cumsum(np.column_stack([-mean[:, 1], mean[:, 0]]) * turn[:, None], axis=0)
    return Column(e.by[0], "delay", "s", "velocity", path, LEAST_DELAY * _period(e), False)


@constant("rate")
def rate_scale(e: Evidence, scale: Scale) -> Column:
    """The yaw rate is measured too large by a factor 1 + value."""
    return Column("r", "scale", "1", "rate", _path(e, turn=-e.turned), LEAST_SCALE)


@constant("rate")
def rate_offset(e: Evidence, scale: Scale) -> Column:
    """The yaw rate is measured too large by the value."""
    return Column(
        "r", "offset", "rad/s", "rate", _path(e, turn=e.time[0] - e.time), LEAST_RATE * scale.rate
    )


@constant("rate")
def rate_delay(e: Evidence, scale: Scale) -> Column:
    """The yaw rate is stamped later than the heading by the value."""
    assert e.rate is not None
    path = _path(e, turn=e.rate)
    return Column("r", "delay", "s", "rate", path, LEAST_DELAY * _period(e), False)


def deviations(e: Evidence) -> list[Column]:
    """The heading is measured too large by the value times a function of itself.

    Velocity in the ship's own axes is turned by it. Without a yaw rate nothing shows it.
    """
    made = []
    for kind, law in DEVIATIONS.items() if e.rate is not None else ():
        path = _path(e, turn=law(e.psi))
        if e.by == ("u", "v") and e.velocity is not None:
            across = np.column_stack([e.velocity[:, 1], -e.velocity[:, 0]]) * path[:, 2:]
            path[:, :2] = integral(e.time, across)
        made.append(Column("psi", kind, "rad", "rate", path, LEAST_ANGLE, False))
    return made


def _period(e: Evidence) -> float:
    """Median time between two samples of the pose [s]."""
    return float(np.median(np.diff(e.time[e.rows])))
