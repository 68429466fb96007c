"""The model that ``--model`` names, and a proposal where the variables of an FMU are not known."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from cosim import InputError
from fmus.ship import Ship

from ..predictors import (
    MAP,
    DescribedShip,
    Execution,
    Model,
    ModelSource,
    UnmatchedError,
    open_model,
    refuse_execution,
    refuse_map,
)


def initial_model(
    path: Path | None,
    map: Path | None,  # noqa: A002
    craft: Ship,
    execution: Execution,
) -> ModelSource:
    """The model of a ship by ``--model``, ``--map`` and how it is run; by default the nominal one.

    Raises:
        InputError: no such file, or not what its name says.
    """
    if path is None:
        refuse_map(map)
        refuse_execution(execution)
        return DescribedShip(Model(ship=craft))
    return open_model(path, map, craft, execution)


@contextmanager
def proposing() -> Iterator[None]:
    """Where the variables of an FMU are not known inside, propose a map in the working directory.

    Raises:
        InputError: they are not.
    """
    try:
        yield
    except UnmatchedError as error:
        hint = f"'{MAP}' has the known entries: complete it, and give it by --map {MAP}"
        if Path(MAP).exists():
            hint = f"complete '{MAP}' for --map, or remove it to get a new proposal"
        else:
            from ..predictors import write_map  # takes a while to import, and only FMUs have maps

            try:
                write_map(Path(MAP), error.proposal)
            except OSError:
                hint = "--map FILE states them"
        raise InputError(f"{error}; {hint}") from None
