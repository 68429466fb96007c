"""Panels, legends and axes that the figures of the report share."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from .svg import WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

FORCES = ("X [N]", "Y [N]", "N [N·m]")


def figure_of(height: float) -> "Figure":
    """An empty figure as wide as the page, so many inches high."""
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def stack(height: float, sharex: bool = True) -> "tuple[Figure, Sequence[Axes]]":
    """Three panels above each other, for X, Y and N of the model error."""
    figure = figure_of(height)
    panels = list(figure.subplots(3, 1, sharex=sharex))
    for panel, label in zip(panels, FORCES, strict=True):
        panel.set_ylabel(f"ω {label}")
    figure.align_ylabels(panels)
    return figure, panels


def legend(figure: "Figure", panel: "Axes", columns: int = 2) -> None:
    """A legend of one panel above the figure."""
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, columnspacing=1.4)


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
