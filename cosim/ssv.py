"""Parameter sets of the SSP standard (``.ssv``): values for FMUs, by model name."""

import math
from pathlib import Path
from xml.etree import ElementTree

from .errors import InputError

NAMESPACE = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"


def read_parameters(path: Path) -> dict[str, dict[str, float]]:
    """Numbers of a parameter set.

    Args:
        path: an SSP 1.0 ``.ssv`` file whose names read ``model.parameter``.

    Returns:
        Model name -> parameter -> value.

    Raises:
        InputError: missing, no parameter set, or a value that is no number.
    """
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except FileNotFoundError:
        raise InputError(f"no such parameter set: '{path}'") from None
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(f"'{path}' cannot be read as a parameter set: {error}") from None
    if root.tag != f"{{{NAMESPACE}}}ParameterSet":
        raise InputError(f"'{path}' is not an SSP 1.0 parameter set")
    found: dict[str, dict[str, float]] = {}
    for entry in root.iter(f"{{{NAMESPACE}}}Parameter"):
        name = entry.get("name", "")
        model, dot, parameter = name.partition(".")
        if not dot:
            raise InputError(f"'{path}': '{name}' is not of the form model.parameter")
        value = next((child.get("value") for child in entry), None)
        try:
            number = float(value or "")
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise InputError(f"'{path}': {name} has no number as its value")
        found.setdefault(model, {})[parameter] = number
    return found
