"""A system as an SSP 1.0 archive that FMPy, Ecos and libcosim load."""

import importlib.metadata
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from ..conversion import BASE_UNITS
from ..fmu.fmu_model import FmuModel
from ..formats.elements import parameter_set, write_document
from ..formats.namespaces import FMU_TYPE, OSP_ANNOTATION, SSP_RESOURCES, SSP_SPACES, SSP_STRUCTURE
from ..system.system import Signal, System
from .portable import ExportedInstance

SET_NAME = "start"


def write_ssp(system: System, parts: Sequence[ExportedInstance], folder: Path, archive: Path) -> None:
    """Write the archive.

    Args:
        system: checked system.
        parts: its instances; their FMUs are in the folder.
        folder: also receives the structure.
        archive: the file to write.
    """
    write_document(_structure(system, parts), folder / SSP_STRUCTURE)
    files = {SSP_STRUCTURE: SSP_STRUCTURE} | {
        part.file: f"{SSP_RESOURCES}/{part.file}" for part in parts
    }
    with zipfile.ZipFile(archive, "w") as target:
        for file, inside in files.items():
            info = zipfile.ZipInfo(inside)  # of the earliest date that there is, so that archives repeat
            info.external_attr = 0o644 << 16
            # FMUs are compressed already.
            how = zipfile.ZIP_DEFLATED if file == SSP_STRUCTURE else zipfile.ZIP_STORED
            target.writestr(info, (folder / file).read_bytes(), how)


def _structure(system: System, parts: Sequence[ExportedInstance]) -> Element:
    """SystemStructure.ssd. libcosim finds its step in an annotation, and reads the sets of parameters of
    components only; Ecos wants them inline, and by one name; FMPy ignores them."""
    scenario = system.scenario
    root = Element("ssd:SystemStructureDescription", version="1.0", name=scenario.name)
    root.set("generationTool", f"cybership {importlib.metadata.version('cybership')}")
    root.attrib |= {f"xmlns:{prefix}": space for prefix, space in SSP_SPACES.items()}
    outer = SubElement(root, "ssd:System", name=scenario.name)
    if scenario.description:
        outer.set("description", scenario.description)
    units = _common_units(system.models.values())
    elements = SubElement(outer, "ssd:Elements")
    for part in parts:
        elements.append(_component(system, part, units))
    if system.connections:
        wires = SubElement(outer, "ssd:Connections")
        for c in system.connections:
            wire = SubElement(
                wires,
                "ssd:Connection",
                startElement=c.source.instance,
                startConnector=c.source.variable.name,
                endElement=c.target.instance,
                endConnector=c.target.variable.name,
            )
            if c.target.name in scenario.transformations:
                # Units are not converted where a transformation is stated.
                wire.set("suppressUnitConversion", "true")
    if units:
        listed = SubElement(root, "ssd:Units")
        for name, attributes in units.items():
            SubElement(SubElement(listed, "ssc:Unit", name=name), "ssc:BaseUnit", attributes)
    experiment = SubElement(root, "ssd:DefaultExperiment", startTime="0.0", stopTime=repr(scenario.stop))
    annotation = SubElement(
        SubElement(experiment, "ssd:Annotations"), "ssc:Annotation", type=OSP_ANNOTATION
    )
    SubElement(
        SubElement(annotation, "osp:Algorithm"),
        "osp:FixedStepAlgorithm",
        baseStepSize=repr(scenario.step),
        # Python FMUs share one interpreter: threads would only wait for each other.
        numWorkerThreads="0",
    )
    return root


def _component(system: System, part: ExportedInstance, units: dict[str, dict[str, str]]) -> Element:
    component = Element(
        "ssd:Component",
        name=part.name,
        type=FMU_TYPE,
        source=f"{SSP_RESOURCES}/{part.file}",
    )
    connectors = SubElement(component, "ssd:Connectors")
    # A free input is left out: FMPy would set it to zero in every step.
    connected = {c.target for c in system.connections}
    for v in part.model.variables.values():
        if v.type not in ("Real", "Integer", "Boolean"):
            continue
        if v.causality == "output" or Signal(part.name, v) in connected:
            connector = SubElement(connectors, "ssd:Connector", name=v.name, kind=v.causality)
            typed = SubElement(connector, f"ssc:{v.type}")
            if v.type == "Real" and v.unit is not None and v.unit.name in units:
                typed.set("unit", v.unit.name)
    if part.values:
        binding = SubElement(SubElement(component, "ssd:ParameterBindings"), "ssd:ParameterBinding")
        SubElement(binding, "ssd:ParameterValues").append(
            parameter_set(SET_NAME, {v.name: (v, value) for v, value in part.values})
        )
    return component


def _common_units(models: Iterable[FmuModel]) -> dict[str, dict[str, str]]:
    """Definition of each unit that all FMUs define alike."""
    found: dict[str, dict[str, str]] = {}
    unlike: set[str] = set()
    for model in models:
        for name, attributes in _units(model).items():
            if found.setdefault(name, attributes) != attributes:
                unlike.add(name)
    return {name: found[name] for name in sorted(found) if name not in unlike}


def _units(model: FmuModel) -> dict[str, dict[str, str]]:
    """Units of an FMU, by name, as attributes of a BaseUnit."""
    found: dict[str, dict[str, str]] = {}
    for unit in model.description.unitDefinitions:
        base = unit.baseUnit
        if base is None:
            continue
        attributes = {b: str(getattr(base, b)) for b in (*BASE_UNITS, "rad") if getattr(base, b)}
        if base.factor not in (None, 1.0):
            attributes["factor"] = repr(base.factor)
        if base.offset:
            attributes["offset"] = repr(base.offset)
        found[str(unit.name)] = attributes
    return found
