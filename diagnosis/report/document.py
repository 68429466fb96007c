"""A document of sections with text, tables and figures as one HTML page, in the style of the report."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import cosim

from . import formatting
from .page import environment
from .svg import inline, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TEMPLATE = "document.html"


class Table(NamedTuple):
    """A table: names of the columns, and rows of which the first cell is the row's name.

    The other cells hold numbers, or words.
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Any]]
    words: bool = False


class Plot(NamedTuple):
    """A figure drawn within the page's style, and its caption."""

    figure: "Figure"
    caption: str


@dataclass
class Section:
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
    sections: Sequence[Section] = field(default_factory=list)
    provenance: Mapping[str, str] = field(default_factory=dict)


def write_document(path: Path, document: Document) -> None:
    """Write the page: one HTML file that needs no other.

    Args:
        path: of the file.
        document: its content.
    """
    from markupsafe import Markup

    with style():
        drawn = {
            (k, j): Markup(inline(plot.figure, f"plot-{k}-{j}", plot.caption))
            for k, section in enumerate(document.sections)
            for j, plot in enumerate(section.plots)
        }
    text = (
        environment().get_template(TEMPLATE).render(title=document.title, document=document, drawn=drawn)
    )
    with cosim.atomic_write(path) as scratch:
        scratch.write_text(text, encoding="utf-8")


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write the content of a JSON file; a number that is not finite is null."""
    text = json.dumps(finite(content), indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def finite(value: Any) -> Any:
    """Arrays as lists, numbers that are not finite as None."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(k): finite(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(v) for v in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def numbers(values: Sequence[float], digits: int = 3) -> list[str]:
    """Numbers as a table shows them."""
    return [formatting.number(float(x), digits) for x in values]
