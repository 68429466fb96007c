"""What an FMU or a system tells of itself: the runs of which it was learned, its files, its ship."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

import cosim
from cosim.fmu import FmuModel
from cosim.scenario import Scenario
from cosim.system import System
from fmus.ships.naming import DEFAULT
from fmus.ships.ship_file import shipped_ships

from ...runs import Fingerprint, fingerprints
from ..weak_form import WeakWindows

LEARNED = "resources/learned_from.json"  # in the archive
SYSTEMS = (".ssp", ".json")
FMUS = (".fmu", *SYSTEMS)


def learned_from(paths: Iterable[Path]) -> tuple[Fingerprint, ...]:
    """Runs of which some FMUs were learned, as far as they tell.

    Raises:
        InputError: one tells what is broken.
    """
    found: list[Fingerprint] = []
    for path in dict.fromkeys(paths):
        with ZipFile(path) as archive:
            if LEARNED not in archive.namelist():
                continue
            try:
                stated = json.loads(archive.read(LEARNED))
            except (ValueError, RecursionError):
                stated = [{}]
        found += fingerprints(stated, path)
    return tuple(found)


def remember(path: Path, before: Sequence[Fingerprint], runs: Sequence[WeakWindows]) -> None:
    """Write into an FMU of which runs it was learned, those of an earlier one included."""
    known = (*before, *(Fingerprint.of(w.smoothed) for w in runs))
    with ZipFile(path, "a", ZIP_DEFLATED) as archive:
        archive.writestr(ZipInfo(LEARNED), json.dumps([f.content() for f in known]))


def parts_of(scenario: Scenario, system: System) -> list[tuple[str, Path]]:
    """The files of a system, each after what it is for."""
    inner = [(f"FMU {name}", Path(model.path)) for name, model in system.models.items()]
    tables = [t.table for t in scenario.fmus.values()] + [r.path for r in scenario.recordings]
    inner += [("table", scenario.folder / table) for table in tables if table is not None]
    ship = scenario.ship_source
    return inner + ([("ship", Path(ship))] if ship and ship.endswith(".toml") else [])


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
    stated = None if annotations is None else annotations.find("Tool[@name='cybership']/Ship")
    name = None if stated is None else stated.get("name")
    return name if name in shipped_ships() else None
