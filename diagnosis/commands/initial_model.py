"""The model that ``--model`` names: a parameter set, or an FMU with a map of its variables."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim import InputError
from fmus.ship import Ship

from ..predictors import SUFFIXES, Fmu, Model, UnmatchedError, read_model
from .command_line import MAP


def initial_model(
    path: str | Path | None,
    map: str | Path | None,  # noqa: A002
    craft: Ship,
) -> tuple[Model, Fmu | None]:
    """The model of a ship by ``--model`` and ``--map``; with an FMU the nominal one, and the FMU.

    Raises:
        InputError: no such file, or not what its name says.
    """
    path = None if path is None else Path(path)
    if path is not None and path.suffix in SUFFIXES:
        return Model(ship=craft), Fmu(path, map)
    if map is not None:
        raise InputError(f"--map tells the variables of an FMU: --model NAME{SUFFIXES[0]} is missing")
    return Model(ship=craft) if path is None else read_model(path, craft), None


@contextmanager
def proposing() -> Iterator[None]:
    """Where the variables of an FMU are not known inside, propose a map in the working directory.

    Raises:
        InputError: they are not.
    """
    try:
        yield
    except UnmatchedError as error:
        raise InputError(f"{error}{_proposed(error.proposal)}") from None


def write_map(path: Path, content: Mapping[str, Any]) -> None:
    """Write a map as JSON."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def _proposed(content: Mapping[str, Any]) -> str:
    """Write a proposal, unless there is a map; what a message says of that."""
    path = Path(MAP)
    if path.exists():
        return f"; complete '{MAP}' for --map, or remove it and another one is proposed"
    try:
        write_map(path, content)
    except OSError:
        return "; --map FILE tells them"
    return f"; '{MAP}' has what is known: complete it, and give it by --map {MAP}"
