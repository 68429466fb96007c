"""Rules of the checker on descriptions that are made up, compared with the same demands pair by pair."""

from itertools import combinations
from types import SimpleNamespace
from xml.etree.ElementTree import Element, SubElement

from hypothesis import given
from hypothesis import strategies as st

from fmucheck.description import DescribedVariable
from fmucheck.rules.units import units_defined
from fmucheck.rules.variables import aliases

TYPES = ("Real", "Integer", "Enumeration", "Boolean")
VARIABLE = st.tuples(
    st.sampled_from(TYPES),
    st.integers(0, 2),
    st.sampled_from(["input", "local", "parameter", "independent"]),
    st.sampled_from(["constant", "continuous", "tunable"]),
    st.sampled_from([None, "exact"]),
    st.sampled_from([None, "0", "1"]),
    st.sampled_from([None, "m", "s"]),
)


def variable(index, given):
    type_, reference, causality, variability, initial, start, unit = given
    own = {k: v for k, v in {"start": start, "unit": unit}.items() if v is not None}
    return DescribedVariable(
        index, f"v{index}", reference, type_, causality, variability, initial, {}, own, own, frozenset()
    )


def share(a, b):
    """Whether two variables are one value: an Enumeration is read and written as an Integer."""
    whole = {"Integer", "Enumeration"}
    return a.reference == b.reference and (a.type == b.type or {a.type, b.type} <= whole)


def faults_of(a, b):
    """What the standard forbids of two variables that share a value."""
    constant = [v.variability == "constant" for v in (a, b)]
    if any(constant) and not all(constant):
        yield "a constant and a variable"
    if all(constant) and a.start != b.start:
        yield "constants that share"
    if a.settable and b.settable:
        yield "can be set"
    if not any(constant) and a.start is not None and b.start is not None:
        yield "has a start value"
    independent = [v.causality == "independent" for v in (a, b)]
    others = [v for v, alone in zip((a, b), independent, strict=True) if not alone]
    if any(independent) and any(v.settable for v in others):
        yield "independent variable"
    if a.all.get("unit") != b.all.get("unit"):
        yield "not the unit"


TEXTS = (
    "a constant and a variable",
    "constants that share",
    "more than one of these can be set",
    "has a start value",
    "independent variable",
    "not the unit",
)


@given(st.lists(VARIABLE, max_size=2))
def test_two_variables_of_one_value_break_what_their_pair_breaks(given):
    variables = [variable(k, g) for k, g in enumerate(given)]
    found = list(aliases(SimpleNamespace(description=SimpleNamespace(variables=variables))))
    pairs = [pair for pair in combinations(variables, 2) if share(*pair)]
    expected = {text for pair in pairs for text in faults_of(*pair)}
    assert len(found) == len(expected)
    for text in expected:
        assert any(text in line for line in found)
        assert all(v.name in line for line in found for v in variables)


@given(st.lists(VARIABLE, max_size=5))
def test_only_variables_of_one_value_are_named_together(given):
    variables = [variable(k, g) for k, g in enumerate(given)]
    lines = list(aliases(SimpleNamespace(description=SimpleNamespace(variables=variables))))
    told = [set(line.partition(":")[0].split(", ")) for line in lines]
    for a, b in combinations(variables, 2):
        together = any({a.name, b.name} <= names for names in told)
        assert share(a, b) or not together
        if share(a, b) and a.settable and b.settable:
            assert together


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
