"""Units (2.2.2)."""

from collections.abc import Iterator

from fmus.base_units import base_exponents

from ..description import number, whole
from ..fmu import FmuArchive
from ..registry import rule

BASES = ("kg", "m", "s", "A", "K", "mol", "cd")  # and rad, which may be left out of an exponent


@rule("2.2.2")
def base_units(fmu: FmuArchive) -> Iterator[str]:
    """A unit whose name is made of SI symbols (m/s, N.m) has the exponents and the factor of its
    name.
    """
    for unit in fmu.description.units:
        base, name = unit.find("BaseUnit"), unit.get("name", "")
        if base is None:
            continue
        try:
            meant = base_exponents(name)
        except ValueError:
            continue  # another notation than ours
        stated = {b: whole(base.get(b, "0")) for b in BASES}
        wrong = [b for b in BASES if stated[b] != meant.get(b, 0)]
        if wrong:
            yield f"unit '{name}': " + ", ".join(
                f"exponent of {b} is {stated[b]}, not {meant.get(b, 0)}" for b in wrong
            )
        elif number(base.get("factor", "1")) != 1.0 or number(base.get("offset", "0")) != 0.0:
            yield f"unit '{name}' is SI, but has a factor or an offset"


@rule("2.2.2, 2.2.7")
def units_defined(fmu: FmuArchive) -> Iterator[str]:
    """Every unit and display unit that is used is defined, and a display unit has a unit."""
    known = {
        u.get("name"): {d.get("name") for d in u.iterfind("DisplayUnit")} for u in fmu.description.units
    }
    used = [(v.name, v.all) for v in fmu.description.variables]
    used += [(f"type {t.get('name')}", t[0].attrib) for t in fmu.description.types if len(t)]
    for name, attributes in used:
        unit, shown = attributes.get("unit"), attributes.get("displayUnit")
        if unit is not None and unit not in known:
            yield f"{name}: unit '{unit}' is not defined"
        elif shown is not None and unit is None:
            yield f"{name}: display unit '{shown}' without a unit"
        elif shown is not None and shown != unit and shown not in known[unit]:
            yield f"{name}: display unit '{shown}' of '{unit}' is not defined"
