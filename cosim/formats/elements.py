"""XML elements that several formats share, and writing of documents.

Prefixes are literal, because some readers look for them by name.
"""

from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

from ..fmu.fmu_model import FmuVariable, Value
from .namespaces import SSV


def parameter_set(
    name: str, values: Mapping[str, tuple[FmuVariable, Value]], root: bool = False
) -> Element:
    """An SSP 1.0 parameter set.

    Args:
        name: of the set.
        values: parameter name -> FMU variable, value.
        root: whether it is the root of a file.
    """
    outer = Element("ssv:ParameterSet", version="1.0", name=name)
    if root:
        outer.set("xmlns:ssv", SSV)
    inner = SubElement(outer, "ssv:Parameters")
    for parameter, (variable, value) in values.items():
        entry = SubElement(inner, "ssv:Parameter", name=parameter)
        SubElement(entry, f"ssv:{type_name(variable)}", value=value_text(variable, value))
    return outer


def type_name(variable: FmuVariable) -> str:
    """The type of a variable in other formats, which set enumerations as integers."""
    return "Integer" if variable.type == "Enumeration" else variable.type


def value_text(variable: FmuVariable, value: Value) -> str:
    """A value as text; reading it restores the value to the bit."""
    if variable.type == "Real":
        return repr(float(value))
    if variable.type == "Boolean":
        return "true" if value else "false"
    return str(value)


def write_document(root: Element, path: Path) -> None:
    """Write a document, indented."""
    indent(root)
    ElementTree(root).write(path, encoding="UTF-8", xml_declaration=True)
