"""The log of a run: written during the run, so that the file is readable whatever ends the run."""

import csv
import errno
import json
import os
import re
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import orjson

from cybership.scratch_folder import atomic_write

from ..errors import InputError, nearest
from ..files import write_all
from ..process.run_state import Owner

if TYPE_CHECKING:
    import pandas

CSV = "log.csv"
PARQUET = "log.parquet"
SIDECAR = "log.json"
METRICS = "metrics.json"
TRIAL = "trial.json"
TRIAL_PICTURE = "trial.png"
CHUNK = 2**20  # bytes read at once; chosen
SHOWN = 6  # names of columns that a terminal shows; chosen: a line has about so many

# Column name, as in the header of ``log.csv``, -> values, shape (rows,).
Log = Mapping[str, np.ndarray]


class Rows(NamedTuple):
    """Rows of a log.

    Attributes:
        times: [s], float64, shape (rows,).
        table: values of all signals, float64, shape (rows, signals).
        slots: places in it of the logged signals, intp, shape (columns,).
    """

    times: np.ndarray
    table: np.ndarray
    slots: np.ndarray

    def block(self) -> np.ndarray:
        """Times and logged signals, shape (rows, 1 + columns), C-contiguous."""
        block = np.empty((len(self.times), 1 + len(self.slots)))
        block[:, 0] = self.times
        block[:, 1:] = self.table[:, self.slots]
        return block


class LogColumns(dict[str, np.ndarray]):
    """Columns of a log by name; a terminal shows their number, not their values."""

    def __repr__(self) -> str:
        rows = len(next(iter(self.values()), ()))
        return f"<log of {rows} rows: {', '.join([*self][:SHOWN])}{', ...' * (len(self) > SHOWN)}>"


class LogWriter:
    """A CSV file that grows by blocks of rows, each written in one call.

    Whatever happens the file is a beginning of the log in whole rows, unless the process is killed
    inside of a call.

    Args:
        path: file to write; an older one is replaced.
        columns: names for the header line, ``time`` first.

    Attributes:
        rows: number of rows in the file.

    Raises:
        OSError: the file cannot be made; then there is none.
    """

    def __init__(self, path: Path, columns: Sequence[str]) -> None:
        self.rows = 0
        self._owner = Owner()
        self._failure: OSError | None = None
        self._file = open(path, "wb", buffering=0)  # noqa: SIM115 - closed by close()
        self._identity = self._identify()
        try:
            header = StringIO()  # FMI allows commas in names, as in ``M[1,2]``, and even line breaks
            csv.writer(header, lineterminator="\n").writerow(" ".join(c.split()) for c in columns)
            write_all(self._file, header.getvalue().encode())
        except OSError:
            self._file.close()
            path.unlink(missing_ok=True)
            raise

    def _identify(self) -> tuple[int, int]:
        """Device and number of the file behind the descriptor: an FMU may close it, and open another."""
        info = os.fstat(self._file.fileno())
        return info.st_dev, info.st_ino

    def write(self, rows: Rows) -> None:
        """Append rows.

        Raises:
            OSError: not all could be written; ``rows`` tells how many were, and none can follow.
        """
        self._owner.leave_copies()
        if self._failure:
            raise self._failure
        if not len(rows.times):
            return
        text = format_rows(rows.block())
        try:
            if self._identify() != self._identity:
                raise OSError(errno.EBADF, "another part of the program closed its file")
            begun = self._file.tell()
            try:
                write_all(self._file, text)
            except OSError:
                self._cut(begun, text)
                raise
        except OSError as error:
            self._failure = error
            raise
        self.rows += len(rows.times)

    def _cut(self, begun: int, text: bytes) -> None:
        """Keep the rows of a block that are whole, of one that begins at a position [bytes]."""
        whole = text[: text.rfind(b"\n", 0, self._file.tell() - begun) + 1]
        self._file.truncate(begun + len(whole))
        self.rows += whole.count(b"\n")

    def close(self) -> None:
        with suppress(OSError):  # closed by something else
            self._file.close()


class LogInMemory:
    """A log that is kept in memory, in place of a file.

    Args:
        columns: names, ``time`` first.

    Attributes:
        rows: number of rows so far.
    """

    def __init__(self, columns: Sequence[str]) -> None:
        self.rows = 0
        self._names = list(columns)
        self._blocks: list[np.ndarray] = []

    def write(self, rows: Rows) -> None:
        """Append rows."""
        self._blocks.append(rows.block())
        self.rows += len(rows.times)

    def close(self) -> None:
        """Nothing is open."""

    def read(self) -> dict[str, np.ndarray]:
        """What :func:`read_log` reads from the file of the same run, to the bit."""
        table = np.concatenate(self._blocks) if self._blocks else np.empty((0, len(self._names)))
        return {name: table[:, k] for k, name in enumerate(self._names)}


def format_rows(block: np.ndarray) -> bytes:
    """Rows of a log as text, a line each.

    Args:
        block: (rows, columns), float64, C-contiguous.
    """
    # Row by row: to look for the ends of rows in the text of a block would take longer.
    lines = [orjson.dumps(row, option=orjson.OPT_SERIALIZE_NUMPY)[1:-1] for row in block]
    text = b"\n".join([*lines, b""])
    known = np.isfinite(block)
    if known.all():
        return text
    # JSON has neither NaN nor infinity: orjson writes null; all other numbers must look the same.
    missing = iter(block[~known].tolist())
    return re.sub(b"null", lambda _: repr(next(missing)).encode(), text)


def cut_to_rows(path: Path) -> int:
    """Remove what a process that was killed has left of a row at the end of a CSV log.

    Returns:
        The number of rows that remain.
    """
    if not path.is_file():
        return 0
    whole = lines = read = 0
    with open(path, "rb") as file:
        while chunk := file.read(CHUNK):
            if last := chunk.rfind(b"\n") + 1:
                whole = read + last
            lines += chunk.count(b"\n")
            read += len(chunk)
    if whole < read:
        os.truncate(path, whole)
    return max(0, lines - 1)


def to_parquet(folder: Path) -> Path:
    """Replace the CSV log of a folder by Parquet; the CSV is removed when the new file is complete."""
    from pyarrow import parquet, types
    from pyarrow.csv import read_csv

    table = read_csv(folder / CSV)
    # Bytes of equal weight lie together: 12 MB in place of 20 for the ellipse, whose CSV has 45.
    split = {field.name: "BYTE_STREAM_SPLIT" for field in table.schema if types.is_floating(field.type)}
    with atomic_write(folder / PARQUET) as scratch:
        parquet.write_table(
            table, scratch, compression="zstd", use_dictionary=False, column_encoding=split
        )
    (folder / CSV).unlink()
    return folder / PARQUET


def read_log(folder: str | Path, columns: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Columns of a log, CSV or Parquet, complete or cut off.

    Args:
        folder: results of a run.
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
            names = next(csv.reader([file.readline().rstrip("\n")]))
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
    except NotADirectoryError:
        raise InputError(f"'{folder}' is a file; a log is a folder, as results/ellipse") from None
    except (OSError, ValueError, UnicodeDecodeError, StopIteration) as error:
        raise InputError(f"'{path}' cannot be read as a log: {error}") from error
    table = table.reshape(-1, len(wanted))
    return LogColumns({name: table[:, k] for k, name in enumerate(wanted)})


def _read_parquet(path: Path, columns: Sequence[str] | None) -> dict[str, np.ndarray]:
    try:
        from pyarrow import parquet
    except ImportError:
        raise InputError("reading Parquet needs pyarrow: pip install 'cybership[tables]'") from None
    try:
        with parquet.ParquetFile(path) as file:  # read_table would import pandas
            wanted = _wanted(file.schema_arrow.names, columns, path)
            table = file.read(columns=wanted)
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a log: {error}") from error
    return LogColumns({name: table[name].to_numpy() for name in wanted})


def _wanted(names: Sequence[str], columns: Sequence[str] | None, path: Path) -> list[str]:
    if columns is None:
        return list(names)
    for column in columns:
        if column not in names:
            raise InputError(f"'{path}' has no column '{column}'{nearest(column, names)}")
    return ["time", *(c for c in columns if c != "time")]


def log_frame(folder: str | Path) -> "pandas.DataFrame":
    """The log of a run as a table of pandas: one row a logged step, one column a signal.

    Args:
        folder: results of a run.

    Returns:
        The columns of ``log.csv``; ``attrs["units"]`` and ``attrs["descriptions"]`` describe each.

    Raises:
        InputError: there is no log, or pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError("a log as a table needs pandas: pip install 'cybership[tables]'") from None
    frame = pandas.DataFrame(read_log(folder))
    try:
        columns = json.loads((Path(folder) / SIDECAR).read_text(encoding="utf-8"))["columns"]
    except (OSError, ValueError, KeyError):
        columns = {}
    for kind in ("unit", "description"):
        frame.attrs[f"{kind}s"] = {name: stated.get(kind, "") for name, stated in columns.items()}
    return frame
