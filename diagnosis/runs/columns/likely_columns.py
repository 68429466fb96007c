"""Which columns of a measurement a signal is likely to be: by name, unit, range and motion."""

from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

import numpy as np

from fmus.frames import rotate_to_body

from ...execution.short_text import SHOWN
from ..files.reading import held_values
from ..run_constants import EVERY, FEWEST
from .columns import OUTPUTS, POSE
from .geographic import unwrapped
from .name_words import PLAIN, words_of
from .unit_check import SI_UNIT, UNITS, doubts, largest

# Words of a speed, which an angle is not.
CHANGES = frozenset(("velocity", "velo", "vel", "speed", "rate", "angvelo", "angular"))
ORDERS = frozenset(("order", "command", "cmd"))  # words of a reference, which is no measurement
MEASURED = "measured"  # word of what an actuator does, as its feedback
# Words of a column that holds the sign of another one, and its cells of a negative value.
SIGN = frozenset(("dir", "direction", "sign", "gear", "side", "clutch"))
ASTERN = frozenset(("r", "rev", "reverse", "astern", "back", "backward", "b", "aft", "-1", "-1.0", "-"))
# Words of names that say how a signal was found or what quantity it is, which its unit says as well.
FILLERS = CHANGES.union(
    ORDERS,
    SIGN,
    ("hat", "est", "estimated", "estimate", "meas", MEASURED, "measurement", "filtered", "true"),
    ("mid", "midship", "position", "pos", "coordinate", "angle", "ang", "distance", "data", "value"),
    ("thruster", "thrusters", "actuator", "actuators", "azimuth", "az", "motor", "main"),
    ("gyro", "compass", "utm", "track", "gps", "gnss", "imu", "ins", "ahrs", "mru", "seapath", "nacos"),
    ("de", "du", "di", "do", "van", "der", "burta"),
    ("gga", "rmc", "hdt", "me", "sg"),  # sentences of NMEA 0183, tags of plants
)
# Quantity -> word that is left of a name -> signal.
WORDS = {
    "length": {"x": "x", "north": "x", "northing": "x", "y": "y", "east": "y", "easting": "y"},
    "angle": {
        **dict.fromkeys(("psi", "heading", "yaw", "hdg", "proa"), "psi"),
        **dict.fromkeys(("course", "cog"), "course"),
        "wind": "wind_direction",
    },
    "speed": {"u": "u", "surge": "u", "v": "v", "vm": "v", "sway": "v", "wind": "wind_speed"},
    "rate": dict.fromkeys(("r", "yaw", "psi", "heading"), "r"),
}
# Grid coordinates: x to east, y to north.
OF_UTM = {"length": WORDS["length"] | {"x": "y", "y": "x"}}
REVOLUTIONS = frozenset(("n", "rpm", "rps", "revolutions", "shaft"))
# Quantity of a command -> words that tell it.
KINDS = {"angle": frozenset(("angle", "ang")), "shaft speed": REVOLUTIONS | {"speed"}}
# What a signal is compared with of the motion; other commands with all of it.
MOVES = {"tau_X": ("surge",), "tau_Y": ("sway",), "tau_N": ("yaw",), "psi": ("course",)}
MOVED = {"shaft speed": ("surge",), "angle": ("yaw",), "time": ()}
AXES = {"surge": "x", "sway": "y"}  # as forces along them are called
LIKELY = 0.4  # 1, correlation or likeness of names from which on it counts (chosen)


class LikelyColumn(NamedTuple):
    """A column that may be that of a signal.

    Attributes:
        name: of the column.
        reasons: what speaks for it, as parts of a sentence.
        score: by which columns are compared.
    """

    name: str
    reasons: Sequence[str]
    score: float


def unit_in(name: str) -> str:
    """The unit that a word of a column's name is, as rpm; empty if none is."""
    return next((word for word in words_of(name) if word in ("rpm", "rps")), "")


def meaning_of_words(name: str, unit: str, quantity: Mapping[str, str]) -> str:
    """The signal that words of a column's name and its unit tell; empty if they tell none, or several.

    Args:
        name: of the column, without its unit.
        unit: of the column; without one only an angle is recognised, as in ``HDT heading``, or a
            command of an actuator, as in ``port/n_cmd``, ``port angle``, or ``rudder`` of one command.
        quantity: signal -> quantity.
    """
    words = words_of(name)
    left = [w for w in words if w not in FILLERS and not w.isdigit()]
    kinds = {q for q in WORDS if unit in UNITS[q] or (not unit and q == "angle")}
    if not ORDERS.isdisjoint(words) or not (unit or (CHANGES | {"wind"}).isdisjoint(words)):
        kinds = set()
    found = {
        signals[left[0]]
        for q, signals in (WORDS if "utm" not in words else OF_UTM).items()
        if q in kinds and len(left) == 1 and signals.get(left[0]) in quantity
    }
    found |= {
        s
        for s, q in quantity.items()
        if "." in s
        and (unit in UNITS[q] or (not unit and _is_command(words, s, quantity)))
        and _is_of_actuator(words, s, q)
    }
    return found.pop() if len(found) == 1 else ""


def signal_of_symbol(name: str, unit: str, quantity: Mapping[str, str]) -> str:
    """The command whose symbol a name is, as ``delta`` of the only rudder; empty if none, or several.

    Args:
        name, unit, quantity: as of :func:`meaning_of_words`.
    """
    symbol = name.translate(PLAIN)
    symbol = symbol.casefold() if len(symbol) > 1 else symbol
    found = [s for s in quantity if s.partition(".")[2] == symbol and symbol not in OUTPUTS]
    return found[0] if len(found) == 1 and unit in ("", *UNITS[quantity[found[0]]]) else ""


def is_steering(name: str) -> bool:
    """Whether a name is that of an angle that steers, of whatever actuator."""
    return {word for word in words_of(name) if word not in FILLERS} == {"rudder"}


def is_of_shaft(name: str, unit: str) -> bool:
    """Whether a name and its unit are those of revolutions, of whatever shaft."""
    stated = unit in UNITS["shaft speed"] and not REVOLUTIONS.isdisjoint(words_of(name))
    return stated or unit in ("rpm", "rps")


def names_no_other_machine(name: str) -> bool:
    """Whether a name is that of revolutions or a rudder, and of no other machine, as a generator."""
    left = {word for word in words_of(name) if not word.isdigit()}
    return left <= FILLERS | REVOLUTIONS | {"rudder", "propeller"}


def _is_command(words: Sequence[str], signal: str, quantity: Mapping[str, str]) -> bool:
    """Whether words tell which command of its actuator a column without a unit holds."""
    actuator, _, command = signal.partition(".")
    own = {s.partition(".")[2] for s in quantity if s.startswith(f"{actuator}.")}
    only = own - OUTPUTS.keys() == {command}
    return says_command(" ".join(words), signal, quantity) or (only and CHANGES.isdisjoint(words))


def says_command(name: str, signal: str, quantity: Mapping[str, str]) -> bool:
    """Whether words of a column's name are that of a command, or of its quantity."""
    words = {*words_of(name)}
    return not words.isdisjoint({signal.partition(".")[2], *KINDS.get(quantity[signal], ())})


def signal_of_sign(name: str, quantity: Mapping[str, str]) -> str:
    """The command whose sign a column of some name holds, as ``port_dir``; empty if none, or several."""
    words = words_of(name)
    found = [
        s for s, q in quantity.items() if not SIGN.isdisjoint(words) and _is_of_actuator(words, s, q)
    ]
    return found[0] if len(found) == 1 else ""


def _is_of_actuator(words: Sequence[str], signal: str, quantity: str) -> bool:
    """Whether words name an actuator, or the beginning of it, its command and nothing else.

    A shaft on some side is that of the propeller there.
    """
    actuator, _, command = signal.partition(".")
    left, own = list(dict.fromkeys(words)), words_of(actuator)
    if quantity == "shaft speed" and (len(own) > 1 or "shaft" in left):
        own = [word for word in own if word != "propeller" or "propeller" in left]
    for word in own:
        same = [w for w in left if w == word or (len(w) > 2 and word.startswith(w))]
        if not same:
            return False
        left.remove(same[0])
    said = {command} | (REVOLUTIONS | {"propeller"} if quantity == "shaft speed" else set())
    return not set(left) - said - FILLERS


def motion_of(known: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What is known of the motion by a pose, smoothed: speeds and accelerations along each axis.

    Args:
        known: time, x, y and psi (n,), SI, as far as they are known.

    Returns:
        Such as ``surge speed`` -> (n,); empty without time and position.
    """
    if not {"time", "x", "y"} <= known.keys() or np.isfinite(known["time"]).sum() < FEWEST:
        return {}
    t = known["time"]
    there = [s for s in POSE if s in known]
    pose = held_values(np.column_stack([known[s] for s in there]))  # topics in rows of their own
    held = dict(zip(there, pose.T, strict=True))
    apart = float(np.nanmedian(np.diff(t)))
    width = max(int(EVERY / apart), 1) if apart > 0.0 else 1

    def rate(values: np.ndarray) -> np.ndarray:
        half = (width + 1) // 2
        found = np.full(values.size, np.nan)
        found[half:-half] = (values[2 * half :] - values[: -2 * half]) / (t[2 * half :] - t[: -2 * half])
        return found

    with np.errstate(divide="ignore", invalid="ignore"):
        north, east = rate(held["x"]), rate(held["y"])
        found = {"course": unwrapped(np.arctan2(east, north))}
        if "psi" in held:
            rows = np.isfinite(pose).all(axis=1) & np.isfinite(t)
            degrees = any("psi" in doubt.signals for doubt in doubts(t[rows], pose[rows]))
            psi = unwrapped(np.radians(held["psi"]) if degrees else held["psi"])
            surge, sway = rotate_to_body(psi, north, east)
            speeds = {"surge": surge, "sway": sway, "yaw": rate(psi)}
            found |= {f"{axis} speed": speed for axis, speed in speeds.items()}
            found |= {f"{axis} acceleration": rate(speed) for axis, speed in speeds.items()}
    return found


def likely_columns(
    signal: str,
    quantity: str,
    named: Mapping[str, tuple[str, str, np.ndarray]],
    motion: Mapping[str, np.ndarray],
) -> list[LikelyColumn]:
    """Columns that may be that of a signal, the likeliest first.

    Args:
        signal, quantity: the signal.
        named: column -> its name without the unit, its unit (empty if not known) and its numbers (n,).
        motion: of :func:`motion_of`.
    """
    found = [
        LikelyColumn(name, *stated)
        for name, (bare, unit, values) in named.items()
        if (stated := _evidence(signal, quantity, bare, unit, values, motion))
    ]
    return sorted(found, key=lambda c: -c.score)[:SHOWN]


def _evidence(
    signal: str,
    quantity: str,
    bare: str,
    unit: str,
    values: np.ndarray,
    motion: Mapping[str, np.ndarray],
) -> tuple[list[str], float] | None:
    """What speaks for a column, and how much; None where something excludes it, or nothing does."""
    numbers = values[np.isfinite(values)]
    if not _is_possible(signal, quantity, unit, numbers):
        return None
    known = WORDS.get(quantity, {})
    words = words_of(bare)
    means = any(known.get(word) == signal for word in words) or (
        quantity == "shaft speed" and not REVOLUTIONS.isdisjoint(words)
    )
    found: dict[str, float] = {}  # reason -> how much it counts
    like = 1.0 if means else _likeness(signal, bare)
    if quantity == "time":
        steps = np.diff(numbers)  # rows may be repeated
        if not (np.all(steps >= 0.0) and np.median(steps) > 0.0):
            return None
        found["increases from row to row"] = 1.0
    if like >= LIKELY:
        found["by its name"] = like
    if unit in UNITS[quantity]:
        found[f"by its unit {unit}"] = 0.5
    elif unit == "%" and found:
        found[f'in %: of its limit, or state the "factor" to {SI_UNIT[quantity]}'] = 0.0
    axes = MOVES.get(signal) or MOVED.get(quantity, ("surge", "sway", "yaw"))
    if quantity == "angle":  # it may wrap
        values = unwrapped(values if np.abs(numbers).max() <= 2.0 * np.pi else np.radians(values))
    pairs = {n: _correlation(values, m) for n, m in motion.items() if n.partition(" ")[0] in axes}
    best = max(pairs, key=lambda name: abs(pairs[name]), default="")
    if best and abs(pairs[best]) >= LIKELY:
        found[f"correlates {pairs[best]:+.2f} with the {best}"] = abs(pairs[best])
    return ([*found], sum(found.values())) if found else None


def _is_possible(signal: str, quantity: str, unit: str, numbers: np.ndarray) -> bool:
    """Whether finite numbers (n,) of a column in some unit may be a signal at all."""
    moves = quantity in ("time", "length") or signal == "psi"  # a shaft may turn evenly
    if numbers.size < 2 or (moves and np.ptp(numbers) == 0.0):
        return False
    of_most = unit == "%" and "." in signal  # its share of the most
    if unit not in ("", "-", *UNITS[quantity]) and not of_most:
        return False
    return float(np.abs(numbers).max()) <= largest(quantity) / min(UNITS[quantity].values())


def _likeness(signal: str, name: str) -> float:
    """How alike two names are, from 0 to 1: by words or beginnings that they share, or by letters."""
    own, words = words_of(signal.replace("tau", "force")), words_of(name)
    words = [AXES.get(word, word) for word in words]
    axes = [{*AXES.values()} & {*each} for each in (own, words)]
    if all(axes) and axes[0].isdisjoint(axes[1]):
        return 0.0
    shared = [w for w in words if any(w == o or (len(w) > 2 and o.startswith(w)) for o in own)]
    letters = SequenceMatcher(None, "".join(own), "".join(words)).ratio()
    return max(letters if letters > 0.6 else 0.0, len(set(shared)) / len(own))


def _correlation(values: np.ndarray, motion: np.ndarray) -> float:
    there = np.isfinite(values) & np.isfinite(motion)
    if there.sum() < FEWEST or not (np.ptp(values[there]) > 0.0 and np.ptp(motion[there]) > 0.0):
        return 0.0
    return float(np.corrcoef(values[there], motion[there])[0, 1])
