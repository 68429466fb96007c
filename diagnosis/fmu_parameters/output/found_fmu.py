"""An FMU with its calibrated parameters and the forces that were found in addition, as one FMU."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cosim
from cosim.fmu import FmuModel
from fmus.build import BuildError

from ...predictors.fmu.variable_map import write_map
from ...predictors.fmu.wrapper import ADDED, FOREIGN, write_container
from ...predictors.predictor import FOUND, MAP
from ..additional_force import AdditionalForce

SOURCE = """from fmus.addition import AddedTerm, added_terms

COMPONENT = added_terms({starts!r}, {count}, [{terms}])
"""


def write_found(
    folder: Path,
    model: FmuModel,
    given: Mapping[str, Any],
    values: Mapping[str, float],
    forces: Sequence[AdditionalForce],
    h: float,
) -> str:
    """Write ``found.fmu`` and its ``map.json``; returns what was written, or why it was not.

    Args:
        folder: where to write.
        model: the FMU.
        given: its map, as JSON has it.
        values: of its calibrated parameters.
        forces: with their coefficients.
        h: length of a step [s].
    """
    # A signal that the FMU lacks is null in the map of a ship.
    given = {
        key: {s: c for s, c in group.items() if c is not None} if isinstance(group, dict) else group
        for key, group in given.items()
    }
    driven = [
        *dict.fromkeys([*map(_name, given["inputs"].values()), *(n for f in forces for n in f.inputs)])
    ]
    seen = [*dict.fromkeys(f.signal for f in forces if f.signal)]
    inputs_kept = [n for n in values if model.variables[n].causality == "input"]
    if inputs_kept:
        return f"No {FOUND} is written: calibrated values are inputs: {', '.join(inputs_kept)}."
    starts = [float(model.variables[n].start or 0.0) for n in driven]
    every = [t for f in forces for t in f.terms(driven, seen)]
    terms = ", ".join(f"AddedTerm{tuple(t)!r}" for t in every)
    wires = [(f"{FOREIGN}.{n}", f"{ADDED}.from_{k}") for k, n in enumerate(seen)]
    wires += [(f"{ADDED}.sum_{k}", f"{FOREIGN}.{n}") for k, n in enumerate(driven)]
    start = {
        key: c
        for key, c in given.get("start", {}).items()
        if model.variables[_name(c)].causality == "parameter"
    }
    exposed = [f"{FOREIGN}.{_name(c)}" for c in start.values()]
    source = SOURCE.format(starts=starts, count=len(seen), terms=terms)
    try:
        write_container(folder / FOUND, model.path, source, wires, (h, 1000 * h), exposed, values)
    except (cosim.InputError, BuildError) as error:
        return f"No {FOUND} is written: {error}."
    inside = {n: f"{FOREIGN}.{n}" for n in model.variables}
    new = {
        "inputs": _renamed(given["inputs"], {n: f"{ADDED}.to_{k}" for k, n in enumerate(driven)}),
        "outputs": _renamed(given["outputs"], inside),
        "start": _renamed(start, inside),
        **{key: given[key] for key in ("window", "run_in") if key in given},
    }
    write_map(folder / MAP, new)
    return f"{FOUND} is {model.path.name} with its calibrated parameters and the additional forces."


def _name(channel: Any) -> str:
    return str(channel["name"] if isinstance(channel, dict) else channel)


def _renamed(channels: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """The channels of a map with other names of variables; constants stay."""
    found = {}
    for key, c in channels.items():
        if isinstance(c, dict):
            found[key] = {**c, "name": names[c["name"]]}
        else:
            found[key] = names[c] if isinstance(c, str) else c
    return found
