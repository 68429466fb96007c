"""Which ship the logs among some runs are of."""

from collections.abc import Iterable
from pathlib import Path

from cosim import InputError
from cosim.results import read_options
from fmus.ships.naming import DEFAULT


def ship_of_logs(paths: Iterable[Path]) -> tuple[str, Path] | None:
    """The ship that logs of :mod:`cosim` are of, and the first one that says so.

    Args:
        paths: of runs; files that are no logs say nothing.

    Returns:
        The name or file of the ship; None: the default ship, or no log tells.

    Raises:
        InputError: they are of several ships.
    """
    logs = {path: read_options(path if path.is_dir() else path.parent) for path in paths}
    told = {path: log.ship or log.outline.name for path, log in logs.items() if log.outline}
    ships = dict.fromkeys(told.values())
    if len(ships) > 1:
        each = ", ".join(f"'{path}' of {ship}" for path, ship in told.items())
        raise InputError(f"the runs are of several ships: {each}")
    first = next(iter(told.items()), None)
    return None if first is None or first[1] == DEFAULT else (first[1], first[0])
