"""The log of a run: written as it goes, so that whatever ends the run leaves a readable file."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import orjson

from .errors import InputError, nearest
from .files import whole

CSV = "log.csv"
PARQUET = "log.parquet"
SIDECAR = "log.json"
METRICS = "metrics.json"


class LogWriter:
    """A CSV file that grows by blocks of rows, each handed to the system in one piece.

    Args:
        path: file to write; an older one is replaced.
        columns: names for the header line, ``time`` first.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115 - closed by close()
        self._file.write((",".join(_quoted(c) for c in columns) + "\n").encode())

    def write(self, block: np.ndarray) -> None:
        """Append rows.

        Args:
            block: (rows, columns), float64, C-contiguous.
        """
        if not len(block):
            return
        lines = orjson.dumps(block, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2].split(b"],[")
        # JSON knows neither NaN nor infinity; all other numbers must look the same in every row.
        for k in np.flatnonzero(~np.isfinite(block).all(axis=1)):
            cells = lines[k].split(b",")
            for j in np.flatnonzero(~np.isfinite(block[k])):
                cells[j] = repr(float(block[k, j])).encode()
            lines[k] = b",".join(cells)
        self._file.write(b"\n".join(lines) + b"\n")

    def close(self) -> None:
        self._file.close()


def _quoted(name: str) -> str:
    """A column name as CSV wants it: FMI allows commas, as in ``M[1,2]``, and even line breaks."""
    name = " ".join(name.split())
    return '"' + name.replace('"', '""') + '"' if "," in name or '"' in name else name


def _header(line: str) -> list[str]:
    import csv

    return next(csv.reader([line]))


def to_parquet(folder: Path) -> Path:
    """Turn the CSV log of a folder into Parquet; the CSV goes only when the new file is whole."""
    from pyarrow import csv, parquet

    with whole(folder / PARQUET) as scratch:
        parquet.write_table(csv.read_csv(folder / CSV), scratch)
    (folder / CSV).unlink()
    return folder / PARQUET


def read_log(folder: str | Path, columns: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a log, CSV or Parquet, complete or cut off.

    Args:
        folder: where a run put its output.
        columns: names to read; None reads all. ``time`` is always read.

    Returns:
        Name -> values, shape (rows,).

    Raises:
        InputError: no log there, or a column that it does not have.
    """
    folder = Path(folder)
    if (folder / PARQUET).is_file() and not (folder / CSV).is_file():
        return _read_parquet(folder / PARQUET, columns)
    path = folder / CSV
    try:
        with open(path, encoding="utf-8") as file:
            names = _header(file.readline().rstrip("\n"))
            if "time" not in names:
                raise InputError(f"'{path}' is not a log: it has no column 'time'")
            wanted = _wanted(names, columns, path)
            places = [names.index(name) for name in wanted]
            # A run that was killed may leave part of a line at the end.
            lines = (line for line in file if line.endswith("\n"))
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # a log without rows is a log
                table = np.loadtxt(lines, delimiter=",", usecols=places, ndmin=2)
    except FileNotFoundError:
        raise InputError(f"no log in '{folder}': {CSV} is missing") from None
    except (OSError, ValueError, UnicodeDecodeError, StopIteration) as error:
        raise InputError(f"'{path}' cannot be read as a log: {error}") from error
    table = table.reshape(-1, len(wanted))
    return {name: table[:, k] for k, name in enumerate(wanted)}


def _read_parquet(path: Path, columns: Sequence[str] | None) -> dict[str, np.ndarray]:
    try:
        from pyarrow import parquet
    except ImportError:
        raise InputError("reading Parquet needs pyarrow: pip install 'cybership[parquet]'") from None
    try:
        wanted = _wanted(parquet.read_schema(path).names, columns, path)
        table = parquet.read_table(path, columns=wanted)
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a log: {error}") from error
    return {name: table[name].to_numpy() for name in wanted}


def _wanted(names: Sequence[str], columns: Sequence[str] | None, path: Path) -> list[str]:
    if columns is None:
        return list(names)
    for column in columns:
        if column not in names:
            raise InputError(f"'{path}' has no column '{column}'{nearest(column, names)}")
    return ["time", *(c for c in columns if c != "time")]
