"""A document of sections with text, tables and figures as one HTML page, in the style of the report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from . import formatting
from .page import Figure, drawing, write_page


class Table(NamedTuple):
    """A table: names of the columns, and rows of which the first cell is the row's name.

    The other cells hold numbers, or words.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Any]]
    words: bool = False


class Plot(NamedTuple):
    """A figure and its caption."""

    figure: Figure
    caption: str


@dataclass
class ReportSection:
    """A part of the page.

    Attributes:
        heading: of the part.
        text: paragraphs.
        tables, plots: what stands below.
    """

    heading: str
    text: Sequence[str] = ()
    tables: Sequence[Table] = ()
    plots: Sequence[Plot] = ()


@dataclass
class Document:
    """The page.

    Attributes:
        title: of the page.
        lead: the result in one sentence.
        sections: in their order.
        provenance: what the result was made with.
    """

    title: str
    lead: str = ""
    sections: Sequence[ReportSection] = field(default_factory=list)
    provenance: Mapping[str, str] = field(default_factory=dict)


def write_document(path: Path, document: Document) -> None:
    """Write the page: one HTML file that needs no other.

    Args:
        path: of the file.
        document: its content.
    """
    drawn = [
        [drawing(p.figure, f"plot-{k}-{j}", p.caption) for j, p in enumerate(section.plots)]
        for k, section in enumerate(document.sections)
    ]
    write_page(path, "document.html", title=document.title, document=document, drawn=drawn)


def numbers(values: Sequence[float], digits: int = 3) -> list[str]:
    """Numbers as a table shows them."""
    return [formatting.number(float(x), digits) for x in values]
