"""The measures of manoeuvring trials: their names, units and limits, and how each trial is measured."""

import math
from collections.abc import Callable, Mapping

from ..errors import InputError, nearest
from ..results.performance import ENERGY, METRICS, Metric
from .ship_passage import Passage
from .stopping_trial import stopping_measures
from .turning_circle import turning_circle
from .yaw_checking import MOST_OVERSHOOTS, zigzag_measures
from .yaw_stability import spiral_measures

NTH = ("first", "second", "third", "fourth")
MEASURES = (
    Metric("approach_speed", "m/s", "speed over ground, on the last length before the first execute"),
    Metric("advance", "m", "along the first heading, to a change of heading of 90°"),
    Metric("transfer", "m", "across the first heading, to a change of heading of 90°"),
    Metric("tactical_diameter", "m", "across the first heading, to a change of heading of 180°"),
    Metric("time_90", "s", "from the execute to a change of heading of 90°"),
    Metric("time_180", "s", "from the execute to a change of heading of 180°"),
    Metric("circle_speed", "m/s", "speed over ground in the steady turn"),
    Metric("circle_rate", "rad/s", "rate of turn in the steady turn"),
    Metric("circle_diameter", "m", "diameter of the steady turn"),
    Metric("residual_rate", "rad/s", "rate of turn at the end of the pull-out"),
    Metric("check_angle", "rad", "change of heading at the second execute"),
    Metric("initial_turning", "m", "distance from the first to the second execute"),
    Metric("initial_turning_time", "s", "from the first to the second execute"),
    *(
        Metric(
            f"overshoot_{k + 1}",
            "rad",
            f"{NTH[k]} overshoot: further change of heading after a reversal",
        )
        for k in range(MOST_OVERSHOOTS)
    ),
    *(
        Metric(f"overshoot_time_{k + 1}", "s", f"from the reversal to the {NTH[k]} overshoot")
        for k in range(MOST_OVERSHOOTS)
    ),
    Metric("reach", "s", "from the first execute until the ship is back on its first heading"),
    Metric("period", "s", "from a reversal to the next one of the same side, mean"),
    Metric("track_reach", "m", "distance until the ship stops"),
    Metric("head_reach", "m", "along the first heading, until the ship stops"),
    Metric("side_reach", "m", "to starboard of the first heading, until the ship stops"),
    Metric("stop_time", "s", "from the order until the ship stops"),
    Metric("stop_heading", "rad", "change of heading until the ship stops, to starboard"),
    Metric("rate_starboard", "rad/s", "steady rate at the full order to starboard"),
    Metric("rate_port", "rad/s", "steady rate at the full order to port"),
    Metric("loop_height", "rad/s", "difference of the rates at no order, coming from either side"),
)
EVERY = (*METRICS, ENERGY, *MEASURES)  # what metrics.json may hold

KINDS: Mapping[str, Callable[[Passage, float], dict[str, float]]] = {
    "circle": turning_circle,
    "zigzag": zigzag_measures,
    "stop": stopping_measures,
    "spiral": spiral_measures,
}
# Angles of the zig-zags that the resolution has limits for, and how far one may be off [rad].
TEN, TWENTY, OFF = math.radians(10.0), math.radians(20.0), math.radians(2.5)
# Limits in ship's lengths (MSC.137(76), 5.3).
LENGTHS = {"advance": 4.5, "tactical_diameter": 5.0, "initial_turning": 2.5, "track_reach": 15.0}


def measure(trial: str, p: Passage, length: float) -> dict[str, float]:
    """The measures of a trial, by name.

    Args:
        trial: one of :data:`KINDS`.
        p: the ship under trial.
        length: of the ship [m].

    Raises:
        InputError: no such trial, or the order under trial never changes.
    """
    if trial not in KINDS:
        raise InputError(f"no trial '{trial}'{nearest(trial, KINDS)}")
    found = KINDS[trial](p, length)
    return {metric.name: found[metric.name] for metric in MEASURES if metric.name in found}


def limits(found: Mapping[str, float], length: float) -> dict[str, float]:
    """What the resolution MSC.137(76) allows of measures: its section 5.3, for ships of 100 m or more.

    Args:
        found: measures of one trial.
        length: of the ship [m].

    Returns:
        Name -> largest value, in the unit of the measure, for those with a limit. Those of a zig-zag are
        for 10/10 and 20/20.
    """
    allowed = {n: share * length for n, share in LENGTHS.items() if n in found}
    check, speed = found.get("check_angle", 0.0), found.get("approach_speed", 0.0)
    if abs(check - TEN) > OFF:
        allowed.pop("initial_turning", None)
    if abs(check - TEN) < OFF and speed > 0.0:
        seconds = min(max(length / speed, 10.0), 30.0)  # L/V, over which limits of overshoots grow
        first, second = 5.0 + 0.5 * seconds, 17.5 + 0.75 * seconds
        allowed |= {"overshoot_1": math.radians(first), "overshoot_2": math.radians(second)}
    elif abs(check - TWENTY) < OFF:
        allowed["overshoot_1"] = math.radians(25.0)
    return {name: value for name, value in allowed.items() if name in found}
