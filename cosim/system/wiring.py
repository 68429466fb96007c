"""Connections: which output feeds which input, and the conversion of values on their way."""

from __future__ import annotations

import re

from cybership.message_text import name_of

from ..conversion import SAME, Conversion, conversion
from ..errors import InputError, nearest
from .system import Connection, Signal, System, causality_of

# What the description of an input begins with that an FMU can do without.
OPTIONAL = "optional"
# Types of output that an input of a type accepts.
ACCEPTS = {
    "Real": ("Real", "Integer", "Enumeration"),
    "Integer": ("Integer", "Enumeration"),
    "Enumeration": ("Enumeration", "Integer"),
    "Boolean": ("Boolean",),
}


def connect(system: System) -> None:
    """Fill in the connections of a system, groups resolved.

    Raises:
        InputError: a missing end, two sources for one input, types or units that do not fit.
    """
    taken: dict[str, Signal] = {}
    for k, (output, input_) in enumerate(system.scenario.connections):
        place = f"connections[{k}]"
        for source, target in _resolve(system, output, input_, _where(place, output, input_)):
            _join(source, target, place, taken, system)
    for k, (output, input_) in enumerate(system.scenario.optional_connections):
        place = f"optional_connections[{k}]"
        for source, target in _present(system, output, input_, _where(place, output, input_)):
            if target.name not in taken:
                _join(source, target, place, taken, system)
    for name in system.scenario.transformations:
        if name not in taken:
            raise InputError(f"transformations: {name_of(name)} is not connected{nearest(name, taken)}")


def _where(place: str, output: str, input_: str) -> str:
    return f"{place} {name_of(output)} -> {name_of(input_)}"


def _join(source: Signal, target: Signal, place: str, taken: dict[str, Signal], system: System) -> None:
    """Add one connection, and note in ``taken`` what feeds its input."""
    ends = f"{place} {source.name} -> {target.name}"
    if source.variable.causality != "output":
        raise InputError(f"{ends}: {source.name} is {causality_of(source)}, not an output")
    if target.variable.causality != "input":
        raise InputError(f"{ends}: {target.name} is {causality_of(target)}, not an input")
    if target.name in taken:
        raise InputError(f"{ends}: {target.name} is already connected to {taken[target.name].name}")
    if source.variable.type not in ACCEPTS.get(target.variable.type, ()):
        raise InputError(f"{ends}: {source.variable.type} cannot feed {target.variable.type}")
    taken[target.name] = source
    system.connections.append(Connection(source, target, _link(source, target, ends, system)))


def find_free_inputs(system: System) -> None:
    """Warn of inputs that nothing feeds and the scenario does not mention, but for optional ones."""
    fed = system.fed
    for name, model in system.models.items():
        free = [
            v.name
            for v in model.variables.values()
            if v.causality == "input"
            and f"{name}.{v.name}" not in fed
            and not v.description.startswith(OPTIONAL)
            and v.name not in system.scenario.fmus[name].parameters
        ]
        if free:
            system.warnings.append(
                f"{name}: input {', '.join(free)} not connected; keeps its start value"
            )


def _link(source: Signal, target: Signal, ends: str, system: System) -> Conversion:
    """The conversion of a value between two ends; a warning where units cannot be compared."""
    given = system.scenario.transformations.get(target.name)
    if given is not None:
        if target.variable.type != "Real":
            raise InputError(f"{ends}: a transformation needs a Real, not {target.variable.type}")
        return Conversion(given.factor, given.offset)
    a, b = source.variable.unit, target.variable.unit
    how = conversion(a, b, ends)
    if how is None and a is not None and b is not None:
        system.warnings.append(
            f"{ends}: units '{a.name}' and '{b.name}' cannot be compared, "
            "because an FMU does not define them; the value passes unchanged"
        )
    return how or SAME


def _resolve(system: System, output: str, input_: str, where: str) -> list[tuple[Signal, Signal]]:
    """The pairs of a connection: one, or with * on both sides all whose names agree there."""
    if "*" not in output + input_:
        return [(system.find(output, where), system.find(input_, where))]
    pairs = _group(system, output, input_, where)
    if not pairs:
        raise InputError(f"{where}: no output and input agree in the place of *")
    return pairs


def _present(system: System, output: str, input_: str, where: str) -> list[tuple[Signal, Signal]]:
    """The pairs of an optional connection: those of which both FMUs have their variable."""
    ends = [end.partition(".") for end in (output, input_)]
    for instance, _, _ in ends:
        if instance not in system.models:
            system.warnings.append(f"{where}: left out, because there is no instance '{instance}'")
            return []
    if "*" in output + input_:
        return _group(system, output, input_, where)
    if any(variable not in system.models[instance].variables for instance, _, variable in ends):
        return []
    return [(system.find(output, where), system.find(input_, where))]


def _group(system: System, output: str, input_: str, where: str) -> list[tuple[Signal, Signal]]:
    """All pairs of output and input whose names agree in the place of *."""
    if output.count("*") != 1 or input_.count("*") != 1:
        raise InputError(f"{where}: a group needs exactly one * on each side")
    shape = re.compile("(.*)".join(map(re.escape, output.split("*"))), re.DOTALL)
    source = output.partition(".")[0]
    target = input_.partition(".")[0]
    for name in (source, target):
        if name not in system.models:
            raise InputError(f"{where}: no instance '{name}'{nearest(name, system.models)}")
    pairs: list[tuple[Signal, Signal]] = []
    outputs = [v for v in system.models[source].variables.values() if v.causality == "output"]
    for variable in outputs:
        if named := shape.fullmatch(f"{source}.{variable.name}"):
            partner = input_.replace("*", named[1]).partition(".")[2]
            other = system.models[target].variables.get(partner)
            if other is not None and other.causality == "input":
                pairs.append((Signal(source, variable), Signal(target, other)))
    return pairs
