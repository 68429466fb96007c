"""Getting and setting values (2.1.7)."""

import math
from collections.abc import Iterator

from ..description import DescribedVariable
from ..fmu_on_trial import FmuOnTrial, near, same, start_value
from ..registry import trial


@trial("2.1.7, 2.2.7")
def start_values(fmu: FmuOnTrial) -> Iterator[str]:
    """Before any value is set, inputs and exact values equal the start values of the description."""
    one = fmu.initialising()
    stated = [v for v in fmu.description.variables if v.initial == "exact" or v.causality == "input"]
    stated = [v for v in stated if start_value(v) is not None]
    for v, value in zip(stated, one.get(stated), strict=True):
        if not same(value, start_value(v)):
            yield f"{v.name} starts at {value!r}, not at {v.start}"
    one.free()


@trial("2.1.7, 4.2.4")
def read_back(fmu: FmuOnTrial) -> Iterator[str]:
    """Inputs and parameters that a master sets during initialisation have these values when they
    are read.
    """
    one = fmu.initialising()
    settable = [
        v
        for v in fmu.description.variables
        if v.type == "Real" and v.settable and v.causality in ("input", "parameter")
    ]
    for v in settable:
        value = near(v, 0.1)
        one.set({v: value})
        (got,) = one.get([v])
        if not same(got, value):
            yield f"{v.name} was set to {value:g} and reads {got:g}"
    one.free()


@trial("2.2.7")
def range_of_values(fmu: FmuOnTrial) -> Iterator[str]:
    """Outputs are finite, items if they are Enumerations, and within their min and max, after
    initialisation and after each step.
    """
    outputs = [v for v in fmu.description.outputs() if v.type in ("Real", "Integer", "Enumeration")]
    one = fmu.ready()
    for k in range(20):
        for v, value in zip(list(outputs), one.get(outputs), strict=True):
            if wrong := _wrong(v, value):
                outputs.remove(v)
                yield f"{v.name} is {value:g}, {wrong}, at step {k}"
        fmu.advance(one, k)


def _wrong(v: DescribedVariable, value: float) -> str:
    """What is wrong with a value of a variable; empty if nothing is."""
    low, high = v.limits
    if not math.isfinite(value):
        return "which is not finite"
    if v.items and value not in v.items:
        return "which is not an item of its Enumeration"
    return "" if low <= value <= high else f"outside of {low:g} to {high:g}"
