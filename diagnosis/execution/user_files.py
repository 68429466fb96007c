"""A user's Python file that extends the diagnosis: a method, a criterion."""

import runpy
from pathlib import Path

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
