"""Measures of a turning circle, with or without a pull-out."""

import math

import numpy as np

from .ship_passage import Passage, approach_speed, executes, first_crossing, released

QUARTER, HALF, WHOLE = 0.5 * math.pi, math.pi, 2.0 * math.pi
TAIL = 0.2  # of a pull-out, over which its last rate is the mean; chosen


def turning_circle(p: Passage, length: float) -> dict[str, float]:
    """Measures of a turning circle (MSC.137(76), 4.2.1 to 4.2.3; ISO 13643-2:2017).

    Distances are along and across the heading at the execute. The turn is steady over its last half
    turn, once the heading has changed by a whole one.

    Args:
        p: one circle.
        length: of the ship [m].

    Returns:
        Those of :data:`~cosim.trials.measures.MEASURES` that the turn goes far enough for.
    """
    begin = executes(p)[0]
    out = released(p)
    x_0, y_0, psi_0 = p.at(begin)
    held = (p.time >= begin) & (p.time <= (p.time[-1] if out is None else out))
    time, turned = p.time[held], p.psi[held] - psi_0
    side = math.copysign(1.0, turned[-1])
    turned = side * turned
    found = {"approach_speed": approach_speed(p, begin, length)}

    def moved(instant: float) -> tuple[float, float]:
        x, y, _ = p.at(instant)
        north, east = x - x_0, y - y_0
        ahead = math.cos(psi_0) * north + math.sin(psi_0) * east
        aside = math.cos(psi_0) * east - math.sin(psi_0) * north
        return ahead, side * aside

    at_90, at_180 = (first_crossing(time, turned, angle) for angle in (QUARTER, HALF))
    if at_90 is not None:
        found["advance"], found["transfer"] = moved(at_90)
        found["time_90"] = at_90 - begin
    if at_180 is not None:
        found["tactical_diameter"] = moved(at_180)[1]
        found["time_180"] = at_180 - begin
    if turned[-1] >= WHOLE:
        begun, end = first_crossing(time, turned, turned[-1] - HALF), float(time[-1])
        assert begun is not None
        found["circle_speed"] = p.along(begun, end) / (end - begun)
        found["circle_rate"] = HALF / (end - begun)
        found["circle_diameter"] = 2.0 * found["circle_speed"] / found["circle_rate"]
    if out is not None:
        late = p.time >= p.time[-1] - TAIL * (p.time[-1] - out)
        if np.count_nonzero(late) > 1:
            change = float(p.psi[late][-1] - p.psi[late][0])
            found["residual_rate"] = side * change / float(np.ptp(p.time[late]))
    return found
