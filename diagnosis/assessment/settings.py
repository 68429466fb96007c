"""Constants by which this room decides; no command has an option for them."""

import math
from dataclasses import dataclass

from ..runs import UNITS


@dataclass(frozen=True)
class AssessmentSettings:
    """What counts as an error, as a mistake in a file, and as a stable model.

    Seconds and metres are those of CyberShip Enterprise 1, times the scale of the ship.
    """

    # 1, of accelerations over commands, of commands over full thrust. Derived: half of the way, in
    # logarithms, between one thruster of two and the foot, the smallest of the units: sqrt(2 * 3.28).
    most_gain: float = 2.5
    # 1. Half of the way, in logarithms, to the nearest wrong unit, a hundredth. A thruster that gives a
    # tenth, or none, is a matter of the diagnosis.
    least_gain: float = math.sqrt(UNITS["command"]["%"])
    windows: float = 10.0  # 1, independent ones that a model which is not exact is worth; chosen
    # 1, share of a thrust: deviation of what of it is lost, and what of the full one nothing but an
    # actuator gives all the time; chosen
    much: float = 0.5
    neighbours: int = 5  # 1, windows by which that of a model error is predicted; chosen
    repeats: float = 0.25  # 1, share from which on an error is said to repeat; chosen
    # 1. Calibrated by tests/test_diagnosis_where.py: with one block three times as many regions were
    # found where an error depends on no covariate.
    blocks_per_cluster: int = 2
    least_contrast: float = 1.4  # 1, of the RMS in a region to that elsewhere; chosen
    largest_region: float = 0.6  # 1, share of the windows; chosen
    # 1, along an edge of a region, and speeds; chosen, within 1 % of the eigenvalues
    directions: int = 21
    least_region: float = 0.1  # 1, of the limits, so that an axis that hardly moves is checked; chosen
    limits: tuple[float, float, float] = (0.4, 0.2, 0.6)  # m/s, m/s, rad/s: 99 % of each published run
    runaway: float = 3.0  # 1, times the speeds of the region; chosen
    bound: float = 5.0  # m, four ship lengths, beyond which a ship is lost; chosen


SETTINGS = AssessmentSettings()
