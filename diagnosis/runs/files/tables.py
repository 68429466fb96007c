"""CSV and Parquet files as tables, read as the JSON file beside them says, and cells as numbers."""

import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from dateutil.parser import parse
from scipy.constants import day, minute, nano

from cosim import InputError
from cybership.message_text import quoted

from ..columns.columns import Layout
from ..columns.geographic import degrees_in, is_of_position, unwrapped
from ..columns.name_words import words_of
from ..columns.side_car import (
    refuse_encoding,
    refuse_layout,
    refuse_long_rows,
    refuse_other_kinds,
    refuse_units,
    what_to_do,
)
from ..run_constants import CHANCE, DIGITS, NEGLIGIBLE
from .matlab_files import matlab_table
from .message_fields import MessageField, message_fields
from .text_layout import STAMP, is_marked, plain_number

# What pandas makes of Ctrl-C while it reads from memory, where nothing else can fail.
READ_INTERRUPTED = "Calling read(nbytes) on source failed"
LEAP_SECOND = re.compile(r"(?<=:59):60(?!\d)")
DURATION = re.compile(r"[\d.]+ (sec|min|hr|days?( [\d:.]+)?)")  # as MATLAB and pandas write it
WORDS = re.compile(r"\D*|[+-]?1\.#\w+|.*\0.*")  # of a cell without a value, as 1.#INF of C
# A number with its direction before or behind it.
DIRECTED = re.compile(r"^(?P<before>[^\W\d_]+)?\s*(?P<size>\d+(?:\.\d+)?)\s*(?P<behind>[^\W\d_]+)?$")
# 1, signs of the words of a direction.
WAYS = {"port": -1.0, "p": -1.0, "astern": -1.0, "starboard": 1.0, "s": 1.0, "ahead": 1.0, "": 1.0}
STILL = ("midship", "midships", "amidships", "stop")
REMARK = re.compile(r"(#|%|//|\(|[^\W\d_]{2}).*")  # such as "Total rows: 1800"
ELAPSED = re.compile(r"(?P<min>\d+):(?P<s>[0-5]?\d[.,]\d+)")  # minutes and seconds
ZONE = re.compile(r"\b[A-Z]{1,5}\b")  # its letters, such as UTC, Z or CEST
DOTTED = re.compile(r"(?<=\s)(\d{1,2})\.(\d\d)\.(\d\d)\b")  # a time of day behind a date, as in Finland
# What Chinese and Japanese write behind the numbers of a date and a time.
IDEOGRAPHS = str.maketrans(
    {"年": "-", "月": "-", "日": " ", "时": ":", "時": ":", "分": ":", "秒": None}
)
TICKS = 1e17, 1e18  # 1, counts of 100 ns since the year 1601 or 1; of 1 ns since 1970 there are more
ORDINAL = re.compile(r"\d{4}-\d{3}")  # a year and a day in it, as of ISO 8601


@contextmanager
def as_table(path: Path) -> Iterator[None]:
    """Where a file is read as a table.

    Raises:
        InputError: in one line, in place of what the readers raise.
    """
    try:
        yield
    except ImportError:
        raise InputError("reading Parquet needs pyarrow: pip install 'cybership[tables]'") from None
    except InputError:
        raise
    except pd.errors.EmptyDataError:
        raise InputError(f"'{path}' is empty") from None
    except Exception as error:  # a broken file makes the readers stumble in many ways
        text = " ".join(str(error).split())
        raise InputError(f"'{path}' cannot be read as a table: {text}") from None


class MeasuredTable:
    """A file with named columns, which are read when they are asked for, each once.

    Args:
        path: a CSV, Parquet or MATLAB file.
        layout: how it is laid out, and how the column of the time is called.

    Raises:
        InputError: when it is read: the text is in another encoding, begins with other lines, has a line
            of units that was not stated, or a row with more cells than names.
        OSError, ValueError: it cannot be read.
        KeyboardInterrupt: the user has asked for the end.
    """

    def __init__(self, path: Path, layout: Layout) -> None:
        self.path, self.layout = path, layout
        self._read: dict[str, pd.Series] = {}

    @cached_property
    def own_names(self) -> list[str]:
        """The names of the columns as they stand there, one that is there twice included."""
        return _names(self.path, self.layout)

    @cached_property
    def fields(self) -> Mapping[str, MessageField]:
        """Fields of messages that some of the columns make up, by their names."""
        return message_fields(self.own_names)

    @cached_property
    def names(self) -> list[str]:
        """The names of the columns and of such fields."""
        return [*self.own_names, *(name for name in self.fields if name not in self.own_names)]

    def columns(self, wanted: Collection[str]) -> pd.DataFrame:
        """The columns and fields of some names, those of them that there are."""
        made = {n: field for n, field in self.fields.items() if n in wanted and n not in self.own_names}
        own = {*wanted}.difference(made).union(*(field.columns for field in made.values()))
        if left := own.difference(self._read):
            found = self._columns(left)
            self._read |= {str(name): cells for name, cells in found.items()}
        there = [name for name in dict.fromkeys(self.own_names) if name in own and name in self._read]
        table = pd.DataFrame({name: self._read[name] for name in there})
        values = {
            name: field.value(*(pd.to_numeric(table[c], errors="coerce") for c in field.columns))
            for name, field in made.items()
        }
        return table.assign(**values)

    def _columns(self, wanted: Collection[str]) -> pd.DataFrame:
        path, layout = self.path, self.layout
        if path.suffix == ".parquet":
            with as_table(path):
                table = pd.read_parquet(path, columns=list(wanted))
            index = [name for name in table.index.names if name in wanted]
            return table.reset_index(index) if index else table
        if path.suffix == ".mat":
            return matlab_table(path).filter(items=[*wanted])
        table = csv_table(path, layout, wanted)
        refuse_units(path, layout, table)
        if not self._read:
            refuse_long_rows(path, layout, len(self.own_names))
        return table


def _names(path: Path, layout: Layout) -> list[str]:
    """The names of the columns of a file, one that is there twice included."""
    if path.suffix == ".parquet":
        with as_table(path):
            from pyarrow import parquet

            return list(parquet.read_schema(path).names)
    if path.suffix == ".mat":
        return list(matlab_table(path))
    refuse_other_kinds(path)
    as_text = {"dtype": str, "keep_default_na": False, "skipinitialspace": True}
    first = _csv(path, layout, nrows=1, header=None, **as_text)
    # A column without a name is called as pandas calls it.
    names = [name.strip() or f"Unnamed: {k}" for k, name in enumerate(first.iloc[0])]
    names = names[is_marked(path, layout) :]
    refuse_layout(path, layout, names)
    return names


def csv_table(path: Path, layout: Layout, wanted: Collection[str]) -> pd.DataFrame:
    """The columns of some names of a CSV file, those of them that there are."""
    named: dict[str, Any] = {}
    if is_marked(path, layout):
        named = {"header": None, "names": _names(path, layout)}
    return _csv(
        path,
        layout,
        usecols=lambda name: str(name).strip() in wanted,
        decimal=layout.decimal,
        skipinitialspace=True,
        **named,
    ).rename(columns=str.strip)


def _csv(path: Path, layout: Layout, **options: Any) -> pd.DataFrame:
    units = [layout.skip + 1] if layout.units_line else []
    begin = layout.skip + ("names" in options)
    if pd.__version__.startswith("2."):  # from 3 on it reads the nearest number anyway
        options["float_precision"] = "round_trip"
    try:
        with open(path, "rb") as content:  # a long log does not fit into memory twice
            return pd.read_csv(
                content,
                sep=layout.separator,
                encoding=layout.encoding,
                skiprows=[*range(begin), *units],
                index_col=False,
                **options,
            )
    except ValueError as error:  # of the encoding, of the cells, or of names that are there twice
        if isinstance(error, UnicodeDecodeError):
            refuse_encoding(path, layout)
        if READ_INTERRUPTED in str(error):
            raise KeyboardInterrupt from error
        with as_table(path):
            raise


def date_stamps(
    cells: pd.Series, where: str | None = None, since: datetime | None = None
) -> np.ndarray | None:
    """Seconds since a time of a column of date stamps, NaN where empty; None: numbers.

    Stamps are of ISO 8601, or have a date such as 31.12.2026, 12/31/2026 or Dec 31, 2026, or none: then
    a day begins where the time falls by more than half a day. A leap second of UTC is a second.
    Durations, such as 0.1 sec and 1:23.4 (minutes and seconds), are stamps as well.

    Args:
        cells: the column.
        where: what messages call the file; None: a cell that is not a stamp is NaN.
        since: the time; None: the first one.

    Raises:
        InputError: a cell is not a stamp.
    """
    leap, without_date = np.zeros(len(cells), bool), False
    if not pd.api.types.is_datetime64_any_dtype(cells):
        try:
            if not np.isnan(np.asarray(pd.to_numeric(cells, errors="coerce"), float)).all():
                return None
        except (TypeError, ValueError, OverflowError):  # lists and the like in a Parquet file
            return None
        cells = cells.astype("string").str.strip("[] ").str.replace("_", "T")
        leap = np.asarray(cells.str.contains(LEAP_SECOND).fillna(False), bool)
        given = cells.mask(leap, cells.str.replace(LEAP_SECOND, ":59", regex=True))
        iso = given.str.replace(",", ".")
        stamps = pd.to_datetime(iso, errors="coerce", utc=True, format="ISO8601")
        if stamps.isna().all() and given.dropna().str.fullmatch(DURATION).all():
            stamps = pd.Timestamp(0, tz="UTC") + pd.to_timedelta(given, errors="coerce")
        if stamps.isna().all() and given.dropna().str.fullmatch(ELAPSED).all():
            parts = iso.str.extract(ELAPSED).astype(float)
            stamps = pd.to_datetime(60.0 * parts["min"] + parts["s"], unit="s", utc=True)
        if stamps.isna().all():
            stamps, without_date = _other_stamps(given)
    else:
        stamps = pd.to_datetime(cells, errors="coerce", utc=True)
    if stamps.isna().all():
        return None
    first = _first(cells, stamps.isna())
    if first is not None and where is not None:
        wrong, row = first
        raise InputError(
            f"{where}: {cells.name} = {quoted(wrong)} in row {row} is not a time stamp of ISO 8601"
        )
    begin = stamps.dropna().iloc[0] if since is None else since
    seconds = np.array((stamps - begin).dt.total_seconds(), float)
    if without_date:
        seconds = unwrapped(seconds, day)
    ends = pd.DatetimeIndex(stamps[leap]).floor("s").unique() + pd.Timedelta(seconds=1)
    return seconds + leap + sum(np.asarray(stamps >= end, float) for end in ends)


def _other_stamps(cells: pd.Series) -> tuple[pd.Series, bool]:
    """Times of stamps in other forms than ISO 8601, and whether none has a date.

    Of a date whose day may be its month, the log takes the shorter time.
    """
    written = cells.astype(object).str.translate(IDEOGRAPHS).str.replace(DOTTED, r"\1:\2:\3", regex=True)
    parts = written.str.extract(STAMP)
    rest = parts["rest"]
    if rest.str.findall(ZONE).str.join(" ").nunique() <= 1:  # of one zone none need be known
        rest = rest.str.replace(ZONE, "", regex=True)
    dates = parts["date"].str.replace(":", "-").str.cat(rest, sep=" ").str.strip(" ,")
    half = parts["half"].str.lower().str[0]
    hours = parts["h"].astype(float)
    hours = hours.mask(half.notna(), hours % 12.0 + 12.0 * (half == "p"))
    seconds = parts["s"].str.replace("[,:]", ".", regex=True).astype(float).fillna(0.0)
    clock = pd.to_timedelta(3600.0 * hours + 60.0 * parts["min"].astype(float) + seconds, unit="s")
    found = []
    for day_first in (True, False):
        days = {text: _day(text, day_first) for text in dates.dropna().unique()}
        stamps = pd.to_datetime(dates.map(days), utc=True) + clock
        found.append((int(stamps.isna().sum()), stamps.max() - stamps.min(), stamps))
    return min(found, key=lambda f: f[:2])[2], bool((dates.dropna() == "").all())


def _day(text: str, day_first: bool) -> datetime | None:
    """A date in any form; None: it is none."""
    any_day = datetime.min.replace(year=1970)  # of times without a date
    try:
        if ORDINAL.fullmatch(text):
            return datetime.strptime(text, "%Y-%j")
        day = parse(text, dayfirst=day_first, default=any_day) if text else any_day
        return day if day.year >= any_day.year else None
    except (ValueError, OverflowError):
        return None


def has_words(cells: pd.Series) -> np.ndarray:
    """(n,), the cells of a column that are words: without a digit, a remark, or its name again.

    Remarks are few; many cells such as "Stbd 20.0" are none.
    """
    if pd.api.types.is_numeric_dtype(cells) or pd.api.types.is_datetime64_any_dtype(cells):
        return np.zeros(len(cells), bool)
    texts = cells.astype("string").str.strip().fillna("0")
    found = np.asarray(texts.str.fullmatch(WORDS), bool) | np.asarray(texts == str(cells.name), bool)
    remarks = np.asarray(texts.str.fullmatch(REMARK), bool) & ~found
    return found | (remarks & (remarks.sum() <= NEGLIGIBLE * remarks.size))


def numbers(cells: pd.Series, path: Path, layout: Layout) -> np.ndarray:
    """A column as floats; empty cells and those with words, see :func:`has_words`, are NaN.

    Raises:
        InputError: another cell is not a number, or none is.
    """
    marked = layout.decimal != "." and not pd.api.types.is_numeric_dtype(cells)  # beside words
    values = cells.astype("string").str.replace(layout.decimal, ".") if marked else cells
    try:
        found = cell_numbers(values)
    except (TypeError, ValueError, OverflowError):  # lists, times and the like in a Parquet file
        raise InputError(f"'{path}': {cells.name} is not a column of numbers") from None
    missing = np.isnan(found)
    first = _first(cells, missing, words=bool(missing.all()))
    if first is not None:
        wrong, row = first
        hint = what_to_do(path, layout, wrong)
        if cells.name == layout.column("time").name:
            hint = hint or " or a time stamp of ISO 8601, such as 2026-12-31T23:59:59.5Z"
        raise InputError(f"'{path}': {cells.name} = {quoted(wrong)} in row {row} is not a number{hint}")
    return found


def cell_numbers(cells: pd.Series) -> np.ndarray:
    """Cells (n,) as floats; NaN where one is none.

    Beside other spellings of numbers, positions may be angles with the letter of a side, and numbers may
    have a direction: 20.0 P, Stbd 20.0, MIDSHIP, Astern 90.
    """
    if pd.api.types.is_numeric_dtype(cells):
        return np.asarray(cells, float)
    plain = cells.map(lambda cell: plain_number(cell) if isinstance(cell, str) else cell)
    found = np.asarray(pd.to_numeric(plain, errors="coerce"), float)
    if np.isnan(found).any():
        whole = degrees_in(cells) if is_of_position(str(cells.name)) else directed(cells)
        found = np.where(np.isnan(whole).all(), found, whole)
    return found


def directed(cells: pd.Series) -> np.ndarray:
    """Numbers (n,) with a direction beside them, to port and astern negative; NaN if they have none."""
    texts = cells.astype("string").str.strip().str.casefold().fillna("")
    parts = texts.str.extract(DIRECTED)
    way = parts["before"].fillna("") + parts["behind"].fillna("")
    ways = {word: WAYS.get("".join(words_of(word)), np.nan) for word in way.unique()}
    known = way.map(ways).to_numpy(float)
    size = parts["size"].astype(float).to_numpy()
    found = np.where(size == 0.0, 0.0, known * size)
    words = texts[parts["size"].isna()].unique()
    found = np.where(texts.isin([t for t in words if "".join(words_of(t)) in STILL]), 0.0, found)
    lost = np.isnan(found) & np.asarray(texts != "")
    has_none = lost.any() or not (np.isfinite(known) & np.asarray(way != "")).any()
    return np.full(len(cells), np.nan) if has_none else found


def clock_seconds(time: np.ndarray) -> np.ndarray:
    """Times (n,) as seconds, if they are numbers hhmmss.ss, as of NMEA 0183, of more than a minute.

    In such numbers neither the last two digits before the point nor the two before these exceed 59. They
    may follow a date, and thousandths or hundredths without a point: 20210601085807250. Numbers of 18
    digits are counts of 100 ns, as of .NET and Windows.
    """
    finite = time[np.isfinite(time)]
    if finite.size and TICKS[0] < finite.min() and finite.max() < TICKS[1]:
        return 100.0 * nano * time
    return next(
        (found for parts in (1.0, 1e3, 1e2) if (found := _of_clock(time / parts)) is not None), time
    )


def _of_clock(time: np.ndarray) -> np.ndarray | None:
    """Seconds of times (n,) that are numbers hhmmss.ss of more than a minute; None: these are none."""
    dates, there = np.divmod(time[np.isfinite(time)], 1e6)
    hours, minutes, seconds = there // 1e4, there // 1e2 % 100.0, there % 100.0
    months, days = dates // 1e2 % 100.0, dates % 100.0
    is_date = (dates == 0.0) | ((months >= 1.0) & (months <= 12.0) & (days >= 1.0) & (days <= 31.0))
    is_clock = is_date & (hours < 24.0) & (minutes < minute) & (seconds < minute)
    if not (there.size and is_clock.all() and np.ptp(minutes) > 0.0):
        return None
    if seconds.min() > 0.1 * minute or seconds.max() < 0.9 * minute:  # these do not end a minute
        return None
    found = np.full_like(time, np.nan)
    found[np.isfinite(time)] = np.unwrap(3600.0 * hours + 60.0 * minutes + seconds, period=day)
    return found


def is_cell(cells: pd.Series, text: str) -> np.ndarray:
    """(n,), rows whose cell is a text or the number that it is."""
    same = np.asarray((cells.astype("string").str.strip() == text).fillna(False), bool)
    try:
        number = float(text)
    except ValueError:
        return same
    return same | np.asarray(pd.to_numeric(cells, errors="coerce") == number)


def _first(cells: pd.Series, unreadable: Any, words: bool = False) -> tuple[str, int] | None:
    """The first cell that is not empty and could not be read, and its row below the names, from 1.

    Those with words do not count, unless ``words``.
    """
    left = np.asarray(unreadable) & np.asarray(cells.notna())
    wrong = cells.loc[left & ~has_words(cells) if left.any() and not words else left]
    return (str(wrong.iloc[0]), int(wrong.index[0]) + 1) if wrong.size else None


def resolution(values: np.ndarray) -> np.ndarray:
    """The step to which each of some numbers (n,) is rounded; zero where they are not."""
    counted = np.isfinite(values) & (values != 0.0)
    size = np.abs(values[counted])
    if not size.size:
        return np.zeros_like(values)
    power = np.floor(np.log10(size * (1.0 + DIGITS)))  # of ten, of the first digit
    for digits in range(1, np.finfo(float).precision + 1):
        for first in (np.full_like(power, power.max()), power):  # decimals, significant digits
            step = 10.0 ** (first - digits + 1.0)
            off = np.abs(size - step * np.round(size / step))
            if np.mean(off <= DIGITS * step + np.spacing(size)) >= 1.0 - CHANCE:
                found = np.full_like(values, step.min())
                found[counted] = step
                return found
    return np.zeros_like(values)
