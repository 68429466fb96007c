"""What of a system other tools can hold, and its FMUs for them, with parameters baked in."""

import re
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ..conversion import SAME
from ..errors import InputError
from ..files import file_stems
from ..fmu.fmu_model import FmuModel, FmuVariable, Value
from ..formats.elements import parameter_set, write_document
from ..system.own_fmus import builder_options, run_builder
from ..system.system import System

# Characters that XML 1.0 cannot hold, not even as a reference (section 2.2).
NOT_XML = re.compile(r"[^\t\n\r\x20-\uD7FF\uE000-\uFFFD\U00010000-\U0010FFFF]")


@dataclass(frozen=True)
class Format:
    """Features of a target format.

    Attributes:
        name: for messages.
        events: whether it can hold events.
        order: whether FMUs may step one after the other.
        own_steps: whether an instance may have a longer step than the base step.
        conversions: whether a connection may convert units.
    """

    name: str
    events: bool = False
    order: bool = False
    own_steps: bool = False
    conversions: bool = False


SSP = Format("an SSP archive")
OSP = Format("an OSP directory", events=True, own_steps=True, conversions=True)
CONTAINER = Format("a container FMU", order=True)


@dataclass(frozen=True)
class ExportedInstance:
    """One instance of an exported system.

    Attributes:
        name: of the instance.
        model: its FMU as the scenario has it.
        file: name of the exported FMU file.
        values: start values of the scenario that differ from those of ``model``.
        baked: whether the exported file starts from them.
    """

    name: str
    model: FmuModel
    file: str
    values: tuple[tuple[FmuVariable, Value], ...]
    baked: bool


def check(system: System, target: Format, drop: bool) -> list[str]:
    """Check what the target format can hold.

    Args:
        system: checked system.
        target: the format.
        drop: leave out what the format cannot hold, instead of refusing.

    Returns:
        Notes for the user on what is left out or different there.

    Raises:
        InputError: the format cannot hold something that may not, or cannot, be left out.
    """
    _check_shape(system, target)
    _check_texts(system)
    left = _left_behind(system, target)
    if left and not drop:
        raise InputError(f"{target.name} cannot hold {'; '.join(left)}; --drop-faults leaves this out")
    notes = [f"left out: {what}" for what in left]
    if system.scenario.algorithm == "gauss_seidel" and not target.order:
        notes.append(
            "other tools step all FMUs together ('jacobi'), this scenario one after the other: "
            "there, values arrive one step later"
        )
    if any(every > 1 for every in system.every.values()):
        notes.append(
            "in other tools an instance with a longer step gets its inputs at the start of that step"
        )
    return notes


def _left_behind(system: System, target: Format) -> list[str]:
    """The optional parts of the scenario that the format cannot hold."""
    left = [
        f"the fault {type(fault).__name__.lower()} of {', '.join(fault.signals)}"
        for fault in system.scenario.faults
    ]
    left += [f"the isolation of {name}" for name, entry in system.scenario.fmus.items() if entry.isolate]
    for event in system.scenario.events:
        if not target.events or event.action == "hold":
            left.append(
                f"the event {event.action} of {event.model}.{event.variable} at {event.time:g} s"
            )
    return left


def _check_shape(system: System, target: Format) -> None:
    """Raise if the format cannot hold an essential part of the system."""
    for name, every in system.every.items():
        if every > 1 and not target.own_steps:
            raise InputError(
                f"fmus.{name}: {target.name} cannot hold a step of "
                f"{every * system.scenario.step:g} s next to that of {system.scenario.step:g} s"
            )
    if system.recordings:
        raise InputError(f"recordings: {target.name} cannot hold inputs from files")
    for c in system.connections:
        ends = f"{c.source.name} -> {c.target.name}"
        kinds = (c.source.variable.type, c.target.variable.type)
        if kinds[0] != kinds[1] or "Enumeration" in kinds:
            raise InputError(
                f"{ends}: {kinds[0]} to {kinds[1]}: other tools connect Real, Integer and Boolean "
                "to the same type only"
            )
        if c.conversion != SAME and not target.conversions:
            units = [v.unit.name if v.unit else "" for v in (c.source.variable, c.target.variable)]
            what = (
                f"transform values: transformations.{c.target.name}"
                if c.target.name in system.scenario.transformations
                else f"convert '{units[0]}' to '{units[1]}'"
            )
            raise InputError(f"{ends}: not every tool that reads {target.name} can {what}")


def _check_texts(system: System) -> None:
    """Raise if a text has a character that no XML file can hold."""
    texts = {"name": system.scenario.name, "description": system.scenario.description}
    for name, values in system.parameters.items():
        texts |= {f"fmus.{name}: {v.name}": str(value) for v, value in values if v.type == "String"}
    for where, text in texts.items():
        if wrong := NOT_XML.search(text):
            raise InputError(f"{where}: XML cannot hold the character {wrong[0]!r} in {text[:100]!r}")


def pack(system: System, folder: Path) -> tuple[list[ExportedInstance], list[str]]:
    """Put the FMUs of a system into a folder, the project's own with the scenario's parameters baked in.

    The start values of other FMUs are in their binaries.

    Args:
        system: checked system.
        folder: receives one FMU for each instance.

    Returns:
        The exported instances, and notes on parameters that are stored outside of their FMUs.
    """
    parts: list[ExportedInstance] = []
    notes: list[str] = []
    own = system.own
    for name, stem in zip(system.models, file_stems(list(system.models)), strict=True):
        model = system.models[name]
        values = tuple(pair for pair in system.parameters[name] if not _is_start(*pair))
        baked = name in own
        part = ExportedInstance(name, model, f"{stem}.fmu", values, baked)
        if values and baked:
            _bake(part, folder, builder_options(system.scenario, system.scenario.native is True))
        else:
            shutil.copyfile(model.path, folder / part.file)
        if values and not baked:
            notes.append(
                f"{name}: {', '.join((v.name for v, _ in values))} cannot become start values of "
                f"'{model.path.name}'; they are written next to it, and a tool that ignores such "
                "values (FMPy) uses the start values of the FMU"
            )
        parts.append(part)
    return parts, notes


def _is_start(variable: FmuVariable, value: Value) -> bool:
    """Whether a value is the FMU's own start value."""
    if variable.start is None:
        return False
    if variable.type == "String":
        return variable.start == value
    if variable.type == "Boolean":
        return (variable.start in ("true", "1")) == bool(value)
    return float(variable.start) == float(value)


def _bake(part: ExportedInstance, folder: Path, options: Sequence[str]) -> None:
    """Build the project's FMU again, with other start values and options of the builder."""
    names = {f"{part.model.name}.{v.name}": (v, value) for v, value in part.values}
    work = folder / f".{part.file}"
    work.mkdir()
    start = work / "start.ssv"
    write_document(parameter_set(part.name, names, root=True), start)
    run_builder(*options, "--parameters", start, "--out", work, "--", part.model.name)
    shutil.move(work / f"{part.model.name}.fmu", folder / part.file)
    shutil.rmtree(work)
