"""Pieces of XML that several formats share. Prefixes are written out, because some readers look for
them by name."""

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from ..fmu import Variable
from ..scenario import Value

SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"


def parameter_set(
    name: str, values: Mapping[str, tuple[Variable, Value]], root: bool = False
) -> Element:
    """An SSP 1.0 parameter set.

    Args:
        name: of the set.
        values: parameter name -> FMU variable, value.
        root: whether it stands alone in a file.
    """
    outer = Element("ssv:ParameterSet", version="1.0", name=name)
    if root:
        outer.set("xmlns:ssv", SSV)
    inner = SubElement(outer, "ssv:Parameters")
    for parameter, (variable, value) in values.items():
        entry = SubElement(inner, "ssv:Parameter", name=parameter)
        SubElement(entry, f"ssv:{kind(variable)}", value=text(variable, value))
    return outer


def kind(variable: Variable) -> str:
    """The type that other formats call a variable's; they set enumerations as whole numbers."""
    return "Integer" if variable.type == "Enumeration" else variable.type


def text(variable: Variable, value: Value) -> str:
    """A value such that reading it gives the very same one."""
    if variable.type == "Real":
        return repr(float(value))
    if variable.type == "Boolean":
        return "true" if value else "false"
    return str(value)


def write(root: Element, path: Path) -> None:
    """Write a document, indented."""
    indent(root)
    ElementTree(root).write(path, encoding="UTF-8", xml_declaration=True)
