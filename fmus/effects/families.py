"""Families of effects: what brings each out, and what tells two of them apart."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Family:
    """Effects that the same manoeuvres bring out.

    Attributes:
        name: of the family.
        excite: the manoeuvre that brings them out, in words that follow "run".
        apart: name of a family, its own included -> what to run to tell members of the two apart.
    """

    name: str
    excite: str
    apart: Mapping[str, str] = field(default_factory=dict)


UNKNOWN = Family("other", "the same manoeuvres with and without the suspected cause")
SYNC_PULSE = "impossible from pose and commands alone: log a sync pulse in both"
_SPEEDS = "turn on the spot, and at two speeds ahead"
_TURNS = "turn on the spot, with starts and stops of the turn"
_STEADY = "run steady and accelerating legs"

SURGE_DRAG = Family(
    "surge drag",
    "steady legs straight ahead and astern, at three speeds or more",
    {
        "surge drag": "run three or more speeds, ahead and astern, from very slow to full",
        "body-fixed": "run astern as well",
        "propellers": "change the speed often, instead of holding it",
        "earth-fixed": "run the same speeds on opposite headings",
    },
)
SURGE_BY_TURNING = Family("surge by turning", "steady circles of several radii, both ways")
SWAY_DRAG = Family(
    "sway drag",
    "crabbing to both sides at several speeds with no turn",
    {"sway at speed": "crab at rest, and drift at two speeds ahead"},
)
SWAY_BY_TURNING = Family(
    "sway by turning",
    "turning on the spot both ways, and crabbing with no turn",
    {"side thrust": "crab to both sides with no turn", "sway at speed": _SPEEDS},
)
SWAY_AT_SPEED = Family(
    "sway at speed", "the same turn and the same drift at rest and at two speeds ahead"
)
YAW_DRAG = Family(
    "yaw drag",
    "turning on the spot at several rates, both ways",
    {
        "side thrust": _TURNS,
        "yaw at speed": "turn on the spot, and at speed",
        "yaw drag": "turn on the spot at three or more rates",
    },
)
YAW_BY_DRIFT = Family(
    "yaw by drift",
    "crabbing with no turn, and turning on the spot",
    {"yaw at speed": "drift purely sideways, with no speed ahead"},
)
YAW_AT_SPEED = Family("yaw at speed", "the same turn on the spot and at two speeds ahead")
INERTIA = Family("inertia", "steady legs, and hard starts and stops on each axis")
PROPELLERS = Family(
    "propellers",
    "pulses of surge thrust of several sizes, ahead and astern",
    {"inertia": _STEADY, "propellers": "apply pulses of several sizes, ahead and astern"},
)
SIDE_THRUST = Family("side thrust", "pulses of sway force alone and of yaw moment alone")
TUNNEL_THRUSTER = Family(
    "tunnel thruster",
    "the tunnel thruster at rest, at speed, and over the whole run",
    {
        "tunnel thruster": "use the tunnel thruster at rest, at speed, and over the whole run",
        "side thrust": "give the same moment by the propellers and by the tunnel thruster",
    },
)
SMALL_OR_LARGE = Family(
    "small or large commands", "commands from very small to full ones on each thruster"
)
TIMING = Family(
    "timing",
    "steps in the commands, each held for some seconds",
    {
        "timing": "apply steps in the commands, and sample faster",
        "clock": SYNC_PULSE,
        "inertia": "apply steps in the commands, and hold each until the speed is steady",
    },
)
CLOCK = Family("clock", "a sync pulse in the log of both pose and commands")
EARTH_FIXED = Family(
    "earth-fixed",
    "a slow full circle of headings at rest and at speed",
    {
        "earth-fixed": "turn, and stop, on several headings",
        "body-fixed": "run a full circle of headings",
    },
)
BODY_FIXED = Family("body-fixed", "legs ahead and astern on at least two opposite headings")
FILTER = Family(
    "filter", "a second sensor of the same channel without a filter, or this one with it off"
)
MEASUREMENT = Family(
    "measurement", "turning on the spot both ways, and straight legs on opposite headings"
)
