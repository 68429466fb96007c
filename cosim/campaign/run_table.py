"""The table of a campaign: a journal that loses nothing, and the Parquet file made of it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import BaseModel

from cybership.scratch_folder import atomic_write

from ..dispatch.job import RunRow
from ..errors import InputError, not_written
from ..files import write_all
from ..results.performance import METRICS
from ..trials.measures import EVERY
from .design import Case

if TYPE_CHECKING:
    import pandas

JOURNAL = "runs.jsonl"
TABLE = "runs.parquet"
LOGS = "logs"
# Digits of a hash that name the folder of a log; chosen: no two of a million runs share them.
DIGITS = 16


class JournalLine(BaseModel, extra="allow"):
    """A line of the journal."""

    hash: str
    status: Literal["done", "failed", "lost"]
    message: str
    wall_s: float
    metrics: dict[str, float]


class Journal:
    """All runs that ever ended in a folder, one line each, written as each ends.

    A process that is killed leaves at worst the beginning of a line, which counts for nothing.

    Args:
        folder: of the campaign.

    Attributes:
        rows: hash -> what is kept of the run.
        unread: lines that cannot be read, but for the end of the last one; their runs are made again.
        new: runs that were written since :meth:`agree`.

    Raises:
        InputError: it cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self.rows: dict[str, RunRow] = {}
        self.unread = 0
        self.new: list[str] = []
        path = folder / JOURNAL
        try:
            old = path.read_bytes() if path.exists() else b""
            for line in old.splitlines(keepends=True):
                self._remember(line)
            self._file = open(path, "ab", buffering=0)  # noqa: SIM115 - closed by close()
            if old and not old.endswith(b"\n"):
                write_all(self._file, b"\n")
            self._agreed = self._file.tell()
        except OSError as error:
            raise InputError(not_written(folder, error)) from None

    def _remember(self, line: bytes) -> None:
        try:
            stated = JournalLine.model_validate_json(line, strict=True)
        except ValueError:
            self.unread += line.endswith(b"\n")
            return
        self.rows[stated.hash] = RunRow(stated.status, stated.message, stated.wall_s, stated.metrics, {})

    def finished(self, hash_: str) -> RunRow | None:
        """What is kept of a run that need not be made again; one that was lost may go well next time."""
        row = self.rows.get(hash_)
        return None if row is None or row.status == "lost" else row

    def add(self, hash_: str, row: RunRow) -> None:
        """A run has ended.

        Raises:
            OSError: it cannot be written; then nothing of it is.
        """
        stated = {"hash": hash_, **row._asdict()}
        del stated["log"], stated["value"]
        begun = self._file.tell()
        try:
            write_all(self._file, (json.dumps(stated) + "\n").encode())
        except OSError:
            self._file.truncate(begun)
            raise
        self.rows[hash_] = row._replace(log={}, value=None)
        self.new.append(hash_)

    def agree(self) -> None:
        """The table now has all that was written here."""
        self._agreed = self._file.tell()
        self.new.clear()

    def take_back(self) -> None:
        """Forget what was written since :meth:`agree`: the table cannot have it."""
        self._file.truncate(self._agreed)
        for hash_ in self.new:
            del self.rows[hash_]
        self.new.clear()

    def close(self) -> None:
        self._file.close()


def keep_log(folder: Path, hash_: str, log: Mapping[str, bytes]) -> None:
    """Write the files of a run's log.

    Raises:
        OSError: they cannot be written.
    """
    place = log_folder(folder, hash_)
    place.mkdir(parents=True, exist_ok=True)
    for name, content in log.items():
        with atomic_write(place / name) as scratch:
            scratch.write_bytes(content)


def log_folder(folder: Path, hash_: str) -> Path:
    """Where the log of a run is kept."""
    return folder / LOGS / hash_[:DIGITS]


def table(cases: Iterable[tuple[Case, str]], rows: Mapping[str, RunRow]) -> pandas.DataFrame:
    """One row for each run that has ended, in the order of the design.

    Args:
        cases: runs with their hashes.
        rows: what is kept of each, by hash.

    Returns:
        Columns: the axes, the metrics (NaN where there are none; the measures of trials where there are
        some), status, message, wall_s, hash.
    """
    import pandas

    ended = sorted(((case, h) for case, h in cases if h in rows), key=lambda pair: pair[0].number)
    columns: dict[str, list[Any]] = {}
    for name in ended[0][0].shown if ended else ():
        columns[name] = _plain([case.shown[name] for case, _ in ended])
    for metric in EVERY:
        if metric not in METRICS and not any(metric.name in rows[h].metrics for _, h in ended):
            continue  # of trials or of power, and there is none
        columns[metric.name] = [rows[h].metrics.get(metric.name, math.nan) for _, h in ended]
    columns["status"] = ["done" if rows[h].status == "done" else "failed" for _, h in ended]
    columns["message"] = [rows[h].message for _, h in ended]
    columns["wall_s"] = [rows[h].wall_s for _, h in ended]
    columns["hash"] = [h for _, h in ended]
    return pandas.DataFrame(columns)


def _plain(values: list[Any]) -> list[Any]:
    """The values of an axis as one type of a table: numbers, or text."""
    if all(isinstance(v, bool) for v in values) or all(
        isinstance(v, (int, float)) and not isinstance(v, bool) for v in values
    ):
        return values
    return [v if isinstance(v, str) else json.dumps(v) for v in values]


def hashes(folder: Path) -> set[str]:
    """The runs that the table of a folder has; none where no table can be read."""
    from pyarrow import parquet

    try:
        with parquet.ParquetFile(folder / TABLE) as file:  # read_table would import three times as much
            return set(file.read(columns=["hash"])["hash"].to_pylist())
    except (OSError, ValueError, KeyError):
        return set()


def write_table(folder: Path, made: pandas.DataFrame) -> None:
    """Write ``runs.parquet``.

    Raises:
        OSError: it cannot be written.
    """
    with atomic_write(folder / TABLE) as scratch:
        made.to_parquet(scratch, index=False)
