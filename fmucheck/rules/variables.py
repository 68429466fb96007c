"""The variables (2.2.7, 2.2.9)."""

import math
import re
from collections.abc import Iterator

from ..description import INITIAL, DescribedVariable, flag, number
from ..fmu import FmuArchive
from ..registry import rule
from .header import twice

_BASIC = r"[A-Za-z_][A-Za-z_0-9]*"
_QUOTED = r"'(?:[A-Za-z_0-9!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+'"
_PART = rf"(?:{_BASIC}|{_QUOTED})(?:\[\d+(?:,\d+)*\])?"
_NAME = rf"{_PART}(?:\.{_PART})*"
_STRUCTURED = re.compile(rf"{_NAME}|der\({_NAME}(?:,\d+)?\)")


@rule("2.2.7, 2.2.9")
def names(fmu: FmuArchive) -> Iterator[str]:
    """Every variable has a unique name that follows variableNamingConvention."""
    variables = fmu.description.variables
    for name in twice(v.name for v in variables):
        yield f"'{name}' is the name of several variables"
    structured = fmu.description.root.get("variableNamingConvention") == "structured"
    for v in variables:
        if not v.name or re.search(r"[\r\n\t]", v.name):
            yield f"'{v.name}' (variable {v.index}) is not a valid name"
        elif structured and not _STRUCTURED.fullmatch(v.name):
            yield f"'{v.name}' is not a structured name"
        elif structured and v.name.startswith("der(") and v.type != "Real":
            yield f"'{v.name}' is a derivative, but a {v.type}"


@rule("2.2.7")
def causality(fmu: FmuArchive) -> Iterator[str]:
    """causality, variability and initial are a combination of the standard's table, and fit the type."""
    independent = [v.name for v in fmu.description.variables if v.causality == "independent"]
    if len(independent) > 1:
        yield f"there are several independent variables: {', '.join(independent)}"
    for v in fmu.description.variables:
        allowed = INITIAL.get((v.causality, v.variability))
        given = v.given.get("initial")
        if allowed is None:
            yield f"{v.name}: causality {v.causality} with variability {v.variability}"
        elif given is not None and given not in allowed:
            yield f"{v.name}: initial {given} with causality {v.causality}, variability {v.variability}"
        if v.type != "Real" and v.variability == "continuous":
            how = "is" if "variability" in v.given else "is by default"
            yield f"{v.name} is a {v.type} whose variability {how} continuous"


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


@rule("2.2.7")
def aliases(fmu: FmuArchive) -> Iterator[str]:
    """Of variables that share type and value reference one can be set, one has a start, and units
    agree.
    """
    groups: dict[tuple[str, int | None], list[DescribedVariable]] = {}
    for v in fmu.description.variables:
        # An Enumeration is got and set as an Integer.
        kind = "Integer" if v.type == "Enumeration" else v.type
        groups.setdefault((kind, v.reference), []).append(v)
    for group in groups.values():
        if len(group) == 1:
            continue
        called = ", ".join(v.name for v in group)
        constant = [v for v in group if v.variability == "constant"]
        if constant and len(constant) < len(group):
            yield f"{called}: a constant and a variable share one value"
        if len({v.start for v in constant}) > 1:
            yield f"{called}: constants that share one value start differently"
        if sum(v.settable for v in group) > 1:
            yield f"{called}: more than one of these can be set"
        if not constant and sum(v.start is not None for v in group) > 1:
            yield f"{called}: more than one of these has a start value"
        independent = [v.causality == "independent" for v in group]
        if any(independent) and any(v.settable for v in group if v.causality != "independent"):
            yield f"{called}: one is the independent variable, another can be set"
        if len({v.all.get("unit") for v in group}) > 1:
            yield f"{called}: they share one value, but not the unit"


@rule("2.2.7, 3.3.1")
def derivatives(fmu: FmuArchive) -> Iterator[str]:
    """derivative points from a continuous Real to another one; reinit and repeated setting are for
    model exchange.
    """
    description = fmu.description
    exchange = description.root.find("ModelExchange") is not None
    states = {v.derivative for v in description.variables}
    for v in description.variables:
        if "derivative" in v.own:
            state = description.variable(v.derivative)
            if state is None or state is v:
                yield (f"{v.name}: derivative is '{v.own['derivative']}', which is not another variable")
            elif not all(x.type == "Real" and x.variability == "continuous" for x in (v, state)):
                yield f"{v.name} is the derivative of {state.name}, but not both are continuous Reals"
        if flag(v.own.get("reinit")) and not (exchange and v.index in states):
            yield f"{v.name}: reinit belongs to a state in model exchange"
        if "canHandleMultipleSetPerTimeInstant" in v.given and not (exchange and v.causality == "input"):
            yield f"{v.name}: canHandleMultipleSetPerTimeInstant belongs to an input in model exchange"
