"""The values that a description gives to variables (2.2.7)."""

import math
import re
from collections.abc import Iterator

from ..description import DescribedVariable, number
from ..fmu import FmuArchive
from ..registry import rule


@rule("2.2.7")
def start(fmu: FmuArchive) -> Iterator[str]:
    """A start value exists where it is required, is absent where it is not allowed, and is a finite
    value of its type.
    """
    for v in fmu.description.variables:
        needed = v.initial in ("exact", "approx") or v.causality == "input"
        forbidden = v.initial == "calculated" or v.causality == "independent"
        if v.start is None:
            if needed:
                yield f"{v.name} has no start value"
            continue
        if forbidden:
            yield f"{v.name} has a start value, though it is {v.initial or v.causality}"
        if not _of_type(v):
            yield f"{v.name}: start '{v.start}' is not a finite {v.type}"


def _of_type(v: DescribedVariable) -> bool:
    text = v.start or ""
    if v.type == "Real":
        value = number(text)
        return value is not None and math.isfinite(value)
    if v.type in ("Integer", "Enumeration"):
        return re.fullmatch(r"[+-]?\d+", text) is not None
    return v.type != "Boolean" or text in ("true", "false", "0", "1")


@rule("2.2.7")
def limits(fmu: FmuArchive) -> Iterator[str]:
    """min is not above max, start lies between them or is an item, nominal is positive and finite."""
    for v in fmu.description.variables:
        low, high = v.limits
        if low > high or math.isnan(low) or math.isnan(high):
            yield f"{v.name}: min {low:g}, max {high:g}"
        value = number(v.start)
        if (
            v.type in ("Real", "Integer", "Enumeration")
            and value is not None
            and not low <= value <= high
        ):
            yield f"{v.name}: start {value:g} is outside of {low:g} to {high:g}"
        if v.items and value is not None and value not in v.items:
            yield f"{v.name}: start {value:g} is not an item of its Enumeration"
        nominal = number(v.all.get("nominal", "1"))
        if nominal is None or not 0.0 < nominal < math.inf:
            yield f"{v.name}: nominal is '{v.all['nominal']}'"
