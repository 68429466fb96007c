"""Scenarios from JSON, or from the formats of other tools, with messages for mistakes."""

import math
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from cybership.message_text import Location

from ..errors import InputError, nearest
from ..formats.read_osp import read_osp
from ..formats.read_ssp import read_ssp
from . import faults
from .json_files import checked, json_content
from .schema import Scenario
from .setting import set_value
from .shipped import find_scenario, shipped_names


def load_scenario(
    source: str | Path | dict[str, Any], changes: Mapping[str, Any] | None = None
) -> Scenario:
    """A scenario from a JSON file or from the same content as a dict, or a system of other tools.

    Args:
        source: path of the file, or the name of a shipped scenario; a dict is read as if it lay in the
            working directory. An SSP archive, an OSP directory or its OspSystemStructure.xml is a
            scenario as well.
        changes: keys that override those of the file, unless None.

    Raises:
        InputError: missing file, no JSON, unknown key, wrong type or value; names the place.
    """
    chosen = {key: value for key, value in (changes or {}).items() if value is not None}
    if isinstance(source, dict):
        return _validate(source | chosen, "scenario", Path.cwd())
    path = find_scenario(source)
    if path.suffix in (".ssp", ".xml") or os.path.isdir(path):
        if not path.exists():
            raise InputError(f"no such system: '{path}'")
        system = read_ssp(path) if path.suffix == ".ssp" else read_osp(path)
        for key in ("step", "stop"):
            if key not in system.content | chosen:
                raise InputError(f"'{path}' does not state its {key}; give --{key} SECONDS")
        scenario = _validate(system.content | chosen, f"'{path}'", system.folder)
        scenario.set_origin(system.folder, system.notes, system.unpacked)
        return scenario
    content = json_content(path, "a scenario", shipped_names() if path.name == str(source) else ())
    if isinstance(content, dict):
        content |= chosen
    return _validate(content, f"'{path}'", path.parent)


def with_settings(
    scenario: Scenario, settings: Iterable[tuple[str, Any]], folder: Path, name: str = "the scenario"
) -> Scenario:
    """A scenario with some values set by their paths; see :mod:`cosim.scenario.setting`.

    Args:
        scenario: is not changed.
        settings: paths, each with its value.
        folder: to which files named by the values are relative.
        name: of what comes out, for messages.

    Raises:
        InputError: no such place, or a value that it cannot have.
    """
    content = scenario.model_dump(mode="json", by_alias=True, exclude_unset=True)
    for path, value in settings:
        if isinstance(value, float) and not math.isfinite(value):
            raise InputError(f"{name}: {path} cannot be {value}")
        set_value(content, path, value, folder)
    changed = _validate(content, name, scenario.folder)
    changed.set_origin(scenario.folder, scenario.notes, scenario.unpacked)
    return changed


def cut_short(scenario: Scenario) -> Scenario:
    """A scenario that may end before the window of its metrics begins: then that is the whole run."""
    first, last = scenario.metrics.start or 0.0, scenario.metrics.stop or math.inf
    if not scenario.stop <= first < last:
        return scenario
    changed = with_settings(scenario, [("metrics.from", 0.0)], Path.cwd())
    note = (
        f"the window of the metrics begins at {first:g} s, after the end of the run: metrics are "
        "from 0 s on"
    )
    changed.set_origin(scenario.folder, [*scenario.notes, note], scenario.unpacked)
    return changed


def _validate(content: Any, name: str, folder: Path) -> Scenario:
    scenario = checked(Scenario, content, name, _special)
    scenario.set_origin(folder)
    return scenario


def _special(kind: str, location: Location, value: Any) -> str:
    if kind == "union_tag_invalid":
        wrong = str(value["kind"])
        return f"unknown kind '{wrong}'{nearest(wrong, faults.KINDS)}"
    if kind == "union_tag_not_found":
        return "needs a 'kind'" + nearest("", faults.KINDS)
    return 'is true, false or "auto"' if location[:1] == ("native",) else ""
