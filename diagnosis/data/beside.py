"""The line for the file beside a measurement, where it seems to be read otherwise than meant."""

import json
from collections.abc import Mapping
from pathlib import Path

from cosim import InputError

from .columns import QUANTITY, SHOWN, UNITS, Column, Layout, read_layout

SEPARATORS = (";", "\t", "|")  # that a table may have in place of commas
SI = ("s", "m", "rad", "N", "N.m", "1")  # need not be said
SAME_UNIT = 1e-6  # relative difference of two factors of the same unit: rounding


def line_beside(
    path: Path, changes: Mapping[str, tuple[str, float, float]], name: str | None = None
) -> str:
    """What to put into the file beside a measurement so that columns are read otherwise.

    Args:
        path: of the measurement.
        changes: signal -> the signal whose column it should have, its sign, and the factor of its unit.
        name: of the column; None: as it is.

    Returns:
        The end of a sentence; empty where there is no such file, as beside a log.
    """
    if path.is_dir() or path.suffix not in (".csv", ".parquet"):
        return ""
    layout = read_layout(path) or Layout()
    columns = {}
    for signal, (source, sign, factor) in changes.items():
        column = layout.column(source)
        units = UNITS[QUANTITY[signal]]
        wanted = factor * units.get(column.unit or "", 1.0)
        unit = next((u for u, size in units.items() if abs(size / wanted - 1.0) < SAME_UNIT), None)
        flip = column.flip != (sign < 0.0)
        other = {"name": name or column.name, "unit": unit, "factor": column.factor, "flip": flip}
        other["offset"] = sign * column.offset
        columns[signal] = Column.model_validate(other).model_dump(exclude_defaults=True)
        if columns[signal].get("unit") in SI:
            del columns[signal]["unit"]
    line = json.dumps({"columns": columns})
    return f"; put {line} into '{path}.json'"


def refuse_separator(path: Path, header: str) -> None:
    """Refuse a CSV file whose one column is a row of cells, between other separators.

    Raises:
        InputError: with the line that tells the separator.
    """
    separator = max(SEPARATORS, key=header.count)
    if separator not in header:
        return
    with path.open(encoding="utf-8-sig") as file:
        cells = [file.readline() for _ in range(2)][1]
    layout = {"separator": separator} | ({"decimal": ","} if "," in cells else {})
    raise InputError(
        f"'{path}' has a single column, '{header[:SHOWN]}': its cells seem to be separated by "
        f"{separator!r}; put {json.dumps(layout)} into '{path}.json'"
    )
