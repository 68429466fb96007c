"""The content of the file beside a measurement, proposed by a look at the measurement itself."""

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import chain, islice, takewhile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from cosim import InputError
from fmus.ship import Ship, ship

from ..cleaning import WIDTH, lost
from ..files.matlab_files import fits_matlab
from ..files.message_fields import MessageField, message_fields
from ..files.reading import Run, column_names, read, signed
from ..files.tables import clock_seconds, date_stamps, table_of_file
from ..files.text_layout import bare_unit, table_cells, text_layout
from ..frozen import repeated
from ..row_order import by_stamps, in_order
from .columns import (
    OF_UNIT,
    POSE,
    UNITS,
    UTF_8,
    WITH_UNIT,
    Column,
    Layout,
    log_of,
    missing,
    no_unit,
    other_angles,
    quantities,
    signals,
    stated_layout,
    to_si,
)
from .geographic import (
    SIDES,
    WORDS,
    are_minutes,
    geographic_pair,
    is_side,
    local_columns,
    one_origin,
    refuse_letters,
)
from .likely_columns import (
    ASTERN,
    SIGN,
    LikelyColumn,
    is_of_shaft,
    is_steering,
    likely_columns,
    meaning_of_words,
    motion_of,
    says_command,
    signal_of_sign,
    signal_of_symbol,
    unit_in,
)
from .name_words import words_of
from .side_car import UTF_16, as_json, refuse_sentences, refuse_thousands
from .unit_check import (
    HUNDREDTH,
    OFTENEST,
    SI_UNIT,
    doubts,
    doubts_of_angles,
    in_hundredths,
    largest,
    likely_unit,
    spelt,
)
from .usual_names import is_quaternion, meaning, value_column

NO_UNIT = ("", "-")
# Units that a name may end in; u_1 is the first of several, x_d a desired value.
NAMED_UNITS = frozenset(unit for units in UNITS.values() for unit in units) - {"1", "d"}
# A time that is called so, with its unit at the end: TimeUS, time_boot_ms.
TIME_IN = re.compile(r"(?i)(time|timestamp|stamp|epoch)(?:_?boot)?_?([mun]s(?:ec)?)")
CALLED_AS_UNIT = ("ms", "us", "ns")  # a time may be called so
NORTH = ("true", "magnetic")  # that a heading is from; behind its name it is no unit
# Behind a name in a log of libcosim: value reference, type and causality.
OF_LIBCOSIM = re.compile(r" \[\d+ (real|integer) \w+\]$")
LETTERS = ("R", "T", "U", "V")  # that are no yaw rate, time and velocity without a unit
PATH = re.compile(r"[./]")  # between the parts of a name with a path


class Proposal(NamedTuple):
    """How a measurement seems to be meant.

    Attributes:
        layout: the content of the file next to it, what is stated there kept; names of signals of which
            no column is known are blank.
        unused: names of columns that are no signals, as far as is known.
        run: the measurement, read so; None where a name is blank.
        likely: signal of a blank name -> columns that may be its own, the likeliest first.
    """

    layout: Layout
    unused: Sequence[str]
    run: Run | None
    likely: Mapping[str, Sequence[LikelyColumn]] = {}

    @property
    def needed(self) -> dict[str, Any]:
        """What has to be stated, as JSON holds it; a log of this project needs nothing."""
        if self.layout.column("x") == log_of(()).column("x"):
            return {}
        return as_json(self.layout)


def propose(path: Path, of: Ship | None = None) -> Proposal:
    """Look at a file: its text, its names and units, and at the numbers where units are not told.

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
    names = column_names(path, text)
    fields = message_fields(names)
    log = log_of(of.commands)
    if log.column("x").name in names:
        return Proposal(log, [], read(path, log, of))
    units = units_below(path, text, names)
    parts = {name for field in fields.values() for name in field.columns}
    within = tuple(f"{field}{mark}" for field in fields for mark in "./")  # as the yaw of a quaternion
    whole = [k for k, name in enumerate(names) if name not in parts and not name.startswith(within)]
    names, units = [names[k] for k in whole], [units[k] for k in whole]
    below = dict(zip(names, units, strict=False))
    named = {s: c for s, c in stated.columns.items() if c.name.strip()}
    kept = {s: _in_unit_of_name(c, s, below, quantity) for s, c in named.items()}
    columns = _columns(path, text, names, units, quantity, kept, fields)
    columns |= _of_message(columns, fields, kept)
    columns |= _stamped(path, text.model_copy(update={"columns": columns}), names)
    columns |= _geographic(path, text.model_copy(update={"columns": columns}), names, units)
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
        return _with_blanks(path, layout, kept, left, blank, quantity)
    try:
        signals(layout, names, f"'{path}'", of)
    except InputError as error:
        more = f"; columns that are not known signals: {', '.join(unused)}" if unused else ""
        raise InputError(f"{error}{more}") from None
    columns |= _units_of_commands(path, layout, names, of)
    columns |= _signed(path, layout.model_copy(update={"columns": columns}), unused, quantity)
    unused = [name for name in unused if name not in {c.sign for c in columns.values()}]
    run = read(path, layout.model_copy(update={"columns": columns}), of)
    for signal, unit, factor in _seen_units(run):
        if signal not in kept or not _is_told(kept[signal]):
            columns[signal] = layout.column(signal).model_copy(update={"unit": unit, "factor": factor})
    needed = {s: c for s, c in columns.items() if s in kept or c != Column(name=s)}
    layout = text.model_copy(update={"columns": needed})
    return Proposal(layout, unused, read(path, layout, of))


def text_of(path: Path, stated: Layout) -> Layout:
    """How a table's text is laid out, by a look at it; what is stated beside it stands.

    Raises:
        InputError: no table of numbers below names.
    """
    text = Layout()
    if path.suffix not in (".parquet", ".mat"):
        refuse_sentences(path)
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
    path: Path, text: Layout, stated: Layout, names: Sequence[str], units: Sequence[str]
) -> Column | None:
    """The column of the time of a table, by its name, its unit or its stamps; None: none is known.

    Args:
        path, text, stated: the table, how it is laid out, and what is stated beside it.
        names, units: of its columns.
    """
    kept = {s: c for s, c in stated.columns.items() if s == "time" and c.name.strip()}
    columns = _columns(path, text, names, units, {"time": "time"}, kept)
    columns |= _stamped(path, text.model_copy(update={"columns": columns}), names)
    return columns.get("time")


def _with_blanks(
    path: Path,
    layout: Layout,
    kept: Mapping[str, Column],
    unused: Mapping[str, str],
    blank: Sequence[str],
    quantity: Mapping[str, str],
) -> Proposal:
    """The proposal where signals have no column, by the unused ones with the units below them."""
    columns = dict(layout.columns)
    time = layout.column("time")
    if "time" not in {*kept, *blank} and not time.unit:
        cells = table_of_file(path, layout, {time.name})[time.name]
        columns["time"] = time.model_copy(update={"unit": _time_unit(_numbers(cells, "time"))})
    needed = {s: c for s, c in columns.items() if s in kept or c != Column(name=s)}
    blanks = layout.model_copy(update={"columns": needed | {s: Column(name="") for s in blank}})
    return Proposal(blanks, [*unused], None, _likely(path, layout, unused, blank, quantity))


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
    if content.startswith(UTF_16):
        return "utf-16"
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return UTF_8


def units_below(path: Path, text: Layout, names: Sequence[str]) -> list[str]:
    """The units in the line below the names; empty ones where a table has no such line."""
    found: list[str] = []
    if text.units_line:
        with path.open(encoding=text.encoding) as file:
            found = table_cells(next(islice(file, text.skip + 1, None)), text.separator)
    return [*found, *[""] * len(names)][: len(names)]


def _columns(
    path: Path,
    text: Layout,
    names: Sequence[str],
    units: Sequence[str],
    quantity: Mapping[str, str],
    kept: Mapping[str, Column],
    fields: Collection[str] = (),
) -> dict[str, Column]:
    """The columns that names and units tell; of two for one signal, that of its own name or the first.

    Those that are stated are kept. A name of which words alone are known counts where it has a unit of
    the signal, and no other column is as likely.
    """
    columns = dict(kept)
    free = [pair for pair in zip(names, units, strict=False) if pair[0] not in _names_of(kept)]
    for name, below in sorted(free, key=lambda pair: pair[0] not in quantity):
        bare, unit = _bare(name, below)
        signal, flip = meaning(bare, quantity)
        if not signal:
            bare, unit = _unit_at_the_end(bare)
            signal, flip = meaning(bare, quantity)
            if unit not in UNITS.get(quantity.get(signal, ""), {}):
                continue
        if signal in columns or _is_beside_speed(bare, names) or _is_letter(bare, unit, names):
            continue
        if is_quaternion(bare) and name not in fields:  # q is the pitch rate as well
            continue
        known = UNITS[quantity[signal]]
        if signal == "time" and unit not in known and _is_stamped(path, text, name):
            unit = ""  # a time zone, or the form of the stamps
        if unit not in known and (unit.isdigit() or (bare != signal and unit in NAMED_UNITS)):
            continue  # an index, or of another quantity: n in rps is no position to the north
        if unit not in NO_UNIT and unit not in known:
            line = json.dumps({"columns": {signal: {"name": name, "factor": 1.0}}}, ensure_ascii=False)
            raise InputError(
                f"'{path}', column '{name}': {no_unit(unit, signal, known)}; "
                f"if it is another one, put {line} with its factor to {SI_UNIT[quantity[signal]]} "
                f"into '{path}.json'"
            )
        is_si = known.get(unit, 1.0) == 1.0
        columns[signal] = Column(name=name, unit=None if is_si else unit, flip=flip)
    found = _by_words([pair for pair in free if pair[0] not in _names_of(columns)], columns, quantity)
    columns |= {s: c for s, c in found.items() if not _is_fraction(path, text, s, c, quantity)}
    return {s: columns[s] for s in (*quantity, *kept) if s in columns}


def _is_fraction(
    path: Path, text: Layout, signal: str, column: Column, quantity: Mapping[str, str]
) -> bool:
    """Whether the column of a shaft is not called a speed, and has fractions of the full command."""
    if quantity[signal] != "shaft speed" or column.unit or says_command(column.name, signal, quantity):
        return False
    values = _numbers(table_of_file(path, text, {column.name})[column.name], "")
    return float(np.nanmax(np.abs(values), initial=0.0)) <= largest("command")


def _is_beside_speed(name: str, names: Sequence[str]) -> bool:
    """Whether a name is ``ax`` beside ``vx``: along the axes of that, which are not known."""
    low, axis = name.casefold(), name[-1:].casefold()
    return low.endswith(("ax", "ay")) and f"{low[:-2]}v{axis}" in {n.casefold() for n in names}


def _is_letter(name: str, unit: str, names: Sequence[str]) -> bool:
    """Whether a name is a letter that more often means another quantity than a signal.

    ``n`` and ``e`` alone, or beside a latitude, are revolutions and an error. Capitals without a unit
    are a voltage (U, V), a temperature (T), a resistance or radius (R).
    """
    if name.casefold() not in ("n", "e"):
        return name in LETTERS and unit in NO_UNIT
    bare = [_without_unit(each, "")[0].casefold() for each in names]
    return not {"n", "e"} <= {*bare} or any(not WORDS["x"].isdisjoint(words_of(each)) for each in bare)


def _is_told(stated: Column) -> bool:
    """Whether a column has more than a name: what its numbers mean is then stated."""
    return not {"unit", "factor", "offset"}.isdisjoint(stated.model_fields_set)


def _in_unit_of_name(
    stated: Column, signal: str, below: Mapping[str, str], quantity: Mapping[str, str]
) -> Column:
    """A column of which only the name is stated, in the unit that stands in that or below it."""
    if _is_told(stated):
        return stated
    bare, unit = _without_unit(stated.name, below.get(stated.name, ""))
    factors = UNITS.get(quantity.get(signal, ""), {})
    unit = unit or unit_in(bare)
    return stated.model_copy(update={"unit": unit}) if factors.get(unit, 1.0) != 1.0 else stated


def _by_words(
    free: Sequence[tuple[str, str]], columns: Mapping[str, Column], quantity: Mapping[str, str]
) -> dict[str, Column]:
    """Signals that words of names and units tell of columns (name, unit below), where one alone does.

    The part of a path that all names with a path have in common, as of a device, tells nothing.
    """
    found: dict[str, list[Column]] = {}
    only: dict[str, list[Column]] = {"shaft speed": [], "angle": []}  # of a ship with one of them
    paths = [parts for name, _ in free if (parts := PATH.split(name)[:-1])]
    common = [p[0] for p in takewhile(lambda p: len({*p}) == 1, zip(*paths, strict=False))]
    for name, below in free:
        bare, unit = _without_unit(name, below)
        unit = unit or unit_in(bare)
        parts = PATH.split(bare)
        own = parts[len(common) :] if parts[: len(common)] == common else parts
        if signal := signal_of_symbol(bare, unit, quantity) or meaning_of_words(
            " ".join(own), unit, quantity
        ):
            is_si = UNITS[quantity[signal]].get(unit, 1.0) == 1.0
            found.setdefault(signal, []).append(Column(name=name, unit=None if is_si else unit))
        elif is_of_shaft(" ".join(own), unit):
            only["shaft speed"].append(Column(name=name, unit=unit))
        elif unit in UNITS["angle"] and is_steering(" ".join(own)):
            only["angle"].append(Column(name=name, unit=unit))
    for kind, told in only.items():
        left = [s for s, q in quantity.items() if q == kind and "." in s and s not in {*columns, *found}]
        if len(left) == len(told) == 1:
            found[left[0]] = told
    # Beside a command its sign may have a column, as rudder_dir beside rudder_deg.
    own = {
        s: [c for c in each if SIGN.isdisjoint(words_of(c.name))] or each for s, each in found.items()
    }
    own |= {f"{s}_2": [each.pop()] for s, each in own.items() if f"{s}_2" in quantity and _are_two(each)}
    return {s: each[0] for s, each in own.items() if len(each) == 1 and s not in columns}


def _are_two(columns: list[Column]) -> bool:
    """Whether columns are those of two sensors, by numbers in their names, and in their order."""
    number = {c.name: [int(w) for w in words_of(c.name) if w.isdigit()] for c in columns}
    columns.sort(key=lambda c: number[c.name])
    return len(columns) == 2 and all(number.values()) and len({*map(str, number.values())}) == 2


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
    if known and _without_unit(columns["x"].name, "")[0].casefold().endswith("x"):
        turned |= {"x": columns["y"], "y": columns["x"]}
    return turned


def _is_stamped(path: Path, text: Layout, name: str) -> bool:
    """Whether a column has date stamps or times of day."""
    return date_stamps(table_of_file(path, text, {name})[name]) is not None


def _stamped(path: Path, layout: Layout, names: Sequence[str]) -> dict[str, Column]:
    """The only column of date stamps as the time, whatever its name, if no other column is known."""
    if "time" in layout.columns:
        return {}
    table = table_of_file(path, layout, {*names} - _names_of(layout.columns))
    stamped = [str(name) for name, cells in table.items() if date_stamps(cells) is not None]
    return {"time": Column(name=stamped[0])} if len(stamped) == 1 else {}


def _geographic(
    path: Path, layout: Layout, names: Sequence[str], units: Sequence[str]
) -> dict[str, Column]:
    """Position by columns of latitude and longitude, if no other columns are known.

    Those that are stated by their names alone are read so, too.
    """
    stated = {s: c.name for s in ("x", "y") if (c := layout.columns.get(s)) and not _is_told(c)}
    taken = _names_of(layout.columns) - {*stated.values()}
    free = [pair for pair in zip(names, units, strict=False) if pair[0] not in taken]
    pair = geographic_pair({name: _bare(name, below) for name, below in free}, stated)
    if not pair or any(stated.get(s) != pair[s] for s in layout.columns.keys() & pair):
        return {}
    after = {s: names[k] for s, name in pair.items() if (k := names.index(name) + 1) < len(names)}
    table = table_of_file(path, layout, {*pair.values(), *after.values()})
    sides = {s: SIDES[s][1] for s, name in after.items() if is_side(table[name], SIDES[s])}
    numbers = {signal: _numbers(table[name], signal) for signal, name in pair.items()}
    how = {s: {"minutes": True} if are_minutes(**numbers) else {} for s in pair}
    how |= {s: how[s] | {"sign": after[s], "negative": letter} for s, letter in sides.items()}
    read = {s: Column(name=name).model_copy(update=how[s]) for s, name in pair.items()}
    degrees = {s: signed(numbers[s], table, c) for s, c in read.items()}
    columns = {s: c.model_copy(update=how[s]) for s, c in local_columns(pair, degrees).items()}
    if not columns:
        refuse_letters(pair, {signal: table[name] for signal, name in pair.items()})
    return columns


def _units_of_commands(path: Path, layout: Layout, names: Sequence[str], of: Ship) -> dict[str, Column]:
    """Commands without a unit that are far beyond the ship's limits, in the only unit within them.

    Those of one quantity have one unit. Far is half of the way, in logarithms, to the nearest unit.
    """
    found: dict[str, Column] = {}
    for form, commands in zip(of.command_forms, of.layouts, strict=True):
        limits = np.abs(commands.limits(of.nominal_drive.params)).max(axis=1)
        limits[np.array(commands.round or [False] * limits.size)] = math.tau
        for si in dict.fromkeys(form.values()):
            own = {s: x for (s, unit), x in zip(form.items(), limits, strict=True) if unit == si}
            own = {s: limit for s, limit in own.items() if layout.column(s).name in names}
            columns = {s: layout.column(s) for s in own}
            if own and not any(column.unit or column.factor != 1.0 for column in columns.values()):
                table = table_of_file(path, layout, _names_of(columns))
                most = {
                    s: float(np.nanmax(np.abs(_numbers(table[column.name], "")), initial=0.0))
                    for s, column in columns.items()
                }
                unit = _unit_within(most, own, OF_UNIT[si])
                found |= {s: c.model_copy(update={"unit": unit}) for s, c in columns.items() if unit}
    return found


def _unit_within(most: Mapping[str, float], limits: Mapping[str, float], quantity: str) -> str | None:
    """The only unit in which commands of a quantity are within limits; None: SI, or it is not known."""
    smaller = {size: unit for unit, size in reversed(UNITS[quantity].items()) if size < 1.0}
    if not smaller:
        return None
    share = max((most[s] / limits[s] for s in most if limits[s] > 0.0), default=0.0)
    within = [unit for size, unit in smaller.items() if size * share <= largest("command")]
    far = share > max(smaller) ** -0.5 or max(most.values()) > largest(quantity)
    return within[0] if far and len(within) == 1 else None


def _signed(
    path: Path, layout: Layout, unused: Sequence[str], quantity: Mapping[str, str]
) -> dict[str, Column]:
    """Commands whose sign is in a column of its own, as astern of a shaft, or port of a rudder."""
    own = {s: c for s, c in layout.columns.items() if "." in s and not c.sign}
    named = {n: signal_of_sign(n, {s: quantity[s] for s in own}) for n in unused}
    found: dict[str, Column] = {}
    for name, signal in named.items():
        if not signal:
            continue
        table = table_of_file(path, layout, {name, own[signal].name})
        cells = table[name].dropna().astype("string").str.strip().unique().tolist()
        negative = [cell for cell in cells if _is_negative(cell, quantity[signal])]
        values = _numbers(table[own[signal].name], "")
        if len(cells) <= 3 and len(negative) == 1 and np.nanmin(values, initial=0.0) >= 0.0:
            found[signal] = own[signal].model_copy(update={"sign": name, "negative": negative[0]})
    return found


def _is_negative(cell: str, quantity: str) -> bool:
    """Whether the cell of a sign is that of negative values: astern, or of an angle to port."""
    if quantity == "angle":
        return words_of(cell) == ["port"] or cell.casefold() in ("p", "l", "-", "-1", "-1.0")
    return cell.casefold() in ASTERN


def _names_of(columns: Mapping[str, Column]) -> set[str]:
    return {column.name for column in columns.values()}


def _bare(name: str, below: str) -> tuple[str, str]:
    """A column's name without its unit, and the unit, which may stand below it."""
    name = OF_LIBCOSIM.sub("", name)
    told = WITH_UNIT.fullmatch(name)
    if told and told[2].casefold() in NORTH:
        return told[1], bare_unit(below)
    return (told[1], spelt(told[2])) if told else (name, bare_unit(below))


def _without_unit(name: str, below: str) -> tuple[str, str]:
    """The same, where the unit may be the end of the name, too."""
    bare, unit = _bare(name, below)
    return (bare, unit) if unit else _unit_at_the_end(bare)


def _unit_at_the_end(name: str) -> tuple[str, str]:
    """A name without the unit that its end is, as x_mm, yaw_rate_deg_s, x/mm, x in mm, TimeUS."""
    if stamped := TIME_IN.fullmatch(name):
        return stamped[1], spelt(stamped[2].lower())
    if (unit := spelt(name.lower())) in CALLED_AS_UNIT:
        return "time", unit
    for mark in (" in ", ", ", "/"):  # tables of DIN 461, and ISO 80000-1, 7.1.2
        quantity, _, unit = name.partition(mark)
        if quantity and spelt(unit) in NAMED_UNITS:
            return quantity, spelt(unit)
    words = name.split("_")
    if (inner := re.fullmatch(r"(\w*[a-z\d])([A-Z][a-z]+)", name)) and "_" not in name:  # headingDeg
        words = [*inner.groups()]
    for count in (2, 1):
        unit = spelt("/".join(words[-count:]))
        if len(words) > count and unit in NAMED_UNITS:
            return "_".join(words[:-count]), unit
    return name, ""


def _likely(
    path: Path,
    layout: Layout,
    unused: Mapping[str, str],
    blank: Sequence[str],
    quantity: Mapping[str, str],
) -> dict[str, Sequence[LikelyColumn]]:
    """Columns that may be those of signals without one, of unused ones with the units below them."""
    known = {s: layout.column(s) for s in ("time", *POSE) if s not in blank}
    signs = {c.sign for c in known.values() if c.sign}
    table = table_of_file(path, layout, {*unused, *_names_of(known), *signs})
    refuse_thousands(path, layout, table)
    numbers = {s: signed(_numbers(table[c.name], s), table, c) for s, c in known.items()}
    pose = {s: to_si(numbers[s], s, c, quantity[s]) for s, c in known.items()}
    kind = "time" if "time" in blank else ""
    told = {n: _without_unit(n, below) for n, below in unused.items()}
    told = {n: (n, "") if unit.isdigit() else (bare, unit) for n, (bare, unit) in told.items()}
    named = {n: (*pair, _numbers(table[n], kind)) for n, pair in told.items()}
    motion = motion_of(pose)
    return {s: likely_columns(s, quantity[s], named, motion) for s in blank}


def _numbers(cells: pd.Series, signal: str) -> np.ndarray:
    """A column as floats, NaN where it is none; date stamps as seconds."""
    stamps = date_stamps(cells) if signal == "time" else None
    if stamps is not None:
        return stamps
    found = np.asarray(pd.to_numeric(cells, errors="coerce"), float)
    return clock_seconds(found) if signal == "time" else found


def _seen_units(run: Run) -> Iterable[tuple[str, str, float]]:
    """Signals that seem to be in another unit: which, in which, and by which factor to that."""
    if not np.isfinite(run.time).any():
        return
    unit = _time_unit(run.time)
    if unit:
        yield "time", unit, 1.0
    run = by_stamps(run)
    run = run.rows(in_order(run.time))
    there = ~lost(run.pose)
    zeros = (run.pose == 0.0).all(axis=1)
    fresh = ~zeros & ~repeated(run.pose, there)
    time = UNITS["time"][unit or "s"] * run.time[fresh]
    angles = doubts_of_angles(other_angles(run.measured))
    for doubt in chain(doubts(time, run.pose[fresh]), angles):
        factor = HUNDREDTH if doubt.signals == ("psi",) and in_hundredths(run.pose[fresh]) else 1.0
        yield from ((signal, doubt.unit, factor) for signal in doubt.signals)


def _time_unit(time: np.ndarray) -> str | None:
    """The unit that times (n,) seem to be in; None: seconds."""
    time = np.unique(time[np.isfinite(time)])
    apart = float(np.median(np.diff(time))) if time.size > 1 else 1.0
    return likely_unit(apart) if not OFTENEST < apart < WIDTH else None
