"""A system as a directory of the Open Simulation Platform: libcosim, cosim-cli, the demo app."""

import json
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from ..conversion import SAME
from ..formats.elements import type_name, value_text, write_document
from ..formats.groups import osp_model_description
from ..formats.namespaces import OSP_SCENARIOS, OSP_SPACE, OSP_STRUCTURE
from ..system.system import System
from .portable import ExportedInstance


def write_osp(system: System, parts: Sequence[ExportedInstance], folder: Path) -> list[str]:
    """Write structure, scenario and model descriptions beside the FMUs.

    Args:
        system: checked system.
        parts: its instances; their FMUs are in the folder.
        folder: receives the files.

    Returns:
        Notes on model descriptions that are left out.
    """
    write_document(_structure(system, parts), folder / OSP_STRUCTURE)
    notes = _describe(parts, folder)
    (folder / OSP_SCENARIOS).mkdir()
    path = folder / OSP_SCENARIOS / f"{system.scenario.name}.json"
    path.write_text(json.dumps(_scenario(system), indent=2) + "\n")
    return notes


def _describe(parts: Sequence[ExportedInstance], folder: Path) -> list[str]:
    """Write the model descriptions. libcosim finds them by the model's name, so that models of one name
    have one or none."""
    by_file: dict[str, dict[bytes, Element | None]] = {}
    for part in parts:
        described = osp_model_description(part.model)
        content = b"" if described is None else ElementTree.tostring(described)
        by_file.setdefault(f"{part.model.name}_OspModelDescription.xml", {})[content] = described
    notes: list[str] = []
    for file, contents in by_file.items():
        described, *more = contents.values()
        if more:
            notes.append(f"left out: '{file}', because FMUs of that name have different variable groups")
        elif described is not None:
            write_document(described, folder / file)
    return notes


def _structure(system: System, parts: Sequence[ExportedInstance]) -> Element:
    """OspSystemStructure.xml. The end of the run has no place in it that every version knows."""
    root = Element("OspSystemStructure", xmlns=OSP_SPACE, version="0.1")
    SubElement(root, "StartTime").text = "0.0"
    SubElement(root, "BaseStepSize").text = repr(system.scenario.step)
    SubElement(root, "Algorithm").text = "fixedStep"
    simulators = SubElement(root, "Simulators")
    for part in parts:
        simulator = SubElement(simulators, "Simulator", name=part.name, source=part.file)
        if system.every[part.name] > 1:
            simulator.set("stepSize", repr(system.every[part.name] * system.scenario.step))
        if part.values:
            initial = SubElement(simulator, "InitialValues")
            for v, value in part.values:
                entry = SubElement(initial, "InitialValue", variable=v.name)
                SubElement(entry, type_name(v), value=value_text(v, value))
    if any(c.conversion != SAME for c in system.connections):
        functions = SubElement(root, "Functions")
        for k, c in enumerate(system.connections):
            if c.conversion != SAME:
                SubElement(
                    functions,
                    "LinearTransformation",
                    name=f"conversion_{k}",
                    factor=repr(c.conversion.factor),
                    offset=repr(c.conversion.offset),
                )
    if system.connections:
        root.append(_connections(system))
    return root


def _connections(system: System) -> Element:
    listed = Element("Connections")
    for c in system.connections:
        if c.conversion == SAME:
            wire = SubElement(listed, "VariableConnection")
            for end in (c.source, c.target):
                SubElement(wire, "Variable", simulator=end.instance, name=end.variable.name)
    # Older schemas want plain connections first.
    for k, c in enumerate(system.connections):
        if c.conversion != SAME:
            for end, signal in ((c.source, "in"), (c.target, "out")):
                wire = SubElement(listed, "SignalConnection")
                SubElement(wire, "Variable", simulator=end.instance, name=end.variable.name)
                SubElement(wire, "Signal", function=f"conversion_{k}", name=signal)
    return listed


def _scenario(system: System) -> dict[str, object]:
    """The scenario file: events, and the end."""
    events = [
        event.model_dump(exclude_none=True)
        for event in sorted(system.scenario.events, key=lambda e: e.time)
        if event.action != "hold"
    ]
    return {
        "description": system.scenario.description or system.scenario.name,
        "events": events,
        "end": system.scenario.stop,
    }
