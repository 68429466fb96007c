"""What an FMU remembers of the runs of which it was learned, and the files that a system is made of."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from cosim.scenario import Scenario
from cosim.system import System

from ...runs import Fingerprint, fingerprints
from ..weak_form import WeakWindows

LEARNED = "resources/learned_from.json"  # in the archive


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
                told = json.loads(archive.read(LEARNED))
            except (ValueError, RecursionError):
                told = [{}]
        found += fingerprints(told, path)
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
