"""Files of one run as one table: a file for each topic, and tables with one value in a row."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import pandas as pd

from cosim import InputError

from .columns.columns import UNITS, Column, Layout, stated_layout, to_si
from .columns.name_words import words_of
from .columns.proposal import text_of, time_column, units_below
from .columns.unit_check import LARGEST
from .columns.usual_names import value_column
from .files.tables import MeasuredTable, clock_seconds, date_stamps, numbers
from .run_constants import NEGLIGIBLE

Item = TypeVar("Item", str, Path)
TIME = "time"  # the column of the time in the one table
UNIT = frozenset(("unit", "units"))  # of that with their units
NUMBER = frozenset(("id", "index", "channel", "instance"))  # of that with numbers in place of names


class _Part(NamedTuple):
    """A file's table without its time, that time as it is written, its column, and where it is from."""

    table: pd.DataFrame
    cells: pd.Series
    time: Column
    path: Path


def one_table(paths: Sequence[Path]) -> pd.DataFrame:
    """The rows of several files of one run, in the order of their time.

    Files with the same columns follow each other, and rows that both have are there once. Others have
    rows of their own, in which the columns of the rest are empty. So have files with the same columns
    at the same time. A column whose name is there already has its file's name before it. A unit that
    stands below a name stands behind it. Of a table with one value in a row each name is a column.

    Returns:
        A table with the column ``time``: seconds, or numbers whose unit no file states.

    Raises:
        InputError: a file is no table or is given twice, two columns of it have one name, none is known
            as its time, or files have no time in common.
    """
    if twice := _first_repeated(map(Path.resolve, paths)):
        raise InputError(f"'{twice}' is given more than once")
    parts = [_part(path) for path in paths]
    times = _times(parts)
    groups: dict[Path, list[pd.DataFrame]] = {}
    for part, time in zip(parts, times, strict=True):
        table = part.table.assign(**{TIME: time})
        for tables in groups.values():
            new = _following(tables, table)
            if new is not None:
                tables.append(new)
                break
        else:
            groups[part.path] = [table]
    tables = {path: pd.concat(group, ignore_index=True) for path, group in groups.items()}
    _refuse_apart({path: table[TIME] for path, table in tables.items()})
    taken: set[str] = set()
    for path, table in tables.items():
        own = {n: f"{path.stem}.{n}" if n in taken else n for n in table if n != TIME}
        taken |= set(own.values())
        tables[path] = table.rename(columns=own)
    table = pd.concat([*tables.values()], ignore_index=True)
    table = table.sort_values(TIME, kind="stable", ignore_index=True)
    return table.filter(items=[TIME, *(name for name in table if name != TIME)])


def _following(tables: Sequence[pd.DataFrame], table: pd.DataFrame) -> pd.DataFrame | None:
    """The rows of a table that others with the same columns lack; None: they are at the same time."""
    if list(tables[0]) != list(table):
        return None
    low, high = table[TIME].min(), table[TIME].max()
    beside = [t for t in tables if t[TIME].max() >= low and high >= t[TIME].min()]
    known = pd.concat([*beside, table], ignore_index=True).duplicated().to_numpy()
    new = table.loc[~known[len(known) - len(table) :]]
    low, high = new[TIME].min(), new[TIME].max()
    return None if any(t[TIME].max() > low and high > t[TIME].min() for t in beside) else new


def _first_repeated(items: Iterable[Item]) -> Item | None:
    """The first of some items that is there more than once."""
    return next((item for item, count in Counter(items).items() if count > 1), None)


def _part(path: Path) -> _Part:
    """A file's table, its time apart."""
    if not path.is_file():
        raise InputError(f"'{path}' is a folder" if path.is_dir() else f"no such file: '{path}'")
    stated = stated_layout(path) or Layout()
    whole = MeasuredTable(path, text_of(path, stated))
    names, fields = whole.names, whole.fields
    if twice := _first_repeated(filter(None, names)):
        raise InputError(f"'{path}' has more than one column '{twice}'; give each a name of its own")
    units = units_below(whole, names)
    found = time_column(whole, stated, names, units)
    if found is None:
        raise InputError(
            f"no column of '{path}' is known as its time; its columns: {', '.join(names)}; state it: "
            f'put {{"columns": {{"time": "NAME"}}}} into \'{path}.json\''
        )
    columns = [name for name in names if name not in fields]
    table = whole.columns({*columns, found.name})
    cells = table[found.name]
    stamp = set(fields[found.name].columns) if found.name in fields else set()
    reported = dict(zip(names, units, strict=True))
    table = table.filter(items=[name for name in columns if name not in {*stamp, found.name}])
    table, cells = _by_names(table, cells)
    table = table.rename(columns={n: f"{n} [{reported[n]}]" for n in table if reported.get(n)})
    return _Part(table, cells, found, path)


def _by_names(table: pd.DataFrame, cells: pd.Series) -> tuple[pd.DataFrame, pd.Series]:
    """A table with one value in a row, as ``time, name, value``, with a column for each name.

    Its values are in a column that is called so; the texts beside them that change make up the name, or
    numbers, as those of thrusters.
    """
    value = value_column(map(str, table))
    units = [name for name in map(str, table) if "".join(words_of(name)) in UNIT]
    changing = [n for n in table if n not in {*units, value} and table[n].nunique() > 1]
    texts = [n for n in changing if not pd.api.types.is_numeric_dtype(table[n])]
    named = {n: table[n].astype("string").fillna("") for n in texts} or {
        n: f"{n} " + table[n].map("{:g}".format)
        for n in changing
        if n.casefold() in NUMBER and 2 * table[n].nunique() < len(table)  # not that of the row
    }
    if value is None or not named:
        return table, cells
    names = pd.DataFrame(named).agg(".".join, axis=1)
    for unit in units:
        there = table[unit].notna()
        names = names.mask(there, names + " [" + table[unit].astype("string").fillna("") + "]")
    # Values of one stamp are in one row, unless a name has several there.
    row = pd.MultiIndex.from_arrays([cells, cells.groupby([cells, names]).cumcount()])
    numbered, stamps = row.factorize()
    wide = pd.DataFrame({"row": numbered, "name": names, "value": table[value]})
    wide = wide.pivot(index="row", columns="name", values="value").reindex(columns=names.unique())
    wide.columns.name = None
    return wide, pd.Series(stamps.get_level_values(0), name=cells.name)


def _times(parts: Sequence[_Part]) -> list[np.ndarray]:
    """The times of each part, by one clock."""
    epoch = datetime.fromtimestamp(0.0, timezone.utc)
    stamps = [date_stamps(part.cells, f"'{part.path}'", epoch) for part in parts]
    times = [_seconds(p) if own is None else own for p, own in zip(parts, stamps, strict=True)]
    dated = [own is not None for own in stamps]
    if not any(dated):
        return times
    if all(np.nanmedian(time) > LARGEST for time in times):  # numbers of an epoch, too
        return [time - times[0][np.isfinite(times[0])][0] for time in times]
    if not all(dated):
        stamped, other = parts[dated.index(True)].path, parts[dated.index(False)].path
        raise InputError(f"'{stamped}' has date stamps, '{other}' numbers: they have no clock in common")
    whole = date_stamps(pd.concat([p.cells for p in parts], ignore_index=True))  # times of day
    assert whole is not None
    return np.split(whole, np.cumsum([len(part.cells) for part in parts])[:-1])


def _seconds(part: _Part) -> np.ndarray:
    """The times of a part that are numbers [s]."""
    return to_si(clock_seconds(numbers(part.cells, part.path, Layout())), TIME, part.time, TIME)


def _refuse_apart(times: Mapping[Path, pd.Series]) -> None:
    """Refuse files whose times are all before or after those of the first one, or in another unit."""
    (first, low, high), *others = ((path, time.min(), time.max()) for path, time in times.items())
    for path, begin, end in others:
        apart = not (begin <= high and low <= end)
        (short, _), (long, longer) = sorted([(high - low, first), (end - begin, path)])
        smaller = {u: size for u, size in UNITS[TIME].items() if size < 1.0}
        units = [u for u, size in smaller.items() if abs(long * size - short) < NEGLIGIBLE * short]
        if apart or units:
            unit, other = (units[0], longer) if units else ("ms", path)
            what = "no time in common" if apart else "times that seem to be in different units"
            raise InputError(
                f"'{first}' and '{path}' have {what}: {low:.10g} to {high:.10g}, "
                f"{begin:.10g} to {end:.10g}; if these are in other units, state them: put "
                f'{{"columns": {{"time": {{"name": "NAME", "unit": "{unit}"}}}}}} into \'{other}.json\''
            )
