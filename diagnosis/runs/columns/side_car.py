"""The line for the file beside a measurement, where it seems to be read otherwise than meant."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from cosim import InputError
from cybership.message_text import quoted

from ..files.text_layout import likely_encoding, table_cells, text_layout
from .columns import QUANTITY, UNITS, UTF_8, Column, Layout, Named, stated_layout

DECIMAL_COMMA = re.compile(r"[+-]?\d+,\d+")
THOUSANDS = {  # decimal mark -> numbers with separators of thousands, as 19,800.5
    ".": re.compile(r"[+-]?\d{1,3}(?:[, '’\u00a0\u202f]\d{3})+(?:\.\d*)?"),
    ",": re.compile(r"[+-]?\d{1,3}(?:[. '’\u00a0\u202f]\d{3})+(?:,\d*)?"),
}
# How files that are no tables begin -> what they are and what to do.
NO_TABLE = {
    rb"PK\x03\x04": "is an archive, as a spreadsheet is; save its table as a CSV file",
    rb"\x1f\x8b|BZh|\xfd7zXZ|\x28\xb5\x2f\xfd": "is compressed; unpack it",
    # A stamp or names of columns may be before a sentence.
    rb"\s*[$!][A-Z]{2,}\w*,|(?s:.*)[\s,;\"'][$!][A-Z]{4}\w,": (
        "has NMEA 0183 sentences; a measurement is a table: write a CSV file with a row for each time "
        "and the columns time, latitude, longitude, heading and commands"
    ),
    rb"FMT, ": (
        "has messages of several kinds (a DataFlash log); write a CSV file of each (mavlogdump.py "
        "--format csv), and put them together by 'cybership join'"
    ),
    rb"#ROSBAG|\x89MCAP|ULog": (
        "has messages of several kinds (a recording of ROS or PX4); write a CSV file of each topic, and "
        "put them together by 'cybership join'"
    ),
    rb"\s*[{[]\s*[{\"]": "is JSON; write its table as a CSV file",
    # Of a text in UTF-8, Latin-1 or another 8-bit encoding no character is 0.
    rb"(?!\xff\xfe|\xfe\xff)(?s:.)*\x00": (
        "is not a text; write its table as a CSV, Parquet or MATLAB file (.csv, .parquet, .mat)"
    ),
}


def line_beside(
    path: Path | None,
    read_as: Layout,
    changes: Mapping[str, Named],
    name: str | None = None,
) -> str:
    """What to put into the file beside a measurement so that columns are read otherwise.

    Args:
        path: of the measurement; None if it is in no file.
        read_as: how it was read, by that file, by units in its names, or by a proposal.
        changes: signal -> the signal whose column it should have, with a factor of its unit (negative
            where its axis points the other way) and what is added then [SI].
        name: of the column; None: as it is.

    Returns:
        The end of a sentence; empty where there is no such file, as beside a log.
    """
    published = path is not None and path.suffix == ".mat" and read_as == Layout()  # those of NTNU
    if path is None or path.is_dir() or published or not changes:
        return ""
    # What that file does not state yet has to be there, too: with it names tell no units.
    stated = stated_layout(path) == read_as
    text = Layout() if stated else read_as
    columns = {} if stated else as_json(read_as).get("columns", {})
    for signal, change in changes.items():
        column, offset = read_as.column(change.name), change.offset
        sign, factor = math.copysign(1.0, change.factor), abs(change.factor)
        late = change.late if isinstance(change, Column) else 0.0
        units = UNITS.get(QUANTITY.get(signal, ""), {})  # of an actuator's own command none is known
        wanted = factor * units.get(column.unit or "", 1.0)
        unit = next((u for u, size in units.items() if math.isclose(size, wanted)), None)
        changed = {"name": name or column.name, "flip": column.flip != (sign < 0.0)}
        changed |= {"unit": unit, "offset": sign * column.offset}
        changed["late"] = float(f"{column.late + late:.4g}")
        if unit is None:
            changed |= {"unit": column.unit, "factor": float(f"{column.factor * factor:.4g}")}
        if offset:
            said = changed["unit"] or ""
            size = next((sizes[said] for sizes in UNITS.values() if said in sizes), 1.0)
            changed["offset"] += float(f"{offset / size:.4g}")
        columns[signal] = Column.model_validate(column.model_dump() | changed).model_dump(
            exclude_defaults=True
        )
        if units.get(columns[signal].get("unit", "")) == 1.0:  # SI need not be said
            del columns[signal]["unit"]
    return f"; {_changed(path, text, columns=columns)}"


def as_json(layout: Layout) -> dict[str, Any]:
    """The content of the file beside a measurement, without what need not be said."""
    stated = layout.model_dump(exclude_defaults=True)
    for signal, column in stated.get("columns", {}).items():
        stated["columns"][signal] = column["name"] if column.keys() == {"name"} else column
    return stated


def _changed(path: Path, layout: Layout, **changes: Any) -> str:
    """What to put into the file beside a measurement, with what it says now."""
    content = layout.model_dump(exclude_defaults=True) | changes
    return f"put {json.dumps(content, ensure_ascii=False)} into '{path}.json'"


def refuse_encoding(path: Path, layout: Layout) -> None:
    """Refuse a CSV file whose text is not UTF-8, with the line that states the encoding it may have."""
    content = path.read_bytes()
    if layout.encoding != UTF_8:
        return
    encoding = likely_encoding(content)
    line = _changed(path, layout, encoding=encoding)
    raise InputError(f"'{path}' is not a text in UTF-8, but probably in {encoding}; {line}")


def refuse_other_kinds(path: Path) -> None:
    """Refuse files that are no tables, such as NMEA 0183 sentences, spreadsheets and recordings."""
    with path.open("rb") as content:
        begin = content.read(1000)
    for beginning, what in NO_TABLE.items():
        if re.match(beginning, begin):
            raise InputError(f"'{path}' {what}")


def refuse_layout(path: Path, layout: Layout, names: Sequence[str]) -> None:
    """Refuse a CSV file with another separator or line of names than stated, with the line that does."""
    if layout.column("time").name in names:
        return
    found = text_layout(path, layout.encoding)
    if found is None or (found.skip, found.separator) == (layout.skip, layout.separator):
        return
    seen = f"has the names of its columns in line {found.skip + 1}"
    if found.separator != layout.separator:
        seen = f"has cells that are probably separated by {_mark(found.separator)}"
    line = _changed(path, layout, **found.model_dump(exclude_defaults=True))
    raise InputError(f"'{path}' {seen}; {line}")


def _mark(separator: str) -> str:
    """What separates cells, as a message says it."""
    return "blanks" if separator == " " else repr(separator)


def refuse_units(path: Path, layout: Layout, table: pd.DataFrame) -> None:
    """Refuse a CSV file with a line of units below the names, unless that was stated."""
    if layout.units_line:
        return
    cells = table.drop(columns=layout.column("time").name, errors="ignore").head(2).astype("string")
    numbers = cells.apply(lambda column: pd.to_numeric(column.str.replace(",", "."), errors="coerce"))
    if cells.empty or cells.isna().any(axis=None) or list(numbers.notna().all(axis=1)) != [False, True]:
        return
    if numbers.iloc[0].isna().all():
        stated = quoted(", ".join(cells.iloc[0]))
        raise InputError(
            f"'{path}' has a line of units below the names ({stated}); "
            f"{_changed(path, layout, units_line=True)}, with the units of "
            'columns that are not in SI, as in "columns": {"x": {"name": "x", "unit": "mm"}}'
        )


def refuse_long_rows(path: Path, layout: Layout, count: int) -> None:
    """Refuse a CSV file with a row of more cells than names: some of them are in a wrong column."""
    with path.open(encoding=layout.encoding, newline="") as file:
        for number, line in enumerate(file, 1):
            if number <= layout.skip + 1 + layout.units_line or line.count(layout.separator) < count:
                continue
            if any(table_cells(line, layout.separator)[count:]):
                raise InputError(
                    f"'{path}', line {number} has more cells than the {count} names; name each column, "
                    f"and quote a cell that contains the separator, {_mark(layout.separator)}"
                )


def refuse_thousands(path: Path, layout: Layout, table: pd.DataFrame) -> None:
    """Refuse a CSV file in which most numbers of a column that are not read have such separators."""
    for name, cells in table.items():
        numbers: Any = pd.to_numeric(cells, errors="coerce")
        left: Any = cells[numbers.isna()]
        texts = left.dropna().astype("string").str.strip()
        grouped = texts[texts.str.fullmatch(_thousands(layout))]
        if grouped.size > 0.5 * texts.size:
            raise InputError(
                f"'{path}', column '{name}': {quoted(grouped.iloc[0])} has separators of thousands; "
                "write the file without them"
            )


def _thousands(layout: Layout) -> re.Pattern[str]:
    return THOUSANDS.get(layout.decimal, THOUSANDS["."])


def what_to_do(path: Path, layout: Layout, cell: str) -> str:
    """The end of a message about a cell that is not a number, such as 0,5 or 19,800.5; or nothing."""
    hints = []
    if _thousands(layout).fullmatch(cell.strip()):
        hints.append("if it has separators of thousands, write the file without them")
    if layout.decimal != "," and DECIMAL_COMMA.fullmatch(cell.strip()):
        hints.append(f"if the decimal mark is a comma, {_changed(path, layout, decimal=',')}")
    return "".join(f"; {hint}" for hint in hints)
