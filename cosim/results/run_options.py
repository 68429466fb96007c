"""Options of a finished run for metrics and pictures, from the scenario in its ``log.json``."""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from ..formats.outline import AnnotatedOutline, AnnotatedTrial, CommandLimit
from ..scenario.roles import DEFAULT_ROLES, Roles
from .log import SIDECAR

NO_COMMANDS: Mapping[str, CommandLimit] = MappingProxyType({})


class RunOptions(NamedTuple):
    """Options of a run.

    Attributes:
        start, stop: the part of the run that its metrics cover [s]; None is unbounded.
        roles: columns that metrics and pictures read.
        outline: of the ship; None where its FMUs do not say.
        ship: whose FMUs the project's were: a name, or the path of a description; None: the usual ship.
        trial: the manoeuvring trial that it is; None: it is none.
        commands: column of each command of an actuator, and its limit.
    """

    start: float | None = None
    stop: float | None = None
    roles: Roles = DEFAULT_ROLES
    outline: AnnotatedOutline | None = None
    ship: str | None = None
    trial: AnnotatedTrial | None = None
    commands: Mapping[str, CommandLimit] = NO_COMMANDS


def read_options(folder: Path) -> RunOptions:
    """Options of the run in a result folder; the defaults where its ``log.json`` does not state them."""
    try:
        stated = json.loads((folder / SIDECAR).read_text())
        scenario, window = stated["scenario"], stated["scenario"]["metrics"]
        roles = Roles.model_validate(scenario.get("roles", {}))
        outline = AnnotatedOutline.read(stated.get("ship") or {})
        trial = stated.get("trial") and AnnotatedTrial(
            str(stated["trial"]["kind"]), str(stated["trial"]["order"])
        )
        commands = {
            str(name): CommandLimit(float(each["low"]), float(each["high"]), str(each["unit"]))
            for name, each in stated.get("commands", {}).items()
        }
        ship = scenario.get("ship")
        return RunOptions(window["from"], window["to"], roles, outline, ship, trial or None, commands)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return RunOptions()
