"""Sections of text and tables, and figures, as pages of a PDF in A4."""

from collections.abc import Sequence
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

from ..report.document import ReportSection

if TYPE_CHECKING:
    from matplotlib.figure import Figure

A4 = (8.27, 11.69)  # in
LETTERS, LINES = 90, 60  # of a fixed width within matplotlib's margins; derived from its small size


def write_pdf(
    path: Path, title: str, parts: Sequence[ReportSection], figures: "Sequence[Figure]"
) -> None:
    """Write text pages, then the figures, one a page."""
    from matplotlib.backends.backend_pdf import PdfPages
    from matplotlib.figure import Figure

    lines = laid_out(title, parts)
    with PdfPages(path, metadata={"Title": title}) as pdf:
        for first in range(0, len(lines), LINES):
            page, text = Figure(figsize=A4), "\n".join(lines[first : first + LINES])
            left, top = page.subplotpars.left, page.subplotpars.top
            look = {"family": "monospace", "size": "small", "va": "top", "parse_math": False}
            page.text(left, top, text, **look)
            pdf.savefig(page)
        for figure in figures:
            pdf.savefig(figure)


def laid_out(title: str, parts: Sequence[ReportSection], letters: int = LETTERS) -> list[str]:
    """The lines of some sections, with columns of tables beside each other."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    shown = Console(file=StringIO(), width=letters, color_system=None)
    shown.print(Text(title.upper()))
    for part in parts:
        shown.print("", Text(part.heading.upper()), *map(Text, part.text), sep="\n")
        for t in part.tables:
            table = Table(*t.header, box=SIMPLE, show_header=any(t.header), pad_edge=False)
            for row in t.rows:
                table.add_row(*(Text(cell, overflow="fold") for cell in row))
            shown.print(table)
    return shown.file.getvalue().splitlines()  # type: ignore[attr-defined]
