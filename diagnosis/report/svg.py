"""Matplotlib's figures as SVG elements of a web page: real text, the page's colours, unique ids."""

import base64
import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 4.8  # in; width of a phone's page in CSS pixels, so that letters keep their size there
# Colours by Okabe and Ito, which are distinct with any colour vision. The page has a variable of each
# name, lighter ones for a dark screen.
INK, GRID, BAND = "#1f2328", "#dde1e6", "#8a919a"
BEFORE, AFTER, THIRD = "#d55e00", "#0072b2", "#009e73"
PALETTE = {INK: "ink", GRID: "grid", BAND: "band", BEFORE: "before", AFTER: "after", THIRD: "third"}

STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "cybership",
    "text.parse_math": False,  # a run may be called $x$
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
LEFT_OUT = {
    f"{{{SVG}}}metadata",
    f"{{{SVG}}}style",
}  # date and maker; a style for the whole page


@contextmanager
def style() -> Iterator[None]:
    """Context with the style of the page, independent of the user's settings."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def inline(figure: "Figure", key: str, label: str) -> str:
    """A figure as an ``<svg>`` element of a page.

    Args:
        figure: drawn within :func:`style`.
        key: letters and digits that no other figure of the page has.
        label: its text for screen readers.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    made = io.StringIO()
    FigureCanvasSVG(figure).print_svg(made, metadata={"Date": None, "Creator": None})  # drawn only once
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
        for name in ("style", "fill", "stroke"):
            if name in element.attrib:
                element.set(name, _coloured(element.attrib[name]))
        if "d" in element.attrib:
            element.set("d", DIGITS.sub(r"\1", element.attrib["d"]))
    ElementTree.register_namespace("", SVG)
    return ElementTree.tostring(root, encoding="unicode")


def alone(svg: str) -> str:
    """A picture of :func:`inline` as a file of its own, in the colours of a bright page."""
    for colour, name in PALETTE.items():
        svg = svg.replace(f"var(--{name})", colour)
    return svg


def data_uri(svg: str) -> str:
    """Address that holds the file of a picture, for a link by which a reader saves it."""
    return "data:image/svg+xml;base64," + base64.b64encode(alone(svg).encode()).decode()


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


def _coloured(text: str) -> str:
    for colour, name in PALETTE.items():
        text = text.replace(colour, f"var(--{name})")
    return text
