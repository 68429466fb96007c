"""The name of a column and the unit that stands in it, at its end or in the line below."""

import re

from ..files.text_layout import bare_unit
from .columns import UNITS, WITH_UNIT
from .unit_check import spelt

NO_UNIT = ("", "-")
# Units that a name may end in; u_1 is the first of several, x_d a desired value.
NAMED_UNITS = frozenset(unit for units in UNITS.values() for unit in units) - {"1", "d"}
# A time that is called so, with its unit at the end: TimeUS, time_boot_ms.
TIME_IN = re.compile(r"(?i)(time|timestamp|stamp|epoch)(?:_?boot)?_?([mun]s(?:ec)?)")
CALLED_AS_UNIT = ("ms", "us", "ns")  # a time may be called so
NORTH = ("true", "magnetic")  # that a heading is from; behind its name it is no unit
# Behind a name in a log of libcosim: value reference, type and causality.
OF_LIBCOSIM = re.compile(r" \[\d+ (real|integer) \w+\]$")


def bare_name(name: str, below: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit, which may stand below it."""
    name = OF_LIBCOSIM.sub("", name)
    stated = WITH_UNIT.fullmatch(name)
    if stated and stated[2].casefold() in NORTH:
        return stated[1], bare_unit(below)
    return (stated[1], spelt(stated[2])) if stated else (name, bare_unit(below))


def without_unit(name: str, below: str) -> tuple[str, str]:
    """The same, where the unit may be the end of the name, too."""
    bare, unit = bare_name(name, below)
    return (bare, unit) if unit else unit_at_the_end(bare)


def unit_at_the_end(name: str) -> tuple[str, str]:
    """A name without the unit that its end is, as x_mm, yaw_rate_deg_s, x/mm, x in mm, TimeUS."""
    if stamped := TIME_IN.fullmatch(name):
        return stamped[1], spelt(stamped[2].lower())
    if (unit := spelt(name.lower())) in CALLED_AS_UNIT:
        return "time", unit
    for mark in (" in ", ", ", "/"):  # tables of DIN 461, and ISO 80000-1, 7.1.2
        quantity, _, unit = name.partition(mark)
        if quantity and spelt(unit) in NAMED_UNITS:
            return quantity, spelt(unit)
    words = (name.lower() if name.isupper() else name).split("_")
    if inner := re.fullmatch(r"(\w*[a-z\d])([A-Z][a-z]+)", name):  # headingDeg
        words = [*inner.groups()]
    for count in (2, 1):
        unit = spelt("/".join(words[-count:]))
        if len(words) > count and unit in NAMED_UNITS:
            return "_".join(words[:-count]), unit
    return name, ""
