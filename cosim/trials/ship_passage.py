"""What a manoeuvring trial is measured from: the pose of the midship point, and the order."""

from typing import NamedTuple

import numpy as np

from ..errors import InputError

# Shares of the largest order: beyond the first it is put over, within the second it has not left the
# value that it had; chosen, as a measured rudder takes its time and is not quite still.
OVER, LEFT = 0.5, 0.1


class Passage(NamedTuple):
    """A ship under trial.

    Attributes:
        time: (n,), growing [s].
        x, y: (n,), north and east [m].
        psi: (n,), heading, continuous over turns [rad].
        order: (n,), under trial, in any unit; which way it turns the ship does not matter.
    """

    time: np.ndarray
    x: np.ndarray
    y: np.ndarray
    psi: np.ndarray
    order: np.ndarray

    def __repr__(self) -> str:
        return f"<passage of {self.time.size} samples in {np.ptp(self.time):.4g} s>"

    @property
    def way(self) -> np.ndarray:
        """(n,), distance along the track from its first row [m]."""
        steps = np.hypot(np.diff(self.x), np.diff(self.y))
        return np.concatenate([[0.0], np.cumsum(steps)])

    def at(self, time: float) -> tuple[float, float, float]:
        """North, east [m] and heading [rad] at an instant [s]."""
        x, y, psi = (float(np.interp(time, self.time, column)) for column in self[1:4])
        return x, y, psi

    def along(self, first: float, last: float) -> float:
        """Distance along the track between two instants [m]."""
        begin, end = np.interp([first, last], self.time, self.way)
        return float(end - begin)


def passage(
    time: np.ndarray, x: np.ndarray, y: np.ndarray, psi: np.ndarray, order: np.ndarray
) -> Passage:
    """A passage of columns (n,), without rows in which one is not finite.

    Args:
        time, x, y, psi, order: as of :class:`Passage`; the heading may be wrapped.

    Raises:
        InputError: fewer than two rows, or time does not grow.
    """
    table = np.array([time, x, y, psi, order], float)
    time, x, y, psi, order = table[:, np.isfinite(table).all(axis=0)]
    if time.size < 2:
        raise InputError("a trial has at least two samples")
    if not (np.diff(time) > 0.0).all():
        raise InputError("the times of a trial do not increase")
    return Passage(time, x, y, np.unwrap(psi), order)


def executes(p: Passage) -> list[float]:
    """Instants [s] at which the order is put over: to one side, to the other, and so on.

    An order that takes its time, as a rudder does, is put over when it leaves the value that it had.

    Raises:
        InputError: it never is.
    """
    off = p.order - p.order[0]
    largest = float(np.abs(off).max())
    if largest == 0.0:
        raise InputError("the order under trial is constant: this is not a trial")
    off = p.order - np.median(p.order[: int(np.argmax(np.abs(off) > OVER * largest))])
    side = np.sign(off) * (np.abs(off) > OVER * largest)
    over = np.flatnonzero(side)
    turns = over[np.diff(side[over], prepend=0.0) != 0.0].tolist()
    found: list[float] = []
    for first, last in zip([0, *turns[:-1]], turns, strict=True):
        before = off[first:last]
        held = np.median(before[side[first:last] == side[first]])
        still = np.flatnonzero(np.abs(before - held) <= LEFT * largest)
        found.append(float(p.time[first + int(still[-1]) + 1 if still.size else last]))
    return found


def released(p: Passage) -> float | None:
    """When the order is taken back at the end [s]; None if it is held until then."""
    off = np.abs(p.order - p.order[0])
    if off[-1] > LEFT * off.max():
        return None
    return float(p.time[np.flatnonzero(off > OVER * off.max())[-1] + 1])


def approach_speed(p: Passage, execute: float, length: float) -> float:
    """Speed over ground [m/s] on the last ship's length before an execute, or what there is of it."""
    end = float(np.interp(execute, p.time, p.way))
    begin = float(np.interp(end - length, p.way, p.time))
    first = max(0, int(np.searchsorted(p.time, min(begin, execute), "right")) - 1)
    last = max(first + 1, int(np.searchsorted(p.time, execute, "right")) - 1)
    moved = np.hypot(p.x[last] - p.x[first], p.y[last] - p.y[first])
    return float(moved / (p.time[last] - p.time[first]))


def first_crossing(time: np.ndarray, values: np.ndarray, level: float) -> float | None:
    """When values (n,) first reach a level from below [s], by linear interpolation; None: never."""
    reached = np.flatnonzero(values >= level)
    if not reached.size:
        return None
    k = int(reached[0])
    if k == 0:
        return float(time[0])
    share = (level - values[k - 1]) / (values[k] - values[k - 1])
    return float(time[k - 1] + share * (time[k] - time[k - 1]))
