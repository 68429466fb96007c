"""A user's files: JSON, and Python that extends the diagnosis by a method or a criterion."""

import json
import runpy
from pathlib import Path
from typing import Any

from cosim import InputError


def from_file(path: Path, name: str, what: str) -> object:
    """A name that a user's Python file of ``what`` (for messages) defines; None where it does not.

    Raises:
        InputError: there is no such file, or it fails when it is run.
    """
    if not path.is_file():
        raise InputError(f"no such Python file of {what}: '{path}'")
    try:
        return runpy.run_path(str(path)).get(name)
    except (Exception, SystemExit) as error:
        raise InputError(f"'{path}' fails when imported: {error!r}") from error


def json_content(path: Path, what: str) -> Any:
    """The content of a JSON file of ``what`` (for messages).

    Raises:
        InputError: it cannot be read.
    """
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except RecursionError:
        raise InputError(f"'{path}' cannot be read: it is nested too deeply") from None
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as {what}: {error}") from None
