"""Panels, legends and axes that the figures of the report share."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .svg import WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

FORCES = ("X [N]", "Y [N]", "N [N·m]")
# in, around panels: numbers of seven digits and a label, a legend of one line above; chosen.
LEFT, RIGHT, BELOW, ABOVE, APART = 0.84, 0.16, 0.46, 0.3, 0.12


def figure_of(height: float) -> "Figure":
    """An empty figure as wide as the page, so many inches high."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def panels_of(height: float, count: int = 1, sharex: bool = True) -> "tuple[Figure, list[Axes]]":
    """Panels above each other, so many inches high in all, with numbers and a label on their axes.

    Margins are given: to measure all letters takes longer than to draw.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height))
    apart = APART if sharex else BELOW + APART
    inside = height - BELOW - ABOVE - (count - 1) * apart
    share = {"hspace": count * apart / inside} if count > 1 else {}
    figure.subplots_adjust(
        LEFT / WIDTH, BELOW / height, 1.0 - RIGHT / WIDTH, 1.0 - ABOVE / height, **share
    )
    panels = figure.subplots(count, 1, sharex=sharex, squeeze=False)[:, 0]
    figure.align_ylabels(panels)
    return figure, list(panels)


def stack(height: float, sharex: bool = True) -> "tuple[Figure, Sequence[Axes]]":
    """Three panels above each other, for X, Y and N of the model error."""
    figure, panels = panels_of(height, 3, sharex)
    for panel, label in zip(panels, FORCES, strict=True):
        panel.set_ylabel(f"ω {label}")
    return figure, panels


def legend(figure: "Figure", panel: "Axes", columns: int = 2) -> None:
    """A legend of one panel above the figure of :func:`panels_of`."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="upper center", ncols=columns, columnspacing=1.4, borderpad=0.2)


def polygons(panel: "Axes", corners: "Sequence[np.ndarray]", **look: Any) -> None:
    """Closed lines, (m, 2) each, over the horizontal and the vertical axis; limits stay as they are."""
    from matplotlib.collections import PolyCollection

    panel.add_collection(PolyCollection(corners, **look), autolim=False)


def plain_numbers(axis: "Axis") -> None:
    """Numbers of a logarithmic axis as they are, not as powers."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(
        FuncFormatter(
            lambda value, _: f"{value:,.0f}".replace(",", " ") if value >= 1.0 else f"{value:g}"
        )
    )
    axis.set_minor_formatter(NullFormatter())


def breaks(groups: np.ndarray) -> np.ndarray:
    """Indices at which a new group begins, as places to insert a gap."""
    return np.flatnonzero(np.diff(groups)) + 1
