"""One value of a scenario set by its path, as ``--set`` and the axes of a campaign name it.

A path is the keys from the top, joined by dots, with the number of an entry in a list: ``stop``,
``faults.0.std``, ``fmus.controller.path``. Two are short: ``vessel.m`` for
``fmus.vessel.parameters.m``, and ``controller`` for ``fmus.controller.path``.
"""

import json
import os
from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

from ..errors import InputError, nearest
from .schema import Scenario

__all__ = ["parse_assignment", "place_of", "set_value"]

# Keys of a scenario that hold an object whose keys are those of the format, not names of the user's.
OBJECTS = ("log", "metrics", "roles")
KEYS = tuple(Scenario.model_fields)


def parse_assignment(text: str) -> tuple[str, Any]:
    """Path and value of ``path=value``; the value is JSON where it can be read as such, else text.

    Raises:
        InputError: there is no ``=``, or nothing before it.
    """
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"'{text}' sets nothing: it takes the form path=value, as in vessel.m=15")
    try:
        return path.strip(), json.loads(value)
    except ValueError:
        return path.strip(), value.strip()


def place_of(content: Mapping[str, Any], path: str) -> tuple[str, ...]:
    """The keys to a value, the short forms written out.

    Args:
        content: of a scenario that is valid.
        path: as a user writes it.

    Raises:
        InputError: the scenario has no such place; names the nearest one.
    """
    parts = path.split(".")
    instances = content["fmus"]
    if parts[0] not in KEYS:
        if parts[0] not in instances:
            raise InputError(
                f"'{path}': no key and no instance '{parts[0]}'{nearest(parts[0], [*instances, *KEYS])}"
            )
        rest = ".".join(parts[1:])
        return ("fmus", parts[0], "parameters", rest) if rest else ("fmus", parts[0], "path")
    if parts[0] == "fmus":
        if len(parts) > 1 and parts[1] not in instances:
            raise InputError(f"'{path}': no instance '{parts[1]}'{nearest(parts[1], instances)}")
        if len(parts) == 1 or parts[2:] == ["parameters"]:
            raise InputError(f"'{path}' is a group: name one of the values in it")
        if parts[2:3] == ["parameters"]:
            return (*parts[:3], ".".join(parts[3:]))  # names of variables may hold dots
    return tuple(parts)


def set_value(content: dict[str, Any], path: str, value: Any, folder: Path) -> None:
    """Set one value in the content of a scenario.

    Whether the format knows the last key, and an FMU the parameter, is found when the scenario is
    read and prepared; here the way to it must exist.

    Args:
        content: of a scenario that is valid; is changed.
        path: where.
        value: what JSON can hold.
        folder: to which a path of a file in the value is relative.

    Raises:
        InputError: there is no such place.
    """
    place = place_of(content, path)
    # Objects on the way to it that a file may leave out: where they are, and their key.
    optional = {((), key) for key in OBJECTS} | {(("fmus", *place[1:2]), "parameters")}
    node: Any = content
    for depth, key in enumerate(place[:-1]):
        if isinstance(node, dict) and (place[:depth], key) in optional:
            node = node.setdefault(key, {})
        else:
            node = node[_known(node, key, path)]
    last: Any = place[-1]
    if isinstance(node, list) or place[:-1] == ("transformations",):
        last = _known(node, last, path)
    elif not isinstance(node, dict):
        raise InputError(f"'{path}': '{place[-2]}' is a value, and has no member '{last}'")
    node[last] = _located(place, deepcopy(value), folder)


def _known(node: Any, key: str, path: str) -> Any:
    """The key, or number in a list, of something that exists."""
    if isinstance(node, list):
        if key.isdecimal() and int(key) < len(node):
            return int(key)
        there = f"numbers 0 to {len(node) - 1}" if node else "nothing"
        raise InputError(f"'{path}': there is no entry '{key}' in the list, which holds {there}")
    if not isinstance(node, dict):
        raise InputError(f"'{path}': there is no '{key}' in a value")
    if key not in node:
        raise InputError(f"'{path}': the scenario has no '{key}' there{nearest(key, node)}")
    return key


def _located(place: tuple[str, ...], value: Any, folder: Path) -> Any:
    """A value with the files that it names made absolute; a bare name of an FMU or ship stays one."""
    if place == ("ship",) and isinstance(value, str) and value.endswith(".toml"):
        return os.path.abspath(folder / value)
    if place[0] != "fmus":
        return value
    if len(place) == 2 and isinstance(value, dict):
        return {key: _located((*place, key), inner, folder) for key, inner in value.items()}
    if len(place) != 3 or not isinstance(value, str):
        return value
    if place[2] == "table" or (place[2] == "path" and os.path.basename(value) != value):
        return os.path.abspath(folder / value)
    return value
