"""The content of the file beside a measurement, proposed by a look at the measurement itself."""

import math
from collections.abc import Collection, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from cosim import InputError
from fmus.ship import Ship, ship

from ..files.matlab_files import fits_matlab
from ..files.message_fields import MessageField
from ..files.reading import Run, read, signed
from ..files.tables import MeasuredTable, date_stamps
from ..files.text_layout import KNOWN, bare_unit, likely_encoding, table_cells, text_layout, unmarked
from .columns import (
    POSE,
    UNITS,
    UTF_8,
    Column,
    Layout,
    log_of,
    missing,
    quantities,
    signals,
    stated_layout,
    to_si,
)
from .columns_by_name import named_columns, refuse_unit
from .geographic import (
    SIDES,
    across_date_line,
    are_minutes,
    available,
    geographic_pair,
    is_side,
    local_columns,
    one_origin,
    refuse_letters,
)
from .likely_columns import (
    LikelyColumn,
    likely_columns,
    motion_of,
    unit_in,
)
from .name_units import NO_UNIT, bare_name, without_unit
from .side_car import as_json, refuse_other_kinds, refuse_thousands
from .units_by_numbers import (
    is_stamped,
    names_of,
    numbers_of,
    seen_units,
    sign_columns,
    time_unit,
    units_of_commands,
)
from .usual_names import value_column


class Proposal(NamedTuple):
    """How a measurement seems to be meant.

    Attributes:
        layout: the content of the file next to it, what is stated there kept; names of signals of which
            no column is known are blank.
        unused: names of columns that are no signals, as far as is known.
        run: the measurement, read so; None where a name is blank.
        likely: signal of a blank name -> columns that may be its own, the likeliest first.
        by_numbers: signal -> its unit, where the numbers tell another one than the name, or than SI.
    """

    layout: Layout
    unused: Sequence[str]
    run: Run | None
    likely: Mapping[str, Sequence[LikelyColumn]] = {}
    by_numbers: Mapping[str, str] = {}

    @property
    def needed(self) -> dict[str, Any]:
        """What has to be stated, as JSON holds it; a log of this project needs nothing."""
        if self.layout.column("x") == log_of(()).column("x"):
            return {}
        return as_json(self.layout)


def propose(path: Path, of: Ship | None = None) -> Proposal:
    """Look at a file: its text, its names and units, and at the numbers where units are not stated.

    Args:
        path: a CSV, Parquet or MATLAB file; what is stated beside it stands.
        of: the ship that was measured; None: the default ship.

    Raises:
        InputError: no such file, no table of numbers below names, a unit that is not known, or a file
            beside it that does not fit.
    """
    of = of or ship()
    quantity = quantities(of)
    if path.is_dir() or (path.suffix == ".mat" and fits_matlab(of)):
        raise InputError(f"'{path}' is not a CSV, Parquet or MATLAB file with named columns")
    if not path.is_file():
        read(path, of=of)  # refuses it
    stated = stated_layout(path) or Layout()
    text = text_of(path, stated)
    table = MeasuredTable(path, text)
    names, fields = table.names, table.fields
    log = log_of(of.commands)
    if log.column("x").name in names:
        return Proposal(log, [], read(path, log, of))
    units = units_below(table, names)
    parts = {name for field in fields.values() for name in field.columns}
    within = tuple(f"{field}{mark}" for field in fields for mark in "./")  # as the yaw of a quaternion
    whole = [k for k, name in enumerate(names) if name not in parts and not name.startswith(within)]
    names, units = [names[k] for k in whole], [units[k] for k in whole]
    below = dict(zip(names, units, strict=False))
    named = {s: c for s, c in stated.columns.items() if c.name.strip()}
    kept = {s: _in_unit_of_name(c, s, below, quantity, path) for s, c in named.items()}
    columns = named_columns(table, names, units, quantity, kept, fields)
    columns |= _of_message(columns, fields, kept)
    columns |= _stamped(table, text.model_copy(update={"columns": columns}), names)
    columns |= _geographic(table, text.model_copy(update={"columns": columns}), names, units)
    kept = {s: columns[s] for s in kept}
    layout = text.model_copy(update={"columns": columns})
    unused = [name for name in names if name not in {layout.column(s).name for s in quantity}]
    if blank := missing(layout, names, of):
        if {"x", "y"} <= {*blank} and (value := value_column(names)):
            raise InputError(
                f"'{path}' has no position; if it has one value in a row, in '{value}', "
                f"'cybership join {path} --out run.csv' gives each name a column"
            )
        left = {n: below.get(n, "") for n in unused}
        return _with_blanks(table, layout, kept, left, blank, quantity)
    try:
        signals(layout, names, f"'{path}'", of)
    except InputError as error:
        more = f"; columns that are not known signals: {', '.join(unused)}" if unused else ""
        raise InputError(f"{error}{more}") from None
    reported = {s: layout.column(s).unit for s in quantity}
    columns |= units_of_commands(table, layout, of)
    columns |= sign_columns(table, layout.model_copy(update={"columns": columns}), unused, quantity)
    unused = [name for name in unused if name not in {c.sign for c in columns.values()}]
    run = read(path, layout.model_copy(update={"columns": columns}), of)
    timed = "time" not in layout.without_column
    stamped = timed and is_stamped(table, layout.column("time").name)
    for signal, unit, factor in seen_units(run, stamped):
        if signal not in kept or not _is_told(kept[signal]):
            columns[signal] = layout.column(signal).model_copy(update={"unit": unit, "factor": factor})
    needed = {s: c for s, c in columns.items() if s in kept or c != Column(name=s)}
    layout = text.model_copy(update={"columns": needed})
    by_numbers = {s: _by(c) for s, c in columns.items() if c.unit and c.unit != reported[s]}
    return Proposal(layout, unused, read(path, layout, of), by_numbers=by_numbers)


def _by(column: Column) -> str:
    """The unit of a column, with the factor to it."""
    return str(column.unit) if column.factor == 1.0 else f"{column.factor:g} {column.unit}"


def text_of(path: Path, stated: Layout) -> Layout:
    """How a table's text is laid out, by a look at it; what is stated beside it stands.

    Raises:
        InputError: no table of numbers below names.
    """
    text = Layout()
    if path.suffix not in (".parquet", ".mat"):
        refuse_other_kinds(path)
        encoding = stated.encoding if "encoding" in stated.model_fields_set else _encoding(path)
        found = text_layout(path, encoding)
        if found is None:
            raise InputError(
                f"'{path}' has no table of numbers below a line of names; if its columns have no names, "
                "write a line with these above them"
            )
        text = found.model_copy(update={"encoding": encoding})
    return text.model_copy(update=stated.model_dump(exclude_unset=True, exclude={"columns"}))


def time_column(
    table: MeasuredTable, stated: Layout, names: Sequence[str], units: Sequence[str]
) -> Column | None:
    """The column of the time of a table, by its name, its unit or its stamps; None: none is known.

    Args:
        table, stated: the table, and what is stated beside it.
        names, units: of its columns.
    """
    kept = {s: c for s, c in stated.columns.items() if s == "time" and c.name.strip()}
    columns = named_columns(table, names, units, {"time": "time"}, kept)
    columns |= _stamped(table, table.layout.model_copy(update={"columns": columns}), names)
    return columns.get("time")


def _with_blanks(
    table: MeasuredTable,
    layout: Layout,
    kept: Mapping[str, Column],
    unused: Mapping[str, str],
    blank: Sequence[str],
    quantity: Mapping[str, str],
) -> Proposal:
    """The proposal where signals have no column, by the unused ones with the units below them."""
    columns = dict(layout.columns)
    time = layout.column("time")
    if "time" not in {*kept, *blank, *layout.without_column} and not time.unit:
        cells = table.columns({time.name})[time.name]
        columns["time"] = time.model_copy(update={"unit": time_unit(numbers_of(cells, "time"))})
    needed = {s: c for s, c in columns.items() if s in kept or c != Column(name=s)}
    blanks = layout.model_copy(update={"columns": needed | {s: Column(name="") for s in blank}})
    return Proposal(blanks, [*unused], None, _likely(table, layout, unused, blank, quantity))


def common_layout(
    proposals: Mapping[Path, Proposal],
) -> tuple[Layout, dict[Path, dict[str, Column]]]:
    """What one file for all measurements of a folder says, and the columns of each that it cannot have.

    A unit that the numbers of some alone show is that of all in which the column has the same name.
    Latitudes and longitudes of all have one origin.

    Raises:
        InputError: their texts are laid out otherwise.
    """
    layouts = {path: found.layout for path, found in proposals.items()}
    texts = {path: layout.model_copy(update={"columns": {}}) for path, layout in layouts.items()}
    first, *others = texts
    for path in others:
        if texts[path] != texts[first]:
            raise InputError(
                f"the layout of '{path}' differs from that of '{first}': separator, decimal mark, "
                "encoding, lines before the names, or entries of a side-car; propose for each "
                "file alone"
            )
    common: dict[str, Column] = {}
    for signal in dict.fromkeys(s for layout in layouts.values() for s in layout.columns):
        found = [layout.column(signal) for layout in layouts.values()]
        units = {column.unit for column in found if column.unit}
        if len(units) == 1:
            found = [column.model_copy(update={"unit": next(iter(units))}) for column in found]
        if all(column == found[0] for column in found):
            common[signal] = found[0]
    common |= one_origin([layout.columns for layout in layouts.values()])
    own = {
        path: {s: c for s, c in layout.columns.items() if s not in common}
        for path, layout in layouts.items()
    }
    return texts[first].model_copy(update={"columns": common}), own


def _encoding(path: Path) -> str:
    content = path.read_bytes()
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return likely_encoding(content)
    return UTF_8


def units_below(table: MeasuredTable, names: Sequence[str]) -> list[str]:
    """The units in the line below the names; empty ones where a table has no such line."""
    found: list[str] = []
    text = table.layout
    if text.units_line:
        with table.path.open(encoding=text.encoding) as file:
            cells = table_cells(next(islice(file, text.skip + 1, None)), text.separator)
            found = unmarked(cells, len(names))
    if not any(bare_unit(cell) in KNOWN for cell in found):  # of types, or a ruled line
        found = []
    return [*found, *[""] * len(names)][: len(names)]


def _is_told(stated: Column) -> bool:
    """Whether a column has more than a name: what its numbers mean is then stated."""
    return not {"unit", "factor", "offset"}.isdisjoint(stated.model_fields_set)


def _in_unit_of_name(
    stated: Column, signal: str, below: Mapping[str, str], quantity: Mapping[str, str], path: Path
) -> Column:
    """A column of which only the name is stated, in the unit that stands in that or below it.

    Raises:
        InputError: a unit of a command that is none: numbers do not tell it.
    """
    if _is_told(stated):
        return stated
    bare, unit = without_unit(stated.name, below.get(stated.name, ""))
    if "." in signal and unit not in (*NO_UNIT, "%", *UNITS[quantity[signal]]) and not unit.isdigit():
        refuse_unit(path, signal, stated.name, unit, quantity)
    factors = UNITS.get(quantity.get(signal, ""), {})
    unit = unit or unit_in(bare)
    return stated.model_copy(update={"unit": unit}) if factors.get(unit, 1.0) != 1.0 else stated


def _of_message(
    columns: Mapping[str, Column], fields: Mapping[str, MessageField], kept: Collection[str]
) -> dict[str, Column]:
    """Heading and position by the axes of ROS messages (REP 103): x to east, y to north, z up.

    Only a heading by a quaternion is known to be of such a message.
    """
    psi = columns.get("psi")
    if psi is None or "psi" in kept or psi.name not in fields or not fields[psi.name].is_ros:
        return {}
    turned = {"psi": psi.model_copy(update={"flip": True, "offset": 0.5 * math.pi})}
    known = {"x", "y"} <= columns.keys() - kept
    if known and without_unit(columns["x"].name, "")[0].casefold().endswith("x"):
        turned |= {"x": columns["y"], "y": columns["x"]}
    return turned


def _stamped(table: MeasuredTable, layout: Layout, names: Sequence[str]) -> dict[str, Column]:
    """The only column of date stamps as the time, whatever its name, if no other column is known."""
    if "time" in (*layout.columns, *layout.without_column):
        return {}
    free = table.columns({*names} - names_of(layout.columns))
    stamped = [str(name) for name, cells in free.items() if date_stamps(cells) is not None]
    return {"time": Column(name=stamped[0])} if len(stamped) == 1 else {}


def _geographic(
    table: MeasuredTable, layout: Layout, names: Sequence[str], units: Sequence[str]
) -> dict[str, Column]:
    """Position by columns of latitude and longitude, if no other columns are known.

    Those that are stated by their names alone are read so, too.
    """
    stated = {s: c.name for s in ("x", "y") if (c := layout.columns.get(s)) and not _is_told(c)}
    taken = names_of(layout.columns) - {*stated.values()}
    free = [pair for pair in zip(names, units, strict=False) if pair[0] not in taken]
    pair = geographic_pair({name: bare_name(name, below) for name, below in free}, stated)
    if not pair or any(stated.get(s) != pair[s] for s in layout.columns.keys() & pair):
        return {}
    after = {s: names[k] for s, name in pair.items() if (k := names.index(name) + 1) < len(names)}
    own = table.columns({*pair.values(), *after.values()})
    sides = {s: SIDES[s][1] for s, name in after.items() if is_side(own[name], SIDES[s])}
    numbers = {s: available(s, numbers_of(own[name], s)) for s, name in pair.items()}
    how = {s: {"minutes": True} if are_minutes(**numbers) else {} for s in pair}
    how |= {s: how[s] | {"sign": after[s], "negative": letter} for s, letter in sides.items()}
    read = {s: Column(name=name).model_copy(update=how[s]) for s, name in pair.items()}
    degrees = {s: signed(numbers[s], own, c) for s, c in read.items()}
    degrees["y"] = across_date_line(degrees["y"])
    columns = {s: c.model_copy(update=how[s]) for s, c in local_columns(pair, degrees).items()}
    if not columns:
        refuse_letters(pair, {signal: own[name] for signal, name in pair.items()})
    return columns


def _likely(
    table: MeasuredTable,
    layout: Layout,
    unused: Mapping[str, str],
    blank: Sequence[str],
    quantity: Mapping[str, str],
) -> dict[str, Sequence[LikelyColumn]]:
    """Columns that may be those of signals without one, of unused ones with the units below them."""
    lacking = {*blank, *layout.without_column}
    known = {s: layout.column(s) for s in ("time", *POSE) if s not in lacking}
    signs = {c.sign for c in known.values() if c.sign}
    own = table.columns({*unused, *names_of(known), *signs})
    refuse_thousands(table.path, layout, own)
    numbers = {s: signed(numbers_of(own[c.name], s), own, c) for s, c in known.items()}
    pose = {s: to_si(numbers[s], s, c, quantity[s]) for s, c in known.items()}
    pose |= layout.even_time(len(own))
    kind = "time" if "time" in blank else ""
    reported = {n: without_unit(n, below) for n, below in unused.items()}
    reported = {n: (n, "") if unit.isdigit() else (bare, unit) for n, (bare, unit) in reported.items()}
    named = {n: (*pair, numbers_of(own[n], kind)) for n, pair in reported.items()}
    motion = motion_of(pose)
    return {s: likely_columns(s, quantity[s], named, motion) for s in blank}
