"""How the text of a table is laid out, read off its first lines."""

import csv
import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from itertools import islice, product
from pathlib import Path
from typing import NamedTuple

from ..columns.columns import PREAMBLE, UNITS, Layout
from ..columns.name_words import WORDS
from ..columns.unit_check import spelt

UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # how such a text begins
EAST_ASIAN = ("gb18030", "big5", "cp932")  # encodings of Chinese and Japanese
SEPARATORS = (",", ";", "\t", "|", " ")  # that a table may have between its cells
# A time of day, a date before it, and half of the day, zone or year behind it.
STAMP = re.compile(
    r"^(?P<date>.*?)[\sT,:]*(?<!\d)(?P<h>\d{1,2}):(?P<min>\d\d)(?::(?P<s>\d\d(?:[.,:]\d+)?))?"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?P<rest>\D*\d{4}|[^\d:]*)$"
)
RULED = re.compile(r"[-=+|\s]*[-=]{3}[-=+|\s]*")  # a line below the names
MARK = re.compile(r"[#%/!]+")  # of a comment, alone before the names
NUMBER = re.compile(
    r"(?P<before>[(+\u2212\u2013-]?) ?(?P<digits>\d[\d.,]*|[.,]\d+)(?:[dDeE](?P<power>[+-]?\d+))?"
    r"(?P<behind>\)?)"
)
KNOWN = {unit for units in UNITS.values() for unit in units}


def text_layout(path: Path, encoding: str) -> Layout | None:
    """Separator, decimal mark, line of the names and of the units, as the first lines suggest.

    Without columns; None if there is no table of numbers below a line of names.
    """
    with path.open(encoding=encoding, errors="replace", newline="") as file:
        lines = list(islice(file, PREAMBLE))
    there = [separator for separator in SEPARATORS if any(separator in line for line in lines)]
    quoted = any('"' in line for line in lines)  # "1,5","2,5"
    tables = [(separator, _split(lines, separator)) for separator in there]
    for is_told in (_is_number, _is_value):
        found = [_with(*table, decimal, quoted, is_told) for table, decimal in product(tables, ".,")]
        best = max(found, key=lambda each: each[0], default=(-1.0, None))
        if best[1] is not None:
            return best[1]
    return None


def likely_encoding(content: bytes) -> str:
    """The encoding of a text that is not UTF-8: in Chinese or Japanese two of its words are known."""
    if content.startswith(UTF_16):
        return "utf-16"
    known = {e: set(re.findall(WORDS, content.decode(e, errors="ignore"))) for e in EAST_ASIAN}
    best = max(EAST_ASIAN, key=lambda encoding: len(known[encoding]))
    return best if len(known[best]) > 1 else "latin-1"


def table_cells(line: str, separator: str) -> list[str]:
    """The cells of a line, without blanks around them."""
    cells = csv.reader([line], delimiter=separator, skipinitialspace=True)
    try:
        return [cell.strip() for cell in next(cells, [])]
    except csv.Error:  # a field of more than 128 KiB
        return [line]


def is_marked(path: Path, layout: Layout) -> bool:
    """Whether the line of the names begins with the mark of a comment, no name itself: ``# t x y``."""
    with path.open(encoding=layout.encoding, errors="replace", newline="") as file:
        lines = islice(file, layout.skip, layout.skip + 2 + layout.units_line)
        cells = [table_cells(line.rstrip(), layout.separator) for line in lines]
    return bool(cells) and unmarked(cells[0], len(cells[-1])) != cells[0]


def unmarked(cells: list[str], width: int) -> list[str]:
    """The cells of a line above a table of some width, without the mark of a comment before them."""
    is_mark = len(cells) == width + 1 and MARK.fullmatch(cells[0])
    return cells[1:] if is_mark else cells


def bare_unit(text: str) -> str:
    """A unit without the brackets around it, as this project spells it."""
    return spelt(text.strip().strip("[]()").strip())


def plain_number(cell: str) -> str:
    """A number as Python reads it, of other spellings: – 1, (1), 1.0D+01, '1, ="1"; else the cell."""
    stated = NUMBER.fullmatch(cell.strip("\u00a0 '=\""))
    if stated is None or (stated["before"] == "(") != (stated["behind"] == ")"):
        return cell
    sign = "-" if stated["before"] not in ("", "+") else ""
    return f"{sign}{stated['digits']}e{stated['power'] or 0}"


def _is_number(cell: str, decimal: str) -> bool:
    cell = plain_number(cell)
    if decimal == "," and "." in cell:
        return False
    try:
        float(cell.replace(decimal, "."))
    except ValueError:
        return False
    return True


def _is_value(cell: str, decimal: str) -> bool:
    """Whether a cell is a number or a time stamp."""
    return _is_number(cell, decimal) or STAMP.match(cell) is not None


class _Rows(NamedTuple):
    """Lines as cells: number and cells of those that are not ruled, numbers of these, usual width."""

    rows: Sequence[tuple[int, list[str]]]
    ruled: Collection[int]
    width: int


def _split(lines: Sequence[str], separator: str) -> _Rows:
    """Lines as cells between a separator."""
    ruled = {k for k, line in enumerate(lines) if RULED.fullmatch(line.strip())}
    blank = " " if separator == " " else ""  # at the end of a line it separates no cells
    rows = [
        (k, table_cells(line.rstrip("\r\n" + blank), separator))
        for k, line in enumerate(lines)
        if line.strip() and k not in ruled
    ]
    widths = Counter(len(cells) for _, cells in rows)
    width = max(widths, key=lambda n: widths[n], default=0)
    return _Rows([(k, unmarked(cells, width)) for k, cells in rows], ruled, width)


def _with(
    separator: str,
    table: _Rows,
    decimal: str,
    quoted: bool,
    is_told: Callable[[str, str], bool],
) -> tuple[float, Layout | None]:
    """How much of the table is read with a separator and a decimal mark, and the layout of that."""
    rows, ruled, width = table
    if (separator == decimal and not quoted) or width < 2:
        return -1.0, None

    def share(cells: Sequence[str]) -> float:
        stated = [cell for cell in cells if cell]
        numbers = sum(is_told(cell, decimal) for cell in stated)
        return numbers / len(stated) if stated and len(cells) == width else math.nan

    shares = [share(cells) for _, cells in rows]
    # Numbers in a line or two before the names are not the table yet.
    begins = [k for k in range(len(shares)) if all(part >= 0.5 for part in shares[k : k + 3])]
    first = next(iter(begins), next((k for k, part in enumerate(shares) if part >= 0.5), 0))
    if not first or len(rows[first - 1][1]) < 2:
        return -1.0, None
    stated = [part for part in shares[first:] if math.isfinite(part)]
    below = first - 1  # the line below the names, if there is one
    while below and not _is_of_units(rows[below - 1][1], rows[below][1], width):
        below = below - 1 if len(set(rows[below][1])) < width else 0
    names = rows[below - 1 if below else first - 1][0]
    has_units = below > 0 or names + 1 in ruled
    layout = Layout(separator=separator, decimal=decimal, skip=names, units_line=has_units)
    return sum(stated) / len(rows) + 1e-3 * (decimal == "."), layout


def _is_of_units(above: Sequence[str], below: Sequence[str], width: int) -> bool:
    """Whether a line of cells is of units or types, and that above of names: all there and different."""
    known = sum(bare_unit(cell) in KNOWN for cell in below)
    are_names = len(above) == width == len(set(above) - {""})
    return are_names and (2 * known >= width or len(set(below)) < width)
