"""Systems of other tools: SSP archives and OSP directories."""

import os
from pathlib import Path

from ..errors import InputError
from .imported import Imported
from .read_osp import read_osp
from .read_ssp import read_ssp


def is_system(path: Path) -> bool:
    """Whether a path names a system for :func:`read_system`, and not a scenario file."""
    return path.suffix in (".ssp", ".xml") or os.path.isdir(path)


def read_system(path: Path) -> Imported:
    """A system from an SSP archive, an OSP directory or its OspSystemStructure.xml.

    Raises:
        InputError: missing, unreadable, or it uses a feature that this master lacks.
    """
    if not path.exists():
        raise InputError(f"no such system: '{path}'")
    return read_ssp(path) if path.suffix == ".ssp" else read_osp(path)
