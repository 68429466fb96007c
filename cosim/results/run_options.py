"""Options of a finished run for metrics and pictures, from the scenario in its ``log.json``."""

import json
from pathlib import Path
from typing import NamedTuple

from ..scenario.roles import DEFAULT_ROLES, Roles
from .log import SIDECAR


class RunOptions(NamedTuple):
    """Options of a run.

    Attributes:
        start, stop: the part of the run that its metrics cover [s]; None is unbounded.
        roles: columns that metrics and pictures read.
    """

    start: float | None = None
    stop: float | None = None
    roles: Roles = DEFAULT_ROLES


def read_options(folder: Path) -> RunOptions:
    """Options of the run in a result folder; the defaults where its ``log.json`` does not state them."""
    try:
        scenario = json.loads((folder / SIDECAR).read_text())["scenario"]
        window = scenario["metrics"]
        return RunOptions(window["from"], window["to"], Roles.model_validate(scenario.get("roles", {})))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return RunOptions()
