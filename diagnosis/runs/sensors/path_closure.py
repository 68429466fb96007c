"""How well position, speed, heading and yaw rate of a run close, without any model of a ship."""

from typing import NamedTuple

import numpy as np

from fmus.scale import Scale

from ..files.reading import Run
from ..run_constants import LONG
from .evidence import Evidence, evidence, large
from .wraps import wraps


class Closure(NamedTuple):
    """What windows of a run miss by; NaN where no velocity or no yaw rate is measured.

    Attributes:
        position: median distance between where the ship is and where velocity and heading take it [m].
        heading: RMS of the heading less the integrated yaw rate, in turns [rad].
    """

    position: float
    heading: float


def closure(run: Run, track: float, turn: float) -> Closure:
    """What integrated speed and yaw rate miss over windows from each sample on.

    Args:
        run: with velocity or yaw rate beside the pose.
        track: length of the windows of the position [s].
        turn: of those of the heading [s].
    """
    e = evidence(wraps(run, Scale()).run)  # angles that go round are no matter of closure
    position = heading = np.nan
    if e is not None and e.velocity is not None:
        first, last = _windows(e, track)
        moved = e.run.pose[last, :2] - e.run.pose[first, :2] - (e.gone[last] - e.gone[first])
        position = float(np.median(np.hypot(*moved.T))) if first.size else np.nan
    if e is not None and e.rate is not None:
        first, last = _windows(e, turn)
        said = e.turned[last] - e.turned[first]
        off = (e.psi[last] - e.psi[first] - said)[large(said) if said.size else []]
        heading = float(np.sqrt(np.mean(off**2))) if off.size else np.nan
    return Closure(position, heading)


def _windows(e: Evidence, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """First and last rows of windows without a gap."""
    time = e.time[e.rows]
    steps = np.diff(time)
    part = np.concatenate([[0], np.cumsum(steps > LONG * np.median(steps))])
    end = np.searchsorted(time, time + seconds)
    begin = np.flatnonzero(end < time.size)
    begin = begin[part[begin] == part[end[begin]]]
    return e.rows[begin], e.rows[end[begin]]
