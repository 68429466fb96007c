"""A component's modelDescription.xml, FMI 2.0.4, from its declaration and nothing else."""

import uuid
from xml.etree.ElementTree import Element, SubElement

from ..base_units import base_exponents
from ..declare import Component, Variable, width
from .trace import initial_dependencies, output_dependencies

TOOL = "cybership"  # whose vendor annotations these are
LOG_CATEGORIES = {
    "logStatusWarning": "A value was refused or replaced.",
    "logStatusError": "A step failed; the state is the one before it.",
    "logAll": "Everything else.",
}


def guid_of(code_hash: str) -> str:
    """The guid of a component in Python and compiled, whose numbers are the same."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, code_hash)}}}"


def model_description(
    component: Component, guid: str, version: str, needs_tool: bool = True, tool: str = "pythonfmu"
) -> Element:
    """The XML description of the FMU of a component.

    Args:
        component: the declaration.
        guid: identifies code and declaration.
        version: of the project.
        needs_tool: whether the FMU needs Python to run, on any platform.
        tool: what has made the FMU.

    Returns:
        Root element. Value references count parameters, inputs and outputs, in this order.
    """
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=component.name,
        guid=guid,
        description=component.description,
        version=version,
        generationTool=tool,
        variableNamingConvention="flat",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=component.name,
        needsExecutionTool=str(needs_tool).lower(),
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    _units(root, component)
    categories = SubElement(root, "LogCategories")
    for name, text in LOG_CATEGORIES.items():
        SubElement(categories, "Category", name=name, description=text)
    SubElement(root, "DefaultExperiment", startTime="0.0", stopTime="10.0", stepSize="0.01")
    _annotations(root, component)
    _variables(root, component)
    return root


def _units(root: Element, component: Component) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for unit in sorted({v.unit for v in component.variables}):
        exponents = {base: str(e) for base, e in base_exponents(unit).items()}
        SubElement(SubElement(definitions, "Unit", name=unit), "BaseUnit", exponents)


def _annotations(root: Element, component: Component) -> None:
    """A ship to draw, corners ``forward,starboard`` [m]; a trial; what parameters are estimates of.

    The schema allows one element in a Tool, and more than one Tool.
    """
    found = []
    if component.outline is not None:
        corners = " ".join(f"{x!r},{y!r}" for x, y in component.outline.corners)
        stated = {"name": component.outline.name, "length": repr(component.outline.length)}
        found.append(Element("Ship", stated, outline=corners))
    if component.trial:
        found.append(Element("Trial", kind=component.trial))
    if estimates := [(v.name, v.estimate) for v in component.variables if v.estimate is not None]:
        found.append(Element("Estimates"))
        for name, estimate in estimates:
            stated = {"parameter": name, "of": estimate.of, "change": str(estimate.change).lower()}
            SubElement(found[-1], "Estimate", stated)
    if found:
        annotations = SubElement(root, "VendorAnnotations")
        for element in found:
            SubElement(annotations, "Tool", name=TOOL).append(element)


def _variables(root: Element, component: Component) -> None:
    parameters, inputs = width(component.params), width(component.inputs)
    outputs = width(component.outputs)
    listed = SubElement(root, "ModelVariables")
    for reference, v in enumerate(component.variables):
        if reference < parameters:
            kind = {"causality": "parameter", "variability": "fixed" if v.fixed else "tunable"}
        elif reference < parameters + inputs:
            # What only counts at communication points is what the standard calls discrete.
            held = v.name in component.held
            kind = {"causality": "input", "variability": "discrete" if held else "continuous"}
        else:
            kind = {"causality": "output", "variability": "continuous", "initial": "calculated"}
        scalar = SubElement(
            listed,
            "ScalarVariable",
            name=v.name,
            valueReference=str(reference),
            description=v.description,
        )
        scalar.attrib.update(kind)
        SubElement(scalar, "Real", _real(v, start=reference < parameters + inputs))

    structure = SubElement(root, "ModelStructure")
    first = parameters + inputs
    for tag, depends in (
        ("Outputs", output_dependencies(component)),
        ("InitialUnknowns", initial_dependencies(component)),
    ):
        if not outputs:
            continue
        unknowns = SubElement(structure, tag)
        for k, names in enumerate(depends):
            indices = sorted(_index(name, parameters) for name in names)
            SubElement(
                unknowns,
                "Unknown",
                index=str(first + k + 1),
                dependencies=" ".join(map(str, indices)),
            )


def _index(name: str, parameters: int) -> int:
    """The one-based index of a traced variable among the ScalarVariables."""
    group, _, number = name.rstrip("]").partition("[")
    return int(number) + 1 + (parameters if group == "inputs" else 0)


def _real(v: Variable, start: bool) -> dict[str, str]:
    attributes = {"unit": v.unit}
    if v.range.min is not None:
        attributes["min"] = repr(v.range.min)
    if v.range.max is not None:
        attributes["max"] = repr(v.range.max)
    if start:
        attributes["start"] = repr(v.start)
    return attributes
