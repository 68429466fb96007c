"""Measures of a zig-zag trial."""

import math

import numpy as np

from .ship_passage import Passage, approach_speed, executes, first_crossing

MOST_OVERSHOOTS = 4  # that are reported; the resolution has limits for two


def zigzag_measures(p: Passage, length: float) -> dict[str, float]:
    """Measures of a zig-zag (MSC.137(76), 4.2.4 to 4.2.8 and 5.3.2; ISO 13643-2:2017).

    An overshoot is the change of heading that goes on after the order was reversed.

    Args:
        p: one zig-zag.
        length: of the ship [m].

    Returns:
        Those of :data:`~cosim.trials.measures.MEASURES` that the trial goes far enough for.
    """
    times = executes(p)
    found = {"approach_speed": approach_speed(p, times[0], length)}
    if len(times) < 2:
        return found
    headings = [p.at(t)[2] for t in times]
    side = math.copysign(1.0, headings[1] - headings[0])
    found["check_angle"] = abs(headings[1] - headings[0])
    found["initial_turning"] = p.along(times[0], times[1])
    found["initial_turning_time"] = times[1] - times[0]
    ends = [*times[2:], float(p.time[-1])]
    for k, (begin, end) in enumerate(zip(times[1:], ends, strict=True)):
        rows = (p.time >= begin) & (p.time <= end)
        on = side * (-1.0) ** k * (p.psi[rows] - headings[k + 1])
        top = int(np.argmax(on)) if on.size else 0
        is_last = k == len(times) - 2
        if k == MOST_OVERSHOOTS or not on.size or (is_last and top == on.size - 1):
            break
        found[f"overshoot_{k + 1}"] = float(max(on[top], 0.0))
        found[f"overshoot_time_{k + 1}"] = float(p.time[rows][top]) - begin
    after = (p.time >= times[1]) & (p.time <= ends[0])
    back = first_crossing(p.time[after], -side * (p.psi[after] - headings[0]), 0.0)
    if back is not None:
        found["reach"] = back - times[0]
    periods = [b - a for a, b in zip(times[1:], times[3:], strict=False)]
    if periods:
        found["period"] = sum(periods) / len(periods)
    return found
