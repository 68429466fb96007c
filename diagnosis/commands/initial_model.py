"""The model that ``--model`` names, and a proposal where the variables of an FMU are not known."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cosim import InputError
from fmus.ship import Ship

from ..predictors import (
    MAP,
    DescribedShip,
    Model,
    ModelSource,
    UnmatchedError,
    open_model,
    refuse_map,
)


def initial_model(path: Path | None, map: Path | None, craft: Ship) -> ModelSource:  # noqa: A002
    """The model of a ship by ``--model`` and ``--map``; by default the nominal one.

    Raises:
        InputError: no such file, or not what its name says.
    """
    if path is None:
        refuse_map(map)
        return DescribedShip(Model(ship=craft))
    return open_model(path, map, craft)


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


def _proposed(content: Mapping[str, Any]) -> str:
    """Write a proposal, unless there is a map; what a message says of that."""
    path = Path(MAP)
    if path.exists():
        return f"; complete '{MAP}' for --map, or remove it and another one is proposed"
    from ..predictors import write_map  # takes a while to import, and only FMUs have maps

    try:
        write_map(path, content)
    except OSError:
        return "; --map FILE tells them"
    return f"; '{MAP}' has what is known: complete it, and give it by --map {MAP}"
