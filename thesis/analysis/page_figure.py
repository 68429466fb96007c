"""Figures of matplotlib as SVG elements of a page: real text, the page's colours, unique ids."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from xml.etree import ElementTree

import matplotlib
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.text import Text

from diagnosis.report import GRID, INK

WIDTH = 4.8  # in; that of the report's charts
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "cybership",
    "font.size": 9.0,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "lines.linewidth": 1.3,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.facecolor": "none",
    "axes.facecolor": "none",
}
SVG, XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
HREF = f"{{{XLINK}}}href"
DIGITS = re.compile(r"(\.\d\d)\d+")  # of a path's coordinates: what follows 0.01 pt cannot be seen
LEFT_OUT = {f"{{{SVG}}}metadata", f"{{{SVG}}}style"}  # date and maker; a style for the whole page


@contextmanager
def styled() -> Iterator[None]:
    """Context with the style of a page, whatever that of the user is."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


class PageFigure(Figure):
    """A figure that a page shows."""

    def subplots(self, *args: Any, **more: Any) -> Any:
        """Panels of the page's style: what they are made of has that of its making."""
        with styled():
            return super().subplots(*args, **more)

    def svg(self, key: str, label: str) -> str:
        """The figure as an ``<svg>`` element of a page.

        Args:
            key: letters and digits that no other figure of the page has.
            label: its text for screen readers.
        """
        made = io.StringIO()
        for text in self.findobj(Text):
            text.set_parse_math(False)  # a run may be called $x$
        with styled():
            FigureCanvasSVG(self).print_svg(made, metadata={"Date": None, "Creator": None})
        root = ElementTree.fromstring(made.getvalue().encode())
        for parent in list(root.iter()):
            for child in [c for c in parent if c.tag in LEFT_OUT]:
                parent.remove(child)
        _prefix(root, key)
        for name in ("width", "height", "version"):
            root.attrib.pop(name, None)
        root.set("role", "img")
        root.set("aria-label", label)
        for element in root.iter():
            if "d" in element.attrib:
                element.set("d", DIGITS.sub(r"\1", element.attrib["d"]))
        ElementTree.register_namespace("", SVG)
        return ElementTree.tostring(root, encoding="unicode")


def figure_of(height: float) -> PageFigure:
    """An empty figure as wide as the page, so many inches high."""
    return PageFigure(figsize=(WIDTH, height), layout="constrained")


def _prefix(root: ElementTree.Element, key: str) -> None:
    """Prefix the ids that something refers to with the key, and remove the others."""
    used = set()
    for element in root.iter():
        for name, value in list(element.attrib.items()):
            used |= set(re.findall(r"url\(#([^)]+)\)", value))
            value = re.sub(r"url\(#", f"url(#{key}-", value)
            if name == HREF:
                used.add(value[1:])
                del element.attrib[name]
                name, value = "href", f"#{key}-{value[1:]}"
            element.set(name, value)
    for element in root.iter():
        own = element.attrib.pop("id", None)
        if own in used:
            element.set("id", f"{key}-{own}")
