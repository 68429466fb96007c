"""Measures of a stopping trial."""

import math

import numpy as np

from .ship_passage import Passage, approach_speed, executes, first_crossing


def stopping_measures(p: Passage, length: float) -> dict[str, float]:
    """Measures of a stop (MSC.137(76), 4.2.9 and 4.2.10; ISO 13643-4:2017).

    The ship has stopped where its velocity over ground has no more part along its heading.

    Args:
        p: one stop.
        length: of the ship [m].

    Returns:
        Those of :data:`~cosim.trials.measures.MEASURES` that the trial goes far enough for.
    """
    begin = executes(p)[0]
    found = {"approach_speed": approach_speed(p, begin, length)}
    north, east = (np.gradient(column, p.time) for column in (p.x, p.y))
    astern = -(np.cos(p.psi) * north + np.sin(p.psi) * east)
    after = p.time >= begin
    end = first_crossing(p.time[after], astern[after], 0.0)
    if end is None:
        return found
    x_0, y_0, psi_0 = p.at(begin)
    x, y, psi = p.at(end)
    found["stop_time"] = end - begin
    found["head_reach"] = math.cos(psi_0) * (x - x_0) + math.sin(psi_0) * (y - y_0)
    found["track_reach"] = p.along(begin, end)
    found["side_reach"] = math.cos(psi_0) * (y - y_0) - math.sin(psi_0) * (x - x_0)
    found["stop_heading"] = psi - psi_0
    return found
