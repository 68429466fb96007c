"""Faults of the measurement chain that pass for physics."""

from math import degrees
from typing import Annotated, Any

from ..declare import Range, Variable
from ..frames import rotate_to_earth
from ..ops import Number
from .effect import Effect, Search, Wording, effect
from .families import CLOCK, FILTER, MEASUREMENT
from .text import Found, number, offset, towards

TRACKERS = (0.2, 0.4, 0.8, 1.6)  # s, to try: a fit starts within a factor of 1.5 of those between

Pose = tuple[Number, Number, Number]
ABOARD = Range(-0.6, 0.6)  # the ship is 1.1 m long
# s, of a filter; receivers smooth over some samples, a chart plotter over seconds.
LAGS = Range(0.0, 3.0)
AXIS = 0.035  # rad, by which an instrument's axis is off that of the ship: two degrees; chosen
LATE = 0.2  # s, by which a channel is usually late, by transport and by filters of some samples; chosen
# Offsets of the clock to try [s]: some samples, and what a slow network gives.
OFFSETS = (-0.5, -0.3, -0.2, -0.1, -0.05, 0.05, 0.1, 0.2, 0.3, 0.5)


@effect(
    "marker_offset",
    "measurement",
    "XYN",
    formula="p_m = p + R(psi) (dx, dy)",
    symbol="dx, dy",
    sign="positive: markers ahead and to starboard of the assumed place",
    source="4.3.1, bias",
    search=Search(differentiable=True, of_each_run=True),
    wording=Wording(
        lambda f: f"The position is measured {offset(f, 'marker_offset')} of the place in the model.",
        MEASUREMENT,
    ),
)
def marker_offset(
    pose: Pose,
    marker_offset_dx: Annotated[float, "m", "markers forward of the body origin", ABOARD] = 0.0,
    marker_offset_dy: Annotated[float, "m", "markers to starboard of the body origin", ABOARD] = 0.0,
) -> Pose:
    """The position is measured at another point of the ship."""
    x, y, psi = pose
    dx, dy = rotate_to_earth(psi, marker_offset_dx, marker_offset_dy)
    return x + dx, y + dy, psi


def heading_sentence(f: Found) -> str:
    off = towards(degrees(f["heading_offset"]), "°", "N").replace(" °", "°")
    return f"The heading is measured {off} of the true one."


@effect(
    "heading_offset",
    "measurement",
    "XYN",
    formula="psi_m = psi + δ",
    symbol="δ",
    sign="positive: measured to starboard of the true heading",
    source="4.3.1, bias",
    search=Search(differentiable=True, of_each_run=True),
    usual=AXIS,
    wording=Wording(heading_sentence, MEASUREMENT),
)
def heading_offset(
    pose: Pose,
    heading_offset: Annotated[float, "rad", "measured heading minus true heading"] = 0.0,
) -> Pose:
    """The heading is measured with an offset."""
    x, y, psi = pose
    return x, y, psi + heading_offset


def clock_sentence(f: Found) -> str:
    time = number(f["clock_offset"])
    if f["clock_offset"] > 0.0:
        return f"The measured pose is {time} s older than its time stamp."
    late = f"or the commands are logged {time} s late"
    return f"The measured pose is {time} s younger than its time stamp, {late}."


# No FMU has the clock of the measurement system: in a scenario it is the fault 'delay'.
CLOCK_OFFSET = Effect(
    id="clock_offset",
    kind="measurement",
    axis="XYN",
    description="the pose is older than its stamp: the fault 'delay' of a scenario",
    formula="(x, y, psi)_m(t) = (x, y, psi)(t - δ)",
    symbol="δ",
    sign="positive: the pose is older than its stamp",
    source="4.3.1",
    linear=False,
    parameters=(Variable("clock_offset", "s", "age of the pose at its time stamp", 0.0),),
    function=None,
    search=Search(tries=[{"clock_offset": d} for d in OFFSETS]),
    wording=Wording(clock_sentence, CLOCK),
)


def measured_behind(name: str, meaning: str, sentence: str, search: Search, **more: Any) -> Effect:
    """The effect that a channel of the pose is measured behind a filter with one time.

    Args:
        name: of the effect, and of the time.
        meaning: of the time.
        sentence: what is said of it, with {} in place of the time.
        search, more: see :class:`.Effect`.
    """
    return Effect(
        name,
        "measurement",
        "XYN",
        sign="0: none",
        linear=False,
        parameters=(Variable(name, "s", meaning, 0.0, LAGS),),
        function=None,
        search=search,
        wording=Wording(lambda f: sentence.format(f"{number(f[name])} s"), FILTER),
        **more,
    )


def low_pass(channel: str, symbol: str, coordinates: str) -> Effect:
    """The effect that a channel is measured behind a low-pass filter of first order."""
    return measured_behind(
        f"{channel}_lag",
        f"time constant of the low-pass filter of the {channel}",
        f"The {channel} is measured through a low-pass filter with a time constant of {{}}.",
        Search(differentiable=True),
        description=f"the measured {channel} is low-pass filtered (first order)",
        formula=f"T d({coordinates})_m/dt = ({coordinates}) - ({coordinates})_m",
        symbol=symbol,
        source="first-order lag of an instrument",
    )


def tracker(channel: str, symbol: str, coordinates: str) -> Effect:
    """The effect that a channel is the estimate of a steady Kalman filter of constant velocity."""
    name = f"{channel}_tracker"
    return measured_behind(
        name,
        f"time constant of the tracking filter of the {channel}",
        f"The {channel} is measured through a tracking filter with a time constant of {{}}.",
        Search(tries=[{name: T} for T in TRACKERS]),
        description=f"the measured {channel} is the estimate of a Kalman filter of constant velocity",
        formula=f"T^2 d2y/dt2 + sqrt(2) T d(y - p)/dt + y - p = 0, p = ({coordinates})",
        symbol=symbol,
        source="Kalata 1984, alpha-beta filter at small gains",
    )


def latency(channel: str, symbol: str, coordinates: str) -> Effect:
    """The effect that a channel is older than its time stamp, and the others are not."""
    return measured_behind(
        f"{channel}_latency",
        f"age of the {channel} at its time stamp",
        f"The {channel} is {{}} older than its time stamp.",
        Search(differentiable=True),
        description=f"the measured {channel} alone is older than its stamp",
        formula=f"({coordinates})_m(t) = ({coordinates})(t - δ)",
        symbol=symbol,
        source="4.3.1; latency of a receiver",
        usual=LATE,
    )


# An FMU of the thrusters has the commands themselves.
COMMAND_LAG = measured_behind(
    "command_lag",
    "time constant of the low-pass filter of the commands",
    "The commands are logged through a low-pass filter with a time constant of {}.",
    Search(tries=[{"command_lag": T} for T in TRACKERS]),
    description="the logged commands are low-pass filtered (first order)",
    formula="T dc_m/dt = c - c_m",
    symbol="T_c",
    source="first-order lag of a display or a logger",
)
# No FMU has the receiver's filter, as none has its clock.
POSITION_LAG = low_pass("position", "T_p", "x, y")
HEADING_LAG = low_pass("heading", "T_ψ", "psi")
POSITION_TRACKER = tracker("position", "T_p", "x, y")
HEADING_TRACKER = tracker("heading", "T_ψ", "psi")
POSITION_LATENCY = latency("position", "δ_p", "x, y")
HEADING_LATENCY = latency("heading", "δ_ψ", "psi")
MEASURED_BEHIND = (
    (POSITION_LAG, HEADING_LAG),
    (POSITION_TRACKER, HEADING_TRACKER),
    (POSITION_LATENCY, HEADING_LATENCY),
)
