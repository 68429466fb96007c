"""What cannot be told apart on some data, and which manoeuvre would tell.

Each effect belongs to a family. A pair of effects, or else of families, has an advice of its own; any
other pair is told apart by what excites the one and the other.
"""

from collections.abc import Iterable, Sequence
from itertools import product

from fmus.effects import EFFECTS

FAMILIES: dict[str, tuple[str, ...]] = {
    "surge drag": ("X_u", "X_|u|u", "X_uuu", "X_uu", "curve_X(u)"),
    "surge by turning": ("X_|u|r", "X_vr", "X_vv", "X_rr"),
    "sway drag": ("Y_v", "Y_|v|v", "Y_vvv"),
    "sway by turning": ("Y_r", "Y_|r|r", "Y_|r|v", "Y_|v|r"),
    "sway at speed": ("Y_ur", "Y_uv"),
    "yaw drag": ("N_r", "N_|r|r"),
    "yaw by drift": ("N_v", "N_|v|v", "N_|r|v", "N_|v|r"),
    "yaw at speed": ("N_ur", "N_uv"),
    "inertia": ("mass", "added_mass_X", "added_mass_Y", "added_mass_N"),
    "propellers": ("loss_vsp", "loss_surge", "thrust_curve", "curve_vsp_x(c)", "curve_vsp_y(c)"),
    "side thrust": ("loss_sway", "loss_yaw", "attack_point"),
    "bow thruster": ("loss_bow", "bow_speed_loss", "curve_bow(|u|)", "bow_failure"),
    "small or large commands": ("deadband", "saturation"),
    "timing": ("lag", "delay"),
    "clock": ("clock_offset",),
    "earth-fixed": ("earth_force", "current", "waves"),
    "body-fixed": ("body_bias",),
    "measurement": ("heading_offset", "marker_offset"),
}
FAMILY = {name: family for family, names in FAMILIES.items() for name in names}
OTHER = "other"
MOST_TOLD = 4

# What brings out each family.
EXCITE = {
    "surge drag": "steady legs straight ahead and astern, at three speeds or more",
    "surge by turning": "steady circles of several radii, both ways",
    "sway drag": "crabbing to both sides at several speeds with no turn",
    "sway by turning": "turning on the spot both ways, and crabbing with no turn",
    "sway at speed": "the same turn and the same drift at rest and at two speeds ahead",
    "yaw drag": "turning on the spot at several rates, both ways",
    "yaw by drift": "crabbing with no turn, and turning on the spot",
    "yaw at speed": "the same turn on the spot and at two speeds ahead",
    "inertia": "steady legs, and hard starts and stops on each axis",
    "propellers": "pulses of surge thrust of several sizes, ahead and astern",
    "side thrust": "pulses of sway force alone and of yaw moment alone",
    "bow thruster": "the bow thruster at work at rest, at speed, and over the whole run",
    "small or large commands": "commands from the very small to the full ones on each thruster",
    "timing": "steps in the commands, each held for some seconds",
    "clock": "a sync pulse in the log of both pose and commands",
    "earth-fixed": "a slow full circle of headings at rest and at speed",
    "body-fixed": "legs ahead and astern on at least two opposite headings",
    "measurement": "turning on the spot both ways, and straight legs on opposite headings",
    OTHER: "runs with and without what is suspected",
}


def _pairs(*entries: tuple[str, str, str]) -> dict[frozenset[str], str]:
    return {frozenset((a, b)): text for a, b, text in entries}


_CLOCK = "impossible from pose and commands alone: log a sync pulse in both"
BY_ID = _pairs(
    ("X_u", "X_|u|u", "run three or more speeds, from very slow to full"),
    ("X_u", "body_bias", "run astern as well"),
    ("loss_surge", "X_u", "pulse the speed instead of keeping it"),
    ("loss_surge", "mass", "run steady and accelerating legs"),
    ("loss_sway", "Y_r", "crab to both sides with no turn"),
    ("loss_yaw", "N_r", "turn on the spot, with starts and stops of the turn"),
    ("N_r", "N_ur", "turn on the spot, and at speed"),
    ("N_v", "N_uv", "drift purely sideways, with no speed ahead"),
    ("loss_bow", "bow_speed_loss", "use the bow thruster at rest and at speed"),
    ("loss_bow", "bow_failure", "use the bow thruster from the very start of a run to its end"),
    ("lag", "delay", "give steps in the commands, and measure faster"),
    ("current", "earth_force", "turn, and stop, on several headings"),
    ("earth_force", "body_bias", "run a full circle of headings"),
    ("delay", "clock_offset", _CLOCK),
    ("lag", "clock_offset", "give steps in the commands; " + _CLOCK),
)
BY_FAMILY = _pairs(
    ("surge drag", "surge drag", "run three or more speeds, ahead and astern, from very slow to full"),
    ("surge drag", "body-fixed", "run astern as well"),
    ("surge drag", "propellers", "pulse the speed instead of keeping it"),
    ("surge drag", "earth-fixed", "run the same speeds on opposite headings"),
    ("propellers", "inertia", "run steady and accelerating legs"),
    ("propellers", "propellers", "give pulses of several sizes, ahead and astern"),
    ("sway by turning", "side thrust", "crab to both sides with no turn"),
    ("sway by turning", "sway at speed", "turn on the spot, and at two speeds ahead"),
    ("sway drag", "sway at speed", "crab at rest, and drift at two speeds ahead"),
    ("yaw drag", "side thrust", "turn on the spot, with starts and stops of the turn"),
    ("yaw drag", "yaw at speed", "turn on the spot, and at speed"),
    ("yaw drag", "yaw drag", "turn on the spot at three or more rates"),
    ("yaw by drift", "yaw at speed", "drift purely sideways, with no speed ahead"),
    ("bow thruster", "bow thruster", "use the bow thruster at rest, at speed, and over the whole run"),
    ("bow thruster", "side thrust", "make the same moment by the propellers and by the bow thruster"),
    ("timing", "timing", "give steps in the commands, and measure faster"),
    ("timing", "clock", _CLOCK),
    ("timing", "inertia", "give steps in the commands, and hold each until the speed is steady"),
    ("earth-fixed", "earth-fixed", "turn, and stop, on several headings"),
    ("earth-fixed", "body-fixed", "run a full circle of headings"),
)


def family(name: str) -> str:
    """The family of an effect; that of a user's is the last."""
    return FAMILY.get(name, OTHER)


def tell_apart(one: str, other: str) -> str:
    """What to run so that two effects can be told apart.

    Args:
        one, other: ids of effects.
    """
    families = family(one), family(other)
    found = BY_ID.get(frozenset((one, other))) or BY_FAMILY.get(frozenset(families))
    return found or "run " + "; and ".join(dict.fromkeys(EXCITE[f] for f in families))


def advice(name: str, alike: Sequence[str]) -> str:
    """What to run next, for an effect and those that the data cannot tell from it; empty if none.

    Args:
        name: id of the effect.
        alike: ids of the others, the most likely first; what is told is for the first few.
    """
    texts: dict[str, list[str]] = {}
    for other in alike[:MOST_TOLD]:
        texts.setdefault(tell_apart(name, other), []).append(other)
    told = [f"To tell {name} from {listed(ids)}: {text}." for text, ids in texts.items()]
    if len(alike) > MOST_TOLD:
        told.append("So many causes fit that the data hold too little: vary speed, turn and drift more.")
    return " ".join(told)


def listed(names: Sequence[str]) -> str:
    """Names in a row: a, b or c; of many the first few, and how many more."""
    shown = [*names[:MOST_TOLD]]
    more = len(names) - len(shown)
    *most, last = [*shown, f"{more} others"] if more else shown
    return f"{', '.join(most)} or {last}" if most else last


def separation_note(name: str, alike: Sequence[str]) -> str:
    """What these data cannot tell; empty if all is told."""
    return f"On these data {name} cannot be told apart from {listed(alike)}." if alike else ""


def every_pair() -> Iterable[tuple[str, str]]:
    """All pairs of effects of the registry."""
    return ((a, b) for a, b in product(EFFECTS, EFFECTS) if a < b)
