"""Constant faults between two channels: how each would move or turn the ship.

Each fault is a column: the path that one unit of it adds to what velocity and yaw rate say, so that it
is found by least squares together with all others.
"""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

import numpy as np

from fmus.scale import REFERENCE_LENGTH, Scale

from ..cleaning import noise
from ..run_constants import HORIZON
from .evidence import Evidence, integral, without_rate

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
# [1, rad] of a channel or a clock, of ship's lengths, or in a window of prediction. Chosen: smaller
# faults matter in no manoeuvre.
LEAST = 0.005


class FaultColumn(NamedTuple):
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

    def during(self, steps: np.ndarray) -> "FaultColumn":
        """The same fault in some steps of a run alone, of which ``steps`` (n - 1,) are true."""
        moved = np.where(steps[:, None], np.diff(self.path, axis=0), 0.0)
        return self._replace(path=np.vstack([np.zeros((1, 3)), np.cumsum(moved, axis=0)]))


def columns(e: Evidence, scale: Scale) -> list[FaultColumn]:
    """All constant faults that the channels of a run can show."""
    late = float(np.median(np.diff(e.time[e.rows]))) / 2.0  # half of the time between two samples
    return [*_of_velocity(e, scale, late), *_of_rate(e, scale, late)]


def least_place(scale: Scale) -> float:
    """Distance [m] from which on another place aboard matters."""
    return LEAST * REFERENCE_LENGTH * scale.length


def _least_scale(values: np.ndarray) -> float:
    """Share by which the scale of a channel (n, k) may be off at the least.

    Noise of the channel lessens it by the share that noise has in its square (errors in variables).
    """
    return max(LEAST, float(np.sum(noise(values) ** 2) / np.sum(np.mean(values**2, axis=0))))


def _path(e: Evidence, move: np.ndarray | float = 0.0, turn: np.ndarray | float = 0.0) -> np.ndarray:
    path = np.zeros((e.time.size, 3))
    path[:, :2], path[:, 2] = move, turn
    return path


def _of_velocity(e: Evidence, scale: Scale, late: float) -> list[FaultColumn]:
    """Scale and axes of the velocity, the place of the position aboard, and the velocity's delay."""
    if e.velocity is None or e.by is None:
        return []
    # The heading is too large by the value, or the axes of the velocity are turned.
    axes = "psi" if e.by == ("u", "v") else e.by[1]
    across = np.column_stack([e.gone[:, 1], -e.gone[:, 0]]) * (-1.0 if axes == "y_dot" else 1.0)
    # The position is measured that far ahead and to starboard of where the velocity is.
    c, s, place = np.cos(e.psi), np.sin(e.psi), least_place(scale)
    ahead, aside = (_path(e, np.column_stack(side)) for side in ((c, s), (-s, c)))
    # In the ship's own axes the velocity is turned by the heading of now, so that what turns of the ship
    # change in the velocity over ground is not late.
    delay = _path(e, e.velocity)
    if e.by == ("u", "v"):
        mean, turn = 0.5 * (e.velocity[1:] + e.velocity[:-1]), np.diff(e.psi)
        delay[1:, :2] -= np.cumsum(np.column_stack([-mean[:, 1], mean[:, 0]]) * turn[:, None], axis=0)
    return [
        FaultColumn(e.by[0], "scale", "1", "velocity", _path(e, -e.gone), _least_scale(e.velocity)),
        FaultColumn(axes, "offset", "rad", "velocity", _path(e, across), LEAST),
        FaultColumn("x", "place", "m", "velocity", ahead, place, False),
        FaultColumn("y", "place", "m", "velocity", aside, place, False),
        FaultColumn(e.by[0], "delay", "s", "velocity", delay, late, False),
    ]


def _of_rate(e: Evidence, scale: Scale, late: float) -> list[FaultColumn]:
    """Scale, offset and delay of the yaw rate."""
    if e.rate is None:
        return []
    offset = _path(e, turn=e.time[0] - e.time)
    found = [
        FaultColumn("r", "scale", "1", "rate", _path(e, turn=-e.turned), _least_scale(e.rate[:, None])),
        FaultColumn("r", "offset", "rad/s", "rate", offset, LEAST / (HORIZON * scale.time)),
        FaultColumn("r", "delay", "s", "rate", _path(e, turn=e.rate), late, False),
    ]
    measured = ~without_rate(e.run)[1:]  # elsewhere the rate is that of the heading, which is right
    return [fault.during(measured) for fault in found]


def deviations(e: Evidence, heading: np.ndarray) -> list[FaultColumn]:
    """The heading is measured too large by the value times a function of itself.

    Velocity in the ship's own axes is turned by it. Without a yaw rate nothing shows it.

    Args:
        e: what the channels say.
        heading: (n,), without noise [rad], which a deviation that follows it would seem to lessen.
    """
    made = []
    for kind, law in DEVIATIONS.items() if e.rate is not None else ():
        path = _path(e, turn=law(heading))
        if e.by == ("u", "v") and e.velocity is not None:
            across = np.column_stack([e.velocity[:, 1], -e.velocity[:, 0]]) * path[:, 2:]
            path[:, :2] = integral(e.time, across)
        made.append(FaultColumn("psi", kind, "rad", "rate", path, LEAST, False))
    return made
