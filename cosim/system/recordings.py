"""Recordings: inputs that get their values from a file over time, in place of an FMU's output."""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError, nearest
from ..scenario.faults import Effect, Values
from ..scenario.plans import TIME_TOLERANCE
from .parameter_table import opened_table


@dataclass(frozen=True)
class Recorded:
    """What a file gives to inputs of one instance.

    Attributes:
        names: of the inputs, ``instance.variable``.
        time: of the rows [s], growing.
        rows: for each row a value for each input, None where the file has an empty cell.
    """

    names: Sequence[str]
    time: Sequence[float]
    rows: Sequence[Sequence[float | None]]

    def bind(self, slots: Sequence[int]) -> Effect:
        """``effect(values, t)``: the latest row's values at the slots, empty cells left as they are."""
        time, rows, last = self.time, self.rows, len(self.time) - 1

        def effect(values: Values, t: float) -> None:
            k = min(max(bisect_right(time, t + TIME_TOLERANCE) - 1, 0), last)
            for slot, value in zip(slots, rows[k], strict=True):
                if value is not None:
                    values[slot] = value

        return effect


def _places(names: Sequence[str], wanted: Sequence[str], path: Path) -> dict[str, int]:
    """Column -> its place.

    Raises:
        InputError: a column is missing, or there twice.
    """
    for name in wanted:
        if names.count(name) > 1:
            raise InputError(f"recording '{path}' has {names.count(name)} columns '{name}'")
        if name not in names:
            raise InputError(f"recording '{path}' has no column '{name}'{nearest(name, names)}")
    return {name: names.index(name) for name in wanted}


def read_recording(
    path: Path, wanted: Mapping[str, None]
) -> tuple[list[float], dict[str, list[float | None]]]:
    """Times and columns of a CSV file.

    Args:
        path: a file with one line of names, ``time`` among them, and then lines of numbers.
        wanted: names of the columns to read.

    Returns:
        Times [s], and values by column; None for an empty cell, and NaN where that is written.

    Raises:
        InputError: missing, unreadable, a column missing or there twice, a cell that is
            no number, times not growing.
    """
    with opened_table(path, "recording") as reader:
        names = [name.strip() for name in next(reader, [])]
        places = _places(names, ("time", *wanted), path)
        time: list[float] = []
        columns: dict[str, list[float | None]] = {name: [] for name in wanted}
        for cells in reader:
            if not cells:
                continue
            if len(cells) != len(names):
                raise ValueError(f"line {reader.line_num} has {len(cells)} cells, not {len(names)}")
            time.append(float(cells[places["time"]]))
            for name, column in columns.items():
                cell = cells[places[name]]
                column.append(float(cell) if cell.strip() else None)
    if not time or not all(a < b for a, b in zip(time, [*time[1:], math.inf], strict=True)):
        raise InputError(f"'{path}' cannot be read as a recording: it needs rows with increasing time")
    return time, columns
