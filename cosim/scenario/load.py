"""Scenarios from JSON, or from the formats of other tools, with messages for mistakes."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from cybership.message_text import Location, first_fault

from ..errors import InputError, most_alike, nearest, unique_keys
from ..formats.systems import is_system, read_system
from . import faults
from .roles import Roles
from .schema import Event, FmuEntry, LogOptions, MetricsOptions, Recording, Scenario, Transformation
from .setting import set_value
from .shipped import find_scenario, shipped_names

# Parts of pydantic's error locations that name a validator or a type, not a place in the file.
INTERNAL = ("function-", "constrained-", "literal[", "bool", "int", "float", "str", "tuple", "list[")


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
    if is_system(path):
        system = read_system(path)
        for key in ("step", "stop"):
            if key not in system.content | chosen:
                raise InputError(f"'{path}' does not state its {key}; give --{key} SECONDS")
        scenario = _validate(system.content | chosen, f"'{path}'", system.folder)
        scenario.set_origin(system.folder, system.notes, system.unpacked)
        return scenario
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=unique_keys)
        json.dumps(content, ensure_ascii=False).encode()
    except FileNotFoundError:
        files = path.parent.glob("*.json") if path.parent.is_dir() else []
        near = [p.name for p in files if not p.name.startswith(".")]
        shipped = shipped_names() if path.name == str(source) else []
        meant = most_alike(path.stem, shipped)
        hint = nearest(path.stem, shipped) if meant or not near else nearest(path.name, near)
        raise InputError(f"no such scenario: '{path}'{hint}") from None
    except InputError as error:
        raise InputError(f"'{path}': {error}") from None
    except json.JSONDecodeError as error:
        raise InputError(f"'{path}' is not JSON: {error}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"'{path}' cannot be read: {error}") from None
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
    try:
        # As JSON, where "0.01" is no number and true no time; in Python a list would be no tuple either.
        scenario = Scenario.model_validate_json(json.dumps(content), strict=True)
    except ValidationError as error:
        raise InputError(_message(error, name)) from None
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"{name} cannot be written as JSON: {error}") from None
    scenario.set_origin(folder)
    return scenario


def _message(error: ValidationError, name: str) -> str:
    """The first error in one line, with the number of further ones."""
    told = first_fault(error, _nearest_key, _is_internal, _special, whole="the content")
    more = f" (and {error.error_count() - 1} more faults)" if error.error_count() > 1 else ""
    return f"{name}: {told}{more}"


def _is_internal(part: str) -> bool:
    return part in faults.KINDS or part.startswith(INTERNAL)


def _special(kind: str, location: Location, value: Any) -> str:
    if kind == "union_tag_invalid":
        wrong = str(value["kind"])
        return f"unknown kind '{wrong}'{nearest(wrong, faults.KINDS)}"
    if kind == "union_tag_not_found":
        return "needs a 'kind'" + nearest("", faults.KINDS)
    return 'is true, false or "auto"' if location[:1] == ("native",) else ""


def _nearest_key(location: Location) -> str:
    """A hint at the keys that are allowed in the place of an unknown one."""
    *before, last = location
    first = before[0] if before else ""
    classes: dict[int | str, type[BaseModel]] = {
        "fmus": FmuEntry,
        "events": Event,
        "log": LogOptions,
        "metrics": MetricsOptions,
        "recordings": Recording,
        "roles": Roles,
        "transformations": Transformation,
        "faults": faults.KINDS.get(str(before[-1]) if before else "", faults.Fault),
    }
    fields = classes.get(first, Scenario).model_fields
    known = [field.alias or name for name, field in fields.items()]
    return nearest(str(last), known)
