"""Python files of a user that extend the diagnosis by a method or a criterion."""

import inspect
import runpy
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from cosim import InputError
from cosim.errors import nearest
from cybership.message_text import failure


def chosen(
    name: str, known: Mapping[str, tuple[str, str]], package: str | None, what: str, own: str
) -> Any:
    """What a name stands for: an object of a module of ``known``, or ``own`` in a user's Python file.

    Raises:
        InputError: there is no such ``what`` (for messages), or the file fails.
    """
    if name.endswith(".py"):
        return from_file(Path(name), own, f"a {what}")
    if name not in known:
        raise InputError(f"no {what} '{name}'{nearest(name, known)}")
    module, found = known[name]
    return getattr(import_module(f".{module}", package), found)


def takes(function: object, arguments: int) -> bool:
    """Whether something is a function of so many arguments; one that does not state them may be."""
    with suppress(ValueError):  # it does not
        try:
            inspect.signature(function).bind(*range(arguments))  # pyright: ignore[reportArgumentType]
        except TypeError:
            return False
    return callable(function)


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
        raise InputError(f"'{path}' fails when imported: {failure(error)}") from error
