"""Parameter tables: CSV files whose columns become the numbered parameters of an FMU."""

import csv
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

from cybership.message_text import counted

from ..errors import InputError, nearest
from ..fmu.fmu_model import FmuVariable


@contextmanager
def opened_table(path: Path, what: str) -> Iterator[Any]:
    """The reader of a CSV file; errors while it reads name the file, by ``what`` that is."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            yield csv.reader(file, skipinitialspace=True)
    except FileNotFoundError:
        near = [p.name for p in path.parent.glob("*.csv")]
        raise InputError(f"no such {what}: '{path}'{nearest(path.name, near)}") from None
    except (OSError, ValueError, csv.Error) as error:
        raise InputError(f"'{path}' cannot be read as a {what}: {error}") from None


def read_table(path: Path) -> dict[str, list[float]]:
    """Columns of a CSV file.

    Args:
        path: a file with one line of names and then lines of numbers; empty lines do not count.

    Returns:
        Name -> numbers, all of the same length.

    Raises:
        InputError: missing, unreadable, a name twice, a cell that is no finite number, no rows, or one
            that repeats the one before, as a way point that is reached at once.
    """
    with opened_table(path, "table") as reader:
        lines = [(reader.line_num, cells) for cells in reader if any(c.strip() for c in cells)]
    if len(lines) < 2:
        raise InputError(f"'{path}' needs a line of names and lines of numbers")
    names = [name.strip() for name in lines[0][1]]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"'{path}': the column {name!r} occurs twice")
    columns: dict[str, list[float]] = {name: [] for name in names}
    for (before, above), (line, cells) in pairwise(lines):
        where = f"'{path}', line {line}"
        if cells == above:
            raise InputError(f"{where} repeats line {before}")
        if len(cells) != len(names):
            raise InputError(f"{where} has {len(cells)} cells, not {len(names)}")
        for name, cell in zip(names, cells, strict=True):
            columns[name].append(_number(cell, f"{where}: {name!r}"))
    return columns


def _number(text: str, where: str) -> float:
    with suppress(ValueError):
        value = float(text)
        if math.isfinite(value) and "_" not in text:
            return value
    raise InputError(f"{where} = {text[:40]!r} is not a number")


def table_parameters(
    columns: Mapping[str, list[float]], known: Mapping[str, FmuVariable], where: str
) -> dict[str, float]:
    """The parameters of an FMU that a table gives.

    Args:
        columns: name -> numbers.
        known: parameters of the FMU. One that takes a table has ``count``, for the number of rows, and
            for each column ``c`` the parameters ``c_1``, ``c_2``, ...; a column that may be left out
            has a ``c_given`` as well, which states whether it is there.
        where: name of the table in messages.

    Raises:
        InputError: the FMU takes no table, not this column, or not so many rows; a column is missing.
    """
    if "count" not in known:
        raise InputError(f"{where}: this FMU takes no table, because it has no parameter 'count'")
    takes = [name.removesuffix("_1") for name in known if name.endswith("_1")]
    for name in columns:
        if name not in takes:
            raise InputError(f"{where}: the FMU takes no column {name!r}{nearest(name, takes)}")
    for name in takes:
        if name not in columns and f"{name}_given" not in known:
            raise InputError(f"{where}: the column '{name}' is missing")
    rows = max(map(len, columns.values()))
    most = sum(f"{takes[0]}_{k}" in known for k in range(1, len(known)))
    least = int(known["count"].min or 0)
    if not least <= rows <= most:
        raise InputError(f"{where} has {counted(rows, 'row')}; allowed are {least} to {most}")
    found = {f"{name}_{k}": x for name, column in columns.items() for k, x in enumerate(column, 1)}
    given = {f"{name}_given": 1.0 for name in columns if f"{name}_given" in known}
    return {"count": float(rows), **given, **found}
