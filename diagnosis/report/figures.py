"""Figures of the model error, of the ranking of candidates and of learned shapes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cosim.results import thin

from ..predictors.evaluation import Evaluation
from ..search.shortlist import TIE
from .content import Z95
from .panels import breaks, figure_of, legend, panels_of, plain_numbers, stack
from .profiles import BinnedError, Quantity
from .result_keys import RankedResult
from .shape import Curve
from .svg import AFTER, BAND, BEFORE, INK, THIRD

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_RANKED = 14  # candidates in the figure; chosen
LOG_SPREAD = 20.0  # standard errors from which on the axis of scores is logarithmic; chosen
GAP = 1.5  # times the spacing of windows, from which on a line is interrupted; chosen


def model_error(e: Evaluation, std: np.ndarray | None, learned: bool) -> "Figure":
    """Model error over time of X, Y and N, with its uncertainty, and the part that is explained."""
    figure, panels = stack(4.6)
    time = e.weak_windows.middle
    segment = np.concatenate([[0], np.cumsum(np.diff(time) > GAP * e.weak_windows.every)])
    for axis, panel in enumerate(panels):
        measured = e.before.omega[:, axis]
        rows = thin(np.arange(time.size), measured)[0]
        cuts = breaks(segment[rows])

        def drawn(values: np.ndarray, rows: np.ndarray = rows, cuts: np.ndarray = cuts) -> np.ndarray:
            return np.insert(values[rows], cuts, np.nan)

        t = drawn(time)
        if std is not None:
            low, high = (drawn(measured + sign * Z95 * std[:, axis]) for sign in (-1.0, 1.0))
            panel.fill_between(t, low, high, color=BAND, alpha=0.45, lw=0.0, label="uncertainty, 95 %")
        panel.axhline(0.0, color=INK, lw=0.6)
        panel.plot(t, drawn(measured), color=BEFORE, lw=1.8, label="measured")
        if learned:
            explained = measured - e.after.omega[:, axis]
            panel.plot(t, drawn(explained), color=AFTER, lw=1.0, label="explained")
    panels[2].set_xlabel("time [s]")
    panels[2].margins(x=0.01)
    legend(figure, panels[0], 3)
    return figure


def profile(quantity: Quantity, errors: Sequence[BinnedError], learned: bool) -> "Figure":
    """RMS of the model error over a quantity, for X, Y and N."""
    own = len(set(quantity.labels)) > 1
    figure, panels = stack(5.0 if own else 4.2, sharex=not own)
    for panel, error, label in zip(panels, errors, quantity.labels, strict=True):
        if error.uncertainty is not None:
            panel.stairs(
                error.uncertainty, error.edges, fill=True, color=BAND, alpha=0.45, label="noise"
            )
        middle = 0.5 * (error.edges[1:] + error.edges[:-1])
        parts = [("before" if learned else "model error", error.before, BEFORE, "o")]
        parts += [("after", error.after, AFTER, "s")] if learned else []
        for name, rms, colour, marker in parts:
            panel.stairs(rms, error.edges, baseline=None, color=colour, lw=1.6, label=name)
            panel.plot(middle, rms, marker, color=colour, ms=3.0)
        panel.set_ylim(bottom=0.0)
        if own or panel is panels[2]:
            panel.set_xlabel(label)
    if quantity.edges is not None:
        panels[2].set_xticks(np.linspace(quantity.edges[0], quantity.edges[-1], 5))
    legend(figure, panels[0], 3)
    return figure


def ranking(ranked: Sequence[RankedResult]) -> "Figure":
    """Candidates by how much worse than the first they are, with the standard error of that difference.

    Hollow are those within two of it.
    """
    shown = ranked[:MAX_RANKED]
    figure = figure_of(0.8 + 0.24 * len(shown))
    panel = figure.subplots()
    for k, r in enumerate(shown):
        behind, std = _behind(r, shown[0])
        tied = behind <= TIE * std
        panel.errorbar(
            behind,
            k,
            xerr=std,
            fmt="o",
            ms=7.0 if tied else 5.5,
            color=AFTER if tied else BAND,
            mfc=AFTER if k == 0 else ("none" if tied else BAND),
            mew=1.6,
            elinewidth=1.2,
        )
        panel.annotate(
            _explained(r.beyond if r.beyond is not None else r.q2),
            (1.0, k),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
        )
    linear = max((std for _, std in (_behind(r, shown[0]) for r in shown)), default=0.0)
    if _behind(shown[-1], shown[0])[0] > LOG_SPREAD * linear > 0.0:
        panel.set_xscale("symlog", linthresh=TIE * linear)
        plain_numbers(panel.xaxis)
    else:
        panel.locator_params(axis="x", nbins=5)
    panel.margins(x=0.06)
    panel.set_yticks(range(len(shown)), [r.id for r in shown])
    panel.set_ylim(len(shown) - 0.5, -0.5)
    panel.set_xlabel(
        "score behind the first, with its standard error [1]\n"
        "right: explained beyond other values of the coefficients"
    )
    return figure


def _behind(r: RankedResult, first: RankedResult) -> tuple[float, float]:
    """By how much a candidate's score is behind, and its standard error; 0 where a method has none."""
    if r.behind is not None:
        return r.behind, r.behind_std or 0.0
    return (r.score or 0.0) - (first.score or 0.0), 0.0


def _explained(share: float | None) -> str:
    """The share beside a candidate; a negative one without its size, which means nothing."""
    if share is None:
        return ""
    return f"{100.0 * share:.0f} %" if share >= 0.0 else "< 0 %"


def curve(c: Curve) -> "Figure":
    """A learned shape beside the nominal one."""
    figure, (panel,) = panels_of(3.3)
    if c.covered is not None:
        for low, high in ((c.x[0], c.covered[0]), (c.covered[1], c.x[-1])):
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
