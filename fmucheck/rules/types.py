"""Declared types (2.2.3)."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from ..description import DescribedVariable, number
from ..fmu import FmuArchive
from ..registry import rule
from .header import twice


@rule("2.2.3")
def types(fmu: FmuArchive) -> Iterator[str]:
    """Types have unique names that no variable has, ordered limits, and one value for each item of
    an enumeration.
    """
    names = [t.get("name") for t in fmu.description.types]
    for name in twice(names):
        yield f"type '{name}' is defined twice"
    for name in sorted({v.name for v in fmu.description.variables} & {str(n) for n in names}):
        yield f"'{name}' is a type and a variable"
    for declared in fmu.description.types:
        if not len(declared):
            continue
        low, high = number(declared[0].get("min")), number(declared[0].get("max"))
        if low is not None and high is not None and low > high:
            yield f"type '{declared.get('name')}': min {low:g} is above max {high:g}"
        if declared[0].tag == "Enumeration":
            yield from _items(declared.get("name", ""), declared[0])


def _items(name: str, enumeration: Element) -> Iterator[str]:
    items = list(enumeration.iterfind("Item"))
    if not items:
        yield f"enumeration '{name}' has no items"
    for attribute in ("name", "value"):
        for text in twice(i.get(attribute) for i in items):
            yield f"enumeration '{name}': {attribute} '{text}' occurs twice"


@rule("2.2.3, 2.2.7")
def declared_types(fmu: FmuArchive) -> Iterator[str]:
    """The declared type of a variable exists, is of the same kind, and its limits include those of
    the variable.
    """
    known = {t.get("name"): t[0] for t in fmu.description.types if len(t)}
    for v in fmu.description.variables:
        name = v.own.get("declaredType")
        if name is None:
            if v.type == "Enumeration":
                yield f"{v.name} is an Enumeration without a declared type"
        elif name not in known:
            yield f"{v.name}: type '{name}' is not defined"
        elif known[name].tag != v.type:
            yield f"{v.name} is a {v.type}, its type '{name}' a {known[name].tag}"
        else:
            yield from _limits(v, known[name])


def _limits(v: DescribedVariable, declared: Element) -> Iterator[str]:
    low, high = number(declared.get("min")), number(declared.get("max"))
    own_low, own_high = number(v.own.get("min")), number(v.own.get("max"))
    if low is not None and own_low is not None and own_low < low:
        yield f"{v.name}: min {own_low:g} is below that of its type, {low:g}"
    if high is not None and own_high is not None and own_high > high:
        yield f"{v.name}: max {own_high:g} is above that of its type, {high:g}"
