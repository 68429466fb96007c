"""Which signal a variable of an FMU is by its name, in the tongues that the field has for ships.

Names of columns (:func:`...runs.meaning`), those of SNAME and Fossen (``eta[6]``, ``nu[2]``), words as
in OSP's and vendors' interfaces (``surge_vel``, ``Heading_deg``, ``vessel.yawMoment``), and frames: NED,
the default, and ENU, whose x is east and whose heading goes from east to north.
"""

import re
from collections.abc import Mapping
from typing import NamedTuple

from cosim.fmu import FmuVariable

from ...runs import UNITS, meaning
from ...runs.columns.name_words import words_of
from ...runs.columns.unit_check import largest

# Words that say which frame or whose variable it is, and nothing of which signal.
NOTHING = frozenset(
    (
        *("ned", "enu", "body", "ship", "vessel", "own", "cg"),
        *("in", "out", "input", "output", "state", "measured", "meas", "actual", "linear"),
    )
)
# Word -> quantity.
KINDS = {
    **dict.fromkeys(("vel", "velocity", "speed"), "speed"),
    **dict.fromkeys(("rate", "rot", "angularvelocity"), "rate"),
    **dict.fromkeys(("force", "thrust"), "force"),
    **dict.fromkeys(("moment", "torque"), "moment"),
    **dict.fromkeys(("pos", "position", "displacement", "coordinate"), "length"),
    **dict.fromkeys(("angle", "heading", "hdg"), "angle"),
}
# Word -> quantity, or nothing where none is said -> signal.
CORES = {
    "surge": {"speed": "u", "force": "tau_X", "length": ""},
    "sway": {"speed": "v", "force": "tau_Y", "length": ""},
    "yaw": dict.fromkeys(("angle", ""), "psi")
    | dict.fromkeys(("speed", "rate"), "r")
    | dict.fromkeys(("force", "moment"), "tau_N"),
    "psi": {"angle": "psi", "": "psi", "rate": "r"},
    "north": {"length": "x", "": "x"},
    "east": {"length": "y", "": "y"},
    "n": {"length": "x"},
    "e": {"length": "y"},
    "x": {"length": "x"},
    "y": {"length": "y"},
    "": {"angle": "psi"},
}
# Vector of Fossen's notation -> its signals in six degrees of freedom.
VECTORS = {"eta": ("x", "y", "psi"), "nu": ("u", "v", "r"), "tau": ("tau_X", "tau_Y", "tau_N")}
VECTOR = re.compile(r"(eta|nu|tau)_?\[?([1-6])\]?", re.IGNORECASE)


class Meant(NamedTuple):
    """A variable as a signal.

    Attributes:
        signal: its name; empty where it is none that is known.
        flip: whether its axis points the other way.
        unit: as name or range say; None: as the FMU declares, else SI.
        quarter: whether it is an angle from east.
        sure: whether more than a single letter says so.
    """

    signal: str
    flip: bool = False
    unit: str | None = None
    quarter: bool = False
    sure: bool = True


NONE = Meant("")
# What the names of NED mean in ENU.
ENU = {
    "x": Meant("y"),
    "y": Meant("x"),
    "psi": Meant("psi", flip=True, quarter=True),
    "r": Meant("r", flip=True),
}


def meant(v: FmuVariable, name: str, known: Mapping[str, str]) -> Meant:
    """What a variable is.

    Args:
        v: the variable.
        name: of it, or the part of it that counts.
        known: signal -> quantity, of those that it may be.
    """
    for part in (name, name.rpartition(".")[2]):
        for core, suffix in ((part, ""), part.rpartition("_")[::2]):
            found = _by_name(core, known)
            if not found.signal or (suffix and suffix not in UNITS[known[found.signal]]):
                continue
            unit = suffix or (None if v.unit else _unit_by_range(v, known[found.signal]))
            return found._replace(unit=unit, sure=len(core) > 1)
    return NONE


def _by_name(name: str, known: Mapping[str, str]) -> Meant:
    signal, flip = meaning(name, known)
    if signal:
        return Meant(signal, flip)
    if vector := VECTOR.fullmatch(name):
        signal = dict(zip("126", VECTORS[vector[1].lower()], strict=True)).get(vector[2], "")
        return Meant(signal) if signal in known else NONE
    words = words_of(name)
    framed = ["pos"] if {"ned", "enu"} & {*words} and {"x", "y", "n", "e"} & {*words} else []
    signal = _by_words([w for w in words if w not in NOTHING] + framed)
    found = Meant(signal)
    if "enu" in words and not {"north", "east"} & {*words}:
        found = ENU.get(signal, found)
    return found if found.signal in known else NONE


def _by_words(words: list[str]) -> str:
    """The signal that words say, of what it is and of which quantity; empty if they say none."""
    kinds = {KINDS[w] for w in words if w in KINDS}
    cores = {w for w in words if w not in KINDS}
    if len(kinds) > 1:
        kinds -= {"length", "angle"}  # as of heading rate
    if len(kinds) > 1 or len(cores) > 1 or not words:
        return ""
    core, kind = next(iter(cores), ""), next(iter(kinds), "")
    if not core and kind == "rate" and {"heading", "hdg"} & {*words}:
        return "r"
    if not core and kind == "angle" and not {"heading", "hdg"} & {*words}:
        return ""  # an angle of anything
    return CORES.get(core, {}).get(kind, "")


def _unit_by_range(v: FmuVariable, quantity: str) -> str | None:
    """The unit that limits and start value of a variable say; None: they fit SI."""
    known = [v.min, v.max, _number(v.start)]
    size = max((abs(x) for x in known if x is not None), default=0.0)
    if quantity in ("angle", "rate") and largest(quantity) < size < 1e4:
        return "deg" if quantity == "angle" else "deg/s"
    return None


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None


def lone(found: Mapping[str, Meant], group: tuple[str, ...]) -> set[str]:
    """The signals of a group that single letters alone say, unless the whole group is there.

    A bouncing ball has a ``v``, too.
    """
    there = [s for s in group if s in found]
    if len(there) == len(group):
        return set()
    return {s for s in there if not found[s].sure}
