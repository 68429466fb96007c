"""Measures of a direct spiral."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .ship_passage import Passage

TAIL = 0.25  # of a plateau, over which its rate is the mean; chosen: the ship is steady by then
SAME = 0.02  # of the largest order: within which it is held; chosen
SHORT = 0.2  # of the median plateau: what is shorter is on the way from one to the next; chosen


class Plateau(NamedTuple):
    """An order that is held, and the rate [rad/s] that it ends with."""

    order: float
    rate: float


def plateaus(p: Passage) -> list[Plateau]:
    """The plateaus of a spiral, in their order in time."""
    largest = float(np.abs(p.order).max())
    edges = np.flatnonzero(np.abs(np.diff(p.order)) > SAME * largest) + 1
    parts = [part for part in np.split(np.arange(p.time.size), edges) if part.size > 1]
    spans = np.array([p.time[part[-1]] - p.time[part[0]] for part in parts])
    found: list[Plateau] = []
    for part, span in zip(parts, spans, strict=True):
        if span >= SHORT * float(np.median(spans)):
            late = part[p.time[part] >= p.time[part[-1]] - TAIL * span]
            if late.size > 1:
                rate = float((p.psi[late[-1]] - p.psi[late[0]]) / (p.time[late[-1]] - p.time[late[0]]))
                found.append(Plateau(float(np.median(p.order[part])), rate))
    return found


def spiral_measures(p: Passage, length: float) -> dict[str, float]:
    """Measures of a direct spiral (ISO 13643-3:2017).

    Args:
        p: one spiral.
        length: of the ship [m]; it does not matter.

    Returns:
        Of :data:`~cosim.trials.measures.MEASURES` the rates at the full order to either side, and the
        height of the loop: the difference of the rates at no order, coming from either side. A ship that
        the full order does not turn to the other side has rates of one sign, and no such height.
    """
    held = plateaus(p)
    if not held:
        return {}
    largest = max(abs(order) for order, _ in held)

    def rates(at: float, among: Sequence[Plateau]) -> list[float]:
        return [rate for order, rate in among if abs(order - at) <= SAME * largest]

    ends = [float(np.mean(rates(end(held).order, held))) for end in (min, max)]
    found = {"rate_starboard": max(ends), "rate_port": min(ends)}
    # Not those of the approach and of the end: of those that lie between two others.
    middle = rates(0.0, held[1:-1])
    if len(middle) > 1 and ends[0] * ends[1] < 0.0:
        found["loop_height"] = max(middle) - min(middle)
    return found
