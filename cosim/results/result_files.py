"""The files of a run in its result folder."""

from pathlib import Path

from .drawing import PICTURES
from .log import CSV, METRICS, PARQUET, SIDECAR


def clear_results(folder: Path) -> None:
    """Make a result folder, without what an earlier run left there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in (CSV, PARQUET, SIDECAR, METRICS, *(f"{p}.png" for p in PICTURES)):
        (folder / name).unlink(missing_ok=True)
        for scratch in folder.glob(f".{name}.*.part"):  # of a run that was killed
            scratch.unlink(missing_ok=True)
