"""Panels, lines over time and legends, common to all pictures.

Matplotlib is imported only when a picture is drawn, and without pyplot: that needs no display and leaves
no global state.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from cybership.scratch_folder import atomic_write

from ..errors import InputError
from .log import Log
from .run_options import RunOptions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 120  # chosen
MOST_PIXELS = 10_000  # of a picture in each direction, chosen: 0.4 GB of memory
COMPRESSION = 3  # of a PNG, chosen: two thirds of the usual time, files a fifth larger
WIDTH = 8.0  # of a picture [in], chosen
MAX_POINTS = 2000  # of a line over time: more than the pixels of its panel (WIDTH times DPI)
LETTERS_PER_INCH = 12  # of a legend, in the default font
NUMBERS = (-4, 5)  # smallest and largest power of ten that is written out: no more than seven signs
# Room around the panels, in sizes of the font: for such numbers and a label; chosen.
LEFT, RIGHT, BOTTOM, TOP, BETWEEN = 6.6, 1.5, 4.0, 1.8, 2.2
LABEL = 5.0  # from the panel to its label
POINTS = 72.0  # in an inch


class DrawnRun(NamedTuple):
    """One run in a picture.

    Attributes:
        label: in legends.
        log: the columns that the picture needs, without rows that cannot be drawn.
        line: matplotlib's properties of its lines.
        stated: its columns, the part that metrics cover, and its ship, as far as these are known.
    """

    label: str
    log: Log
    line: dict[str, Any]
    stated: RunOptions


Runs = Sequence[DrawnRun]


def thin(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At most MAX_POINTS samples of a line, among them every peak.

    Args:
        time, values: samples in order of time.

    Returns:
        Lowest and highest sample of each of equally long stretches, in order of time.
    """
    n = values.size
    if n <= MAX_POINTS:
        return time, values
    length = -(-n // (MAX_POINTS // 2))
    padded = np.pad(values, (0, -n % length), mode="edge").reshape(-1, length)
    start = np.arange(0, n, length)
    ends = np.stack([start + padded.argmin(axis=1), start + padded.argmax(axis=1)])
    chosen = np.minimum(np.sort(ends, axis=0).T.ravel(), n - 1)
    return time[chosen], values[chosen]


def blank(width: float, height: float) -> Figure:
    """An empty figure, width by height [in]."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=DPI)


def arrange(figure: Figure) -> Figure:
    """Set the panels between margins that depend on the size of the font, below the legend.

    Matplotlib's own layouts measure every letter, which takes as long as drawing them.
    """
    from matplotlib import rcParams
    from matplotlib.transforms import ScaledTranslation

    letter = rcParams["font.size"] / POINTS
    wide, high = figure.get_size_inches() / letter
    top = TOP + sum(s.get_window_extent().height / figure.dpi / letter for s in figure.legends)
    grid = figure.axes[0].get_gridspec()
    assert grid is not None
    below = BOTTOM if figure.axes[0].get_xlabel() else BETWEEN  # a panel with an axis of its own
    apart = LEFT if any(panel.get_ylabel() for panel in figure.axes[1 : grid.ncols]) else RIGHT
    figure.subplots_adjust(
        left=LEFT / wide,
        right=1.0 - RIGHT / wide,
        bottom=BOTTOM / high,
        top=1.0 - top / high,
        wspace=apart * grid.ncols / (wide - LEFT - RIGHT - (grid.ncols - 1) * apart),
        hspace=below * grid.nrows / (high - BOTTOM - top - (grid.nrows - 1) * below),
    )
    aside = ScaledTranslation(-LABEL * letter, 0.0, figure.dpi_scale_trans)
    for panel in figure.axes:
        panel.yaxis.set_label_coords(0.0, 0.5, panel.transAxes + aside)
    return figure


def stacked(
    rows: int, columns: int, height: float, width: float = WIDTH, sharey: bool | Literal["row"] = False
) -> tuple[Figure, np.ndarray]:
    """A figure with a grid of panels over a common time axis."""
    figure = blank(width, height)
    panels = figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False)
    for panel in panels.flat:
        grid(panel)
        panel.margins(x=0.01)
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    return figure, panels


def grid(panel: Axes) -> None:
    """Pale grid lines behind the data, and no frame at the sides without a scale."""
    panel.grid(visible=True, color="0.88", linewidth=0.6)
    panel.ticklabel_format(axis="y", scilimits=NUMBERS)
    panel.locator_params(nbins=5)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)


def legend(figure: Figure, panel: Axes, entries: int) -> None:
    """A legend above the panels, for all of them, in as many columns as its labels leave room for."""
    handles, labels = panel.get_legend_handles_labels()
    widest = max(map(len, labels), default=0) + 6
    figure.legend(
        handles,
        labels,
        loc="upper center",
        ncols=max(1, min(entries, int(figure.get_figwidth() * LETTERS_PER_INCH / widest))),
        columnspacing=1.5,
        frameon=False,
    )


def plot(panel: Axes, run: DrawnRun, values: np.ndarray, **line: Any) -> None:
    """Draw one value of a run over time; ``line`` overrides properties of the run's lines."""
    time, values = thin(run.log["time"], values)
    panel.plot(time, values, **{"label": run.label, **run.line, **line})


def finish(figure: Figure, panels: np.ndarray, runs: Runs, least: float = 0.0) -> Figure:
    """Name the runs, give a flat line at least the range ``least``, and arrange the panels."""
    for panel in panels.flat:
        low, high = panel.get_ylim()
        if high - low < least:
            middle = 0.5 * (low + high)
            panel.set_ylim(middle - 0.5 * least, middle + 0.5 * least)
    if len(runs) > 1:
        legend(figure, panels[0, 0], len(runs))
    return arrange(figure)


def check_size(figure: Figure, dpi: float) -> None:
    """Refuse a figure that would need too much memory.

    Args:
        figure: of any size.
        dpi: pixels per inch.

    Raises:
        InputError: it has more than MOST_PIXELS in one direction.
    """
    if (pixels := dpi * max(figure.get_size_inches())) > MOST_PIXELS:
        raise InputError(
            f"a picture would have {pixels:.0f} pixels in one direction; at most {MOST_PIXELS} are "
            "allowed: reduce width or dpi"
        )


def save(figure: Figure, file: Path, dpi: float = DPI) -> None:
    """Write a figure, completely or not at all; the ending of the name says in which format.

    Args:
        figure: what to write.
        file: ``.png``, ``.svg`` or ``.pdf``.
        dpi: pixels per inch of a PNG.

    Raises:
        InputError: a PNG would be too large.
    """
    form = file.suffix[1:]
    # Without a date the same figure is the same file.
    metadata = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(form)
    with atomic_write(file) as scratch:
        if form == "png":
            from matplotlib.backends.backend_agg import FigureCanvasAgg

            check_size(figure, dpi)
            figure.set_dpi(dpi)
            # savefig would draw it twice
            FigureCanvasAgg(figure).print_png(scratch, pil_kwargs={"compress_level": COMPRESSION})
        else:
            figure.savefig(scratch, format=form, metadata=metadata)
