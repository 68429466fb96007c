"""The description of a run in ``log.json``."""

import importlib.metadata
from typing import Any

from ..system.system import System


def describe(system: System) -> dict[str, Any]:
    """Columns, FMUs, the ship to draw, the trial, the scenario as it was understood, versions."""
    columns: dict[str, dict[str, str]] = {"time": {"unit": "s", "description": "simulated time"}}
    for name in system.logged:
        variable = system.signals[name].variable
        columns[name] = {
            "unit": variable.unit.name if variable.unit is not None else "",
            "description": variable.description,
        }
    resolved = system.scenario.model_dump(mode="json", by_alias=True)
    if not system.scenario.roles.model_fields_set:
        del resolved["roles"]  # stated only where the scenario does
    resolved["ship"] = system.scenario.ship_source
    resolved["connections"] = [[c.source.name, c.target.name] for c in system.connections]
    for name, values in system.parameters.items():
        resolved["fmus"][name]["parameters"] = {v.name: value for v, value in values}
        resolved["fmus"][name]["table"] = None  # its values are among the parameters
    return {
        "columns": columns,
        "fmus": {
            name: {
                "path": str(model.path),
                "model": model.name,
                "guid": model.description.guid,
                "sha256": model.sha256,
                "native": model.is_native,
            }
            for name, model in system.models.items()
        },
        "ship": None if system.outline is None else system.outline._asdict(),
        "trial": None if system.trial is None else system.trial._asdict(),
        "commands": {name: each._asdict() for name, each in system.commands.items()},
        "order": system.order,
        "scenario": resolved,
        "seed": system.scenario.seed,
        "versions": {name: importlib.metadata.version(name) for name in ("cybership", "fmpy", "numpy")},
        "notes": system.scenario.notes,
        "warnings": system.warnings,
    }
