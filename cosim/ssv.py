"""Parameter sets of the SSP standard (``.ssv``): values for FMUs, by model name."""

import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from .archive import check_xml
from .errors import InputError

NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"


@dataclass(frozen=True)
class Parameter:
    """A number of a parameter set, with the unit that it claims to have."""

    value: float
    unit: str | None


def read_parameters(path: Path) -> dict[str, dict[str, Parameter]]:
    """Numbers of a parameter set.

    Args:
        path: an SSP 1.0 ``.ssv`` file whose names read ``model.parameter``.

    Returns:
        Model name -> parameter -> value and unit.

    Raises:
        InputError: missing, no parameter set, a name twice, or a value that is no number.
    """
    try:
        content = path.read_bytes()
        check_xml(content, path, "a parameter set")
        root = ElementTree.fromstring(content)
    except FileNotFoundError:
        raise InputError(f"no such parameter set: '{path}'") from None
    except (OSError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a parameter set: {error}") from None
    if root.tag != f"{{{NAMESPACE}}}ParameterSet":
        raise InputError(f"'{path}' is not an SSP 1.0 parameter set")
    found: dict[str, dict[str, Parameter]] = {}
    for entry in root.iter(f"{{{NAMESPACE}}}Parameter"):
        name = entry.get("name", "")
        model, dot, parameter = name.partition(".")
        if not dot:
            raise InputError(f"'{path}': '{name}' is not of the form model.parameter")
        if parameter in found.setdefault(model, {}):
            raise InputError(f"'{path}': {name} stands there twice")
        found[model][parameter] = _number(entry, f"'{path}': {name}")
    return found


def _number(entry: ElementTree.Element, where: str) -> Parameter:
    for kind in ("Real", "Integer"):
        child = entry.find(f"{{{NAMESPACE}}}{kind}")
        text = "" if child is None else child.get("value", "")
        with suppress(ValueError):
            value = float(text)
            if child is not None and math.isfinite(value) and "_" not in text:
                return Parameter(value, child.get("unit"))
    raise InputError(f"{where} has no number as its value")
