"""The files of a run in its result folder."""

import json
import os
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any

from .drawing import PICTURES
from .log import CSV, METRICS, PARQUET, SIDECAR, TRIAL, TRIAL_PICTURE

RESULTS = Path("results")


# All that a run writes; what tells that it was a run comes last.
FILES = (
    CSV, PARQUET, METRICS, TRIAL, TRIAL_PICTURE, *(f"{picture}.png" for picture in PICTURES), SIDECAR,
)  # fmt: skip


def others_file(folder: Path) -> Path | None:
    """A file of a name that a run would write, in a folder that has no run; None if there is none."""
    if os.path.exists(folder / SIDECAR):  # Path.exists raises for names that are too long
        return None
    return next((folder / name for name in FILES if os.path.exists(folder / name)), None)


def clear_results(folder: Path) -> None:
    """Make a result folder, without what an earlier run left there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in FILES:
        (folder / name).unlink(missing_ok=True)
        for scratch in folder.glob(f".{name}.*.part"):  # of a run that was killed
            scratch.unlink(missing_ok=True)


def default_folder(name: str, description: Mapping[str, Any], overwrite: bool = False) -> Path:
    """``results/<name>``, or the first of ``results/<name>_2``, ... with the same run or none.

    Args:
        name: of the scenario.
        description: of the run, as its log.json will have it.
        overwrite: whether ``results/<name>`` may be any run's.
    """
    for number in count(1):
        folder = RESULTS / (name if number == 1 else f"{name}_{number}")
        try:
            earlier = json.loads((folder / SIDECAR).read_text(encoding="utf-8"))
        except (FileNotFoundError, PermissionError):
            return folder
        except (OSError, ValueError):  # no log of ours: not to be replaced
            if not RESULTS.is_dir():  # no name below it is free
                return folder
            earlier = {}
        if overwrite or _input(earlier) == _input(description):
            return folder
    raise AssertionError


def _input(description: Mapping[str, Any]) -> Any:
    """What decides the result of a run: the scenario as it was understood, and the FMUs."""
    stated = json.loads(json.dumps(description))
    if not isinstance(stated, dict) or "scenario" not in stated:
        return None
    scenario = {k: v for k, v in stated["scenario"].items() if k != "log"}
    # Where an FMU lies does not matter: archives are unpacked to another folder each time.
    for entry in scenario.get("fmus", {}).values():
        entry.pop("path", None)
    hashes = {name: fmu["sha256"] for name, fmu in stated.get("fmus", {}).items()}
    return scenario, hashes
