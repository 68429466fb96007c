"""The figures of the model error, of the candidates and of learned shapes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.plots import thin

from ..evidence import Evidence
from ..weak import EVERY
from .panels import breaks, figure_of, legend, plain_numbers, stack
from .regions import Quantity, Region
from .shape import Curve
from .svg import AFTER, BAND, BEFORE, INK, THIRD

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SURE = 1.96  # standard deviations, 95 %
MOST_RANKED = 14
WIDE_SPREAD = 20.0  # ratio of scores from which on their axis is logarithmic


def model_error(e: Evidence, std: np.ndarray | None, learned: bool) -> "Figure":
    """Omega over time, axis by axis: measured with its uncertainty, and the part that is explained."""
    figure, panels = stack(4.6)
    time = e.integrals.middle
    stretch = np.concatenate([[0], np.cumsum(np.diff(time) > 1.5 * EVERY)])
    for axis, panel in enumerate(panels):
        measured = e.before.omega[:, axis]
        rows = thin(np.arange(time.size), measured)[0]
        cuts = breaks(stretch[rows])

        def drawn(values: np.ndarray, rows: np.ndarray = rows, cuts: np.ndarray = cuts) -> np.ndarray:
            return np.insert(values[rows], cuts, np.nan)

        t = drawn(time)
        if std is not None:
            low, high = (drawn(measured + sign * SURE * std[:, axis]) for sign in (-1.0, 1.0))
            panel.fill_between(t, low, high, color=BAND, alpha=0.45, lw=0.0, label="uncertainty, 95 %")
        panel.axhline(0.0, color=INK, lw=0.6)
        panel.plot(t, drawn(measured), color=BEFORE, lw=1.8, alpha=0.8, label="measured")
        if learned:
            explained = measured - e.after.omega[:, axis]
            panel.plot(t, drawn(explained), color=AFTER, lw=1.0, label="explained")
    panels[2].set_xlabel("time [s]")
    panels[2].margins(x=0.01)
    legend(figure, panels[0], 3)
    return figure


def where(quantity: Quantity, found: Sequence[Region], learned: bool) -> "Figure":
    """RMS of omega over a quantity, axis by axis."""
    own = len(set(quantity.labels)) > 1
    figure, panels = stack(5.0 if own else 4.2, sharex=not own)
    for panel, region, label in zip(panels, found, quantity.labels, strict=True):
        if region.unsure is not None:
            panel.stairs(region.unsure, region.edges, fill=True, color=BAND, alpha=0.45, label="noise")
        middle = 0.5 * (region.edges[1:] + region.edges[:-1])
        parts = [("before" if learned else "model error", region.before, BEFORE, "o")]
        parts += [("after", region.after, AFTER, "s")] if learned else []
        for name, rms, colour, marker in parts:
            panel.stairs(rms, region.edges, baseline=None, color=colour, lw=1.6, label=name)
            panel.plot(middle, rms, marker, color=colour, ms=3.0)
        panel.set_ylim(bottom=0.0)
        if own or panel is panels[2]:
            panel.set_xlabel(label)
    if quantity.edges is not None:
        panels[2].set_xticks(np.linspace(quantity.edges[0], quantity.edges[-1], 5))
    legend(figure, panels[0], 3)
    return figure


def ranking(ranked: Sequence[Mapping[str, Any]], alike: Sequence[str]) -> "Figure":
    """Candidates by their loss: the best, and hollow those that the data cannot tell from the first."""
    shown = [r for k, r in enumerate(ranked) if k < MOST_RANKED or r["id"] in alike]
    figure = figure_of(0.8 + 0.24 * len(shown))
    panel = figure.subplots()
    scores = np.array([r["score"] for r in shown], float)
    for k, r in enumerate(shown):
        sure = k == 0 or r["id"] in alike
        panel.plot(
            scores[k],
            k,
            "o",
            ms=7.0 if sure else 5.5,
            color=AFTER if sure else BAND,
            mfc=AFTER if k == 0 else ("none" if sure else BAND),
            mew=1.6,
        )
        panel.annotate(
            _explained(r.get("q2")),
            (1.0, k),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
        )
    panel.locator_params(axis="x", nbins=5)
    if scores.min() > 0.0 and scores.max() > WIDE_SPREAD * scores.min():
        panel.set_xscale("log")
        plain_numbers(panel.xaxis)
    panel.margins(x=0.06)
    panel.set_yticks(range(len(shown)), [str(r["id"]) for r in shown])
    panel.set_ylim(len(shown) - 0.5, -0.5)
    panel.set_xlabel("cross-validated loss [1], lower is better; right: explained")
    return figure


def _explained(q2: float | None) -> str:
    """A share as it stands beside a candidate; below zero, how far does not matter."""
    if q2 is None:
        return ""
    return f"{100.0 * q2:.0f} %" if q2 >= 0.0 else "< 0 %"


def curve(c: Curve) -> "Figure":
    """A learned shape beside the nominal one."""
    figure = figure_of(3.3)
    panel = figure.subplots()
    if c.seen is not None:
        for low, high in ((c.x[0], c.seen[0]), (c.seen[1], c.x[-1])):
            if high > low:
                panel.axvspan(low, high, color=BAND, alpha=0.25, lw=0.0)
    panel.axhline(0.0, color=INK, lw=0.6)
    if c.sure is not None:
        panel.fill_between(c.x, *c.sure, color=AFTER, alpha=0.2, lw=0.0)
    panel.plot(c.x, c.nominal, "--", color=BEFORE, label="before")
    panel.plot(c.x, c.learned, color=AFTER, lw=1.8, label="learned")
    for name, (x, y) in c.points.items():
        panel.plot(x, y, "o", ms=4.5, mfc="none", color=THIRD, label=name)
    panel.set_xlim(c.x[0], c.x[-1])
    panel.set_xlabel(c.over)
    panel.set_ylabel(c.what)
    legend(figure, panel, 2 + len(c.points))
    return figure
