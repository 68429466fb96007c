"""A system of another tool as the content of a scenario."""

import weakref
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cybership.scratch_folder import Scratch


class Unpacked:
    """A scratch folder for unpacked files, removed when the last reference to it is gone."""

    def __init__(self) -> None:
        scratch = Scratch()
        self.path = scratch.path
        weakref.finalize(self, scratch.remove)


@dataclass
class Imported:
    """A system of another tool as a scenario.

    Attributes:
        content: of the scenario file that would describe it.
        folder: what its paths are relative to.
        notes: assumptions and omissions, for the user.
        unpacked: keeps the folder, where it is a scratch folder.
    """

    content: dict[str, Any]
    folder: Path
    notes: list[str] = field(default_factory=list)
    unpacked: Unpacked | None = None
