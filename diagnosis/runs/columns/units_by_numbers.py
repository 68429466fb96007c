"""What the numbers of a table say of its columns: units, signs, and whether they are stamps."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import pandas as pd

from fmus.ship import Ship, ship

from ..cleaning import WIDTH, angles_beside, lost
from ..files.reading import Run
from ..files.tables import MeasuredTable, cell_numbers, clock_seconds, date_stamps
from ..frozen import repeated
from ..position_jumps import speeds
from ..row_order import by_stamps, in_order
from .columns import OF_UNIT, UNITS, Column, Layout, largest_commands
from .likely_columns import ASTERN, says_command, signal_of_sign
from .name_words import words_of
from .unit_check import (
    FASTEST,
    OFTENEST,
    STATED,
    doubts,
    doubts_of_angles,
    largest,
    likely_unit,
    part_by_span,
    part_of_degree,
    spelt,
)

# m/s, times the scale of the ship: a Froude number of 1.5. A time that makes a ship faster is in
# 1/100 s, as controllers count it, and not in ms; chosen.
PLANING = 5.0


def is_fraction(table: MeasuredTable, signal: str, column: Column, quantity: Mapping[str, str]) -> bool:
    """Whether the column of a shaft is not called a speed, and has fractions of the full command."""
    if quantity[signal] != "shaft speed" or column.unit or says_command(column.name, signal, quantity):
        return False
    values = numbers_of(table.columns({column.name})[column.name], "")
    return float(np.nanmax(np.abs(values), initial=0.0)) <= largest("command")


def is_stamped(table: MeasuredTable, name: str) -> bool:
    """Whether a column has date stamps or times of day."""
    return date_stamps(table.columns({name})[name]) is not None


def units_of_commands(table: MeasuredTable, layout: Layout, of: Ship) -> dict[str, Column]:
    """Commands without a unit that are far beyond the ship's limits, in the only unit within them.

    Those of one quantity have one unit. Far is half of the way, in logarithms, to the nearest unit. Per
    cent of a shaft speed or an angle are those of its limit.
    """
    found: dict[str, Column] = {}
    for form, commands in zip(of.command_forms, of.layouts, strict=True):
        limits = largest_commands(commands, of, math.tau)
        for si in dict.fromkeys(form.values()):
            own = {s: x for (s, unit), x in zip(form.items(), limits, strict=True) if unit == si}
            columns = {s: c for s in own if (c := layout.column(s)).name in table.names}
            if not columns or any(c.unit or c.factor != 1.0 for c in columns.values()):
                continue
            if OF_UNIT[si] != "command" and all(_is_percent(c.name) for c in columns.values()):
                factors = {s: float(f"{own[s] / 100.0:.6g}") for s in columns}
                found |= {s: c.model_copy(update={"factor": factors[s]}) for s, c in columns.items()}
                continue
            cells = table.columns(names_of(columns))
            size = {s: np.abs(numbers_of(cells[c.name], "")) for s, c in columns.items()}
            most = {s: float(np.nanmax(x, initial=0.0)) for s, x in size.items()}
            unit = _unit_within(most, own, OF_UNIT[si])
            found |= {s: c.model_copy(update={"unit": unit}) for s, c in columns.items() if unit}
    return found


def _is_percent(name: str) -> bool:
    """Whether a word of a column's name is per cent."""
    return any(spelt(word.casefold()) == "%" for word in re.split(r"[\s_.()\[\]]+", name))


def _unit_within(most: Mapping[str, float], limits: Mapping[str, float], quantity: str) -> str | None:
    """The only unit in which commands of a quantity are within limits; None: SI, or it is not known."""
    units = reversed(UNITS[quantity].items())
    smaller = {size: unit for unit, size in units if size < 1.0 and unit not in STATED}
    if not smaller:
        return None
    share = max((most[s] / limits[s] for s in most if limits[s] > 0.0), default=0.0)
    within = [unit for size, unit in smaller.items() if size * share <= largest("command")]
    far = share > max(smaller) ** -0.5 or max(most.values()) > largest(quantity)
    return within[0] if far and len(within) == 1 else None


def sign_columns(
    table: MeasuredTable, layout: Layout, unused: Sequence[str], quantity: Mapping[str, str]
) -> dict[str, Column]:
    """Commands whose sign is in a column of its own, as astern of a shaft, or port of a rudder."""
    own = {s: c for s, c in layout.columns.items() if "." in s and not c.sign}
    named = {n: signal_of_sign(n, {s: quantity[s] for s in own}) for n in unused}
    found: dict[str, Column] = {}
    for name, signal in named.items():
        if not signal:
            continue
        pair = table.columns({name, own[signal].name})
        cells = pair[name].dropna().astype("string").str.strip().unique().tolist()
        negative = [cell for cell in cells if _is_negative(cell, quantity[signal])]
        values = numbers_of(pair[own[signal].name], "")
        if len(cells) <= 3 and len(negative) == 1 and np.nanmin(values, initial=0.0) >= 0.0:
            found[signal] = own[signal].model_copy(update={"sign": name, "negative": negative[0]})
    return found


def _is_negative(cell: str, quantity: str) -> bool:
    """Whether the cell of a sign is that of negative values: astern, or to port, but of a shaft."""
    to_port = words_of(cell) == ["port"] or cell.casefold() in ("p", "l", "-", "-1", "-1.0")
    astern = cell.casefold() in ASTERN
    return {"angle": to_port, "shaft speed": astern}.get(quantity, to_port or astern)


def names_of(columns: Mapping[str, Column]) -> set[str]:
    """The names of some columns."""
    return {column.name for column in columns.values()}


def numbers_of(cells: pd.Series, signal: str) -> np.ndarray:
    """A column as floats, NaN where it is none; date stamps as seconds."""
    stamps = date_stamps(cells) if signal == "time" else None
    if stamps is not None:
        return stamps
    found = cell_numbers(cells)
    return clock_seconds(found) if signal == "time" else found


def seen_units(run: Run, stamped: bool = False) -> Iterable[tuple[str, str, float]]:
    """Signals that seem to be in another unit: which, in which, and by which factor to that.

    Args:
        run: as it is read.
        stamped: whether its time is by date stamps, which are in no unit.
    """
    if not np.isfinite(run.time).any():
        return
    unit, scale = None if stamped else time_unit(run.time), ship(description=run.ship).scale
    size = UNITS["time"][unit or "s"]
    if unit:
        tenfold = unit == "ms" and _speed(run) / size > min(PLANING * scale.speed, FASTEST)
        size *= 10.0 if tenfold else 1.0
        yield "time", unit, 10.0 if tenfold else 1.0
    run = by_stamps(run)
    of_pose = np.asarray(np.isfinite(run.pose).any(axis=1))
    run = run.rows(of_pose)  # those of other tables may have the same times
    run = run.rows(in_order(run.time))
    there = ~lost(run.pose)
    zeros = (run.pose == 0.0).all(axis=1)
    fresh = ~zeros & ~repeated(run.pose, there)
    time = size * run.time[fresh]
    for doubt in doubts(time, run.pose[fresh], scale):
        factor = part_of_degree(run.pose[fresh]) if doubt.signals == ("psi",) else 1.0
        yield from ((signal, doubt.unit, factor) for signal in doubt.signals)
    angles = angles_beside(run)
    for doubt in doubts_of_angles(angles):
        if part := part_by_span(angles[doubt.signals[0]]):
            yield doubt.signals[0], doubt.unit, part


def _speed(run: Run) -> float:
    """The speed that a run exceeds in a tenth of it [m, by the unit of its time]."""
    speed = speeds(run.time, run.pose[:, :2])
    speed = speed[np.isfinite(speed)]
    return float(np.quantile(speed, 0.9)) if speed.size else 0.0


def time_unit(time: np.ndarray) -> str | None:
    """The unit that times (n,) seem to be in; None: seconds."""
    time = np.unique(time[np.isfinite(time)])
    apart = float(np.median(np.diff(time))) if time.size > 1 else 1.0
    return likely_unit(apart) if not OFTENEST < apart < WIDTH else None
