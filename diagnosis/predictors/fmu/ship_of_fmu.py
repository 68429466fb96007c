"""Which ship an FMU or a system is a model of, as far as it says."""

from pathlib import Path

import cosim
from cosim.fmu import FmuModel
from fmus.ships.naming import DEFAULT
from fmus.ships.ship_file import shipped_ships

SYSTEMS = (".ssp", ".json")
FMUS = (".fmu", *SYSTEMS)


def ship_of_model(path: str | Path | None) -> str | None:
    """The ship that a model file is of; None: it does not say it, or is no FMU.

    Args:
        path: what ``--model`` names.
    """
    if path is None or Path(path).suffix not in FMUS:
        return None
    return _told(Path(path).absolute())


def _told(path: Path) -> str | None:
    if path.suffix not in SYSTEMS:
        return _of_fmu(path)
    scenario = cosim.load_scenario(path)
    paths = [Path(entry.path) for entry in scenario.fmus.values()]
    files = [scenario.folder / each for each in paths]
    there = [_of_fmu(file) for file in files if file.is_file()]
    bare = any(
        not file.is_file() and len(each.parts) == 1 for file, each in zip(files, paths, strict=True)
    )
    return next(filter(None, there), None) or scenario.ship_source or (DEFAULT if bare else None)


def _of_fmu(path: Path) -> str | None:
    """The ship that the vessel of this project names in its description, if there is such a ship."""
    annotations = FmuModel(path).annotations
    told = None if annotations is None else annotations.find("Tool[@name='cybership']/Ship")
    name = None if told is None else told.get("name")
    return name if name in shipped_ships() else None
