"""Sections of text and tables, and figures, as pages of a PDF in A4."""

import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ..report.document import Section

if TYPE_CHECKING:
    from matplotlib.figure import Figure

A4 = (8.27, 11.69)  # in
MARGIN, LEADING = 0.7, 1.35  # in; line spacing in letters
BODY, HEADING, TITLE = 7.5, 11.0, 15.0  # pt
WIDE = 108  # letters of a fixed width in a line of the body; derived: 6.87 in of 0.602 x 7.5 pt
APART = 2  # letters between columns
NARROW = 8  # letters of a column at the least


class Line(NamedTuple):
    text: str
    size: float = BODY


def write_pdf(path: Path, title: str, parts: Sequence[Section], figures: "Sequence[Figure]") -> None:
    """Write text pages, then the figures, one a page."""
    from matplotlib.backends.backend_pdf import PdfPages

    with PdfPages(path, metadata={"Title": title}) as pdf:
        for page in _pages([Line(title, TITLE), *(line for s in parts for line in _lines(s))]):
            pdf.savefig(page)
        for figure in figures:
            pdf.savefig(figure)


def _pages(lines: Sequence[Line]) -> "Iterator[Figure]":
    from matplotlib.figure import Figure

    page, at = None, 0.0
    for line in lines:
        height = LEADING * line.size / 72.0
        # A heading does not stand alone at the end of a page.
        if page is None or at + height * (4.0 if line.size > BODY else 1.0) > A4[1] - MARGIN:
            if page is not None:
                yield page
            page, at = Figure(figsize=A4), MARGIN
        at += height
        family = "monospace" if line.size == BODY else "sans-serif"
        page.text(
            MARGIN / A4[0], 1.0 - at / A4[1], line.text, fontsize=line.size, family=family, va="bottom"
        )
    if page is not None:
        yield page


def _lines(s: Section) -> Iterator[Line]:
    yield Line("")
    yield Line(s.heading, HEADING)
    for paragraph in s.text:
        yield from map(Line, textwrap.wrap(paragraph, WIDE))
    for t in s.tables:
        yield from map(Line, table([t.header, *t.rows]))


def table(rows: Sequence[Sequence[str]], wide: int = WIDE) -> Iterator[str]:
    """Rows of cells in columns that fit into so many letters; long cells go on in the next line."""
    widths = [max(len(line) for cell in column for line in cell.splitlines() or [""])
              for column in zip(*rows, strict=True)]  # fmt: skip
    room = wide - APART * (len(widths) - 1)
    while sum(widths) > room and max(widths) > NARROW:
        widths[widths.index(max(widths))] -= 1
    for row in rows:
        cells = [_wrapped(cell, w) for cell, w in zip(row, widths, strict=True)]
        for k in range(max(map(len, cells))):
            line = [c[k] if k < len(c) else "" for c in cells]
            yield (" " * APART).join(t.ljust(w) for t, w in zip(line, widths, strict=True)).rstrip()


def _wrapped(cell: str, wide: int) -> list[str]:
    return [w for line in cell.splitlines() for w in textwrap.wrap(line, wide)] or [""]
