"""The two ways in which a run can go wrong, parts of messages, and keys that occur twice."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cybership.message_text import PrintableError, most_alike, nearest, quoted

__all__ = ["InputError", "SimulationError", "most_alike", "nearest", "not_written", "unique_keys"]


class InputError(PrintableError):
    """The user's input cannot be used; the message says what, where and what was near. Exit code 2."""


class SimulationError(PrintableError):
    """The simulation itself failed; what was logged is kept. Exit code 3."""


def not_written(folder: Path, error: OSError) -> str:
    """The message about a result folder that cannot be written to."""
    if os.path.isfile(folder):  # Path.is_file raises for names that are too long
        return f"cannot write to '{folder}': it is a file, not a folder"
    return f"cannot write to '{folder}': {error.strerror or error}"


def unique_keys(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object from its pairs, for :func:`json.loads`, which alone keeps the last of equal keys.

    Raises:
        InputError: a key occurs twice.
    """
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"the key {quoted(name)} occurs twice in one object")
        found[name] = value
    return found
