"""Files that are written completely or not at all, and names for them."""

import errno
import json
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, Any

from cybership.scratch_folder import atomic_write

# Bytes that a file keeps for later; chosen: the status of a run, a message and numbers fit.
ROOM = 4096
# Characters that remain of a text where room is short; chosen: a fraction of ROOM in UTF-8.
SHORT = 500
# Characters of a file's name; chosen: half of what file systems take is left for its extension and more.
STEM = 120


def write_text(path: Path, text: str) -> None:
    """Write a text file in UTF-8."""
    with atomic_write(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Any) -> None:
    """Write a JSON file."""
    write_text(path, _json(content) + "\n")


def _json(content: Any) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False)


def update_json(path: Path, content: Mapping[str, Any], changes: Mapping[str, Any]) -> None:
    """Write a JSON object with some keys changed or added, also where no room is left for a new file.

    Then the file of before, which :func:`write_roomy_json` has made, is written over.

    Raises:
        OSError: neither is possible.
    """
    try:
        write_json(path, {**content, **changes})
        return
    except OSError:
        room = path.stat().st_size
        # The order of keys stays; a text that is too long for the room is cut.
        text = _json({**content, **changes}).encode()
        if len(text) > room:
            text = _json({**content, **_shortened(changes)}).encode()
        if len(text) > room:
            raise
        with open(path, "r+b", buffering=0) as file:
            write_all(file, text.ljust(room))


def _shortened(changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes without lists, and with the beginnings of long texts."""
    return {
        key: value[:SHORT] if isinstance(value, str) else value
        for key, value in changes.items()
        if not isinstance(value, list)
    }


def write_roomy_json(path: Path, content: Any) -> None:
    """Write a JSON file that can grow later though the disk is full: spaces follow its end."""
    write_text(path, _json(content) + " " * ROOM + "\n")


def write_all(file: IO[bytes], data: bytes | memoryview) -> None:
    """Write all bytes to an unbuffered file, whose ``write`` may write fewer than it is given.

    Raises:
        OSError: not all can be written.
    """
    left = memoryview(data)
    while left:
        written = file.write(left)
        if not written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        left = left[written:]


def file_stems(names: Sequence[str]) -> list[str]:
    """File names without extension: letters that every file system and URI takes, each name once."""
    found: list[str] = []
    for name in names:
        stem = re.sub(r"[^A-Za-z0-9_-]", "_", name)[:STEM]
        while stem.lower() in (other.lower() for other in found):
            stem += "_"
        found.append(stem)
    return found
