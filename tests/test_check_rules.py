"""Units of descriptions that are made up, compared with the same demand unit by unit."""

from types import SimpleNamespace
from xml.etree.ElementTree import Element, SubElement

from hypothesis import given
from hypothesis import strategies as st

from fmucheck.rules.units import units_defined

NAMES = ("m", "km", "s")
name = st.sampled_from([*NAMES, None])
PLACES = ("v0", "v1", "v2", "type t0", "type t1")


def fault_of(unit, shown, defined):
    """What is said of a unit and a display unit; None: nothing."""
    if unit is None:
        return None if shown is None else f"display unit '{shown}' without a unit"
    if unit not in defined:
        return f"unit '{unit}' is not defined"
    if shown in {None, unit} | defined[unit]:
        return None
    return f"display unit '{shown}' of '{unit}' is not defined"


@given(
    st.dictionaries(st.sampled_from(NAMES), st.sets(st.sampled_from(NAMES))),
    st.lists(st.tuples(name, name), min_size=len(PLACES), max_size=len(PLACES)),
)
def test_a_unit_is_defined_and_its_display_unit_is_one_of_it_or_itself(defined, pairs):
    units = [Element("Unit", name=unit) for unit in defined]
    for unit, shown in zip(units, defined.values(), strict=True):
        unit.extend(Element("DisplayUnit", name=each) for each in shown)
    given = [
        {k: v for k, v in zip(("unit", "displayUnit"), pair, strict=True) if v is not None}
        for pair in pairs
    ]
    variables = [SimpleNamespace(name=PLACES[k], all=given[k]) for k in range(3)]
    types = [Element("SimpleType", name=PLACES[k].removeprefix("type ")) for k in (3, 4)]
    for type_, attributes in zip(types, given[3:], strict=True):
        SubElement(type_, "Real", attributes)
    fmu = SimpleNamespace(description=SimpleNamespace(units=units, variables=variables, types=types))
    faults = [(place, fault_of(*pair, defined)) for place, pair in zip(PLACES, pairs, strict=True)]
    assert list(units_defined(fmu)) == [f"{place}: {fault}" for place, fault in faults if fault]
