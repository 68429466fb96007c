"""Figures of the analyses, drawn within the style of the report's page."""

from collections.abc import Sequence
from itertools import cycle

import numpy as np

from diagnosis.report import AFTER, BAND, BEFORE, THIRD

from .page_figure import PageFigure, figure_of

POINTS = 1500  # at most in a cloud or a line, so that the page stays small (chosen)
COLOURS = (AFTER, BEFORE, THIRD, "black")


def thinned(n: int) -> np.ndarray:
    """Rows of n to be drawn."""
    return np.unique(np.linspace(0, n - 1, min(n, POINTS)).astype(int))


def share_of_variance(
    explained: np.ndarray, validated: np.ndarray, kept: int, label: str = "components"
) -> PageFigure:
    """Explained and cross-validated variance over the number of components or factors (Fig. 7.6a)."""
    figure = figure_of(2.4)
    panel = figure.subplots()
    count = np.arange(1, len(explained) + 1)
    panel.plot(count, 100.0 * explained, "o-", color=AFTER, label="R²")
    panel.plot(count, 100.0 * validated, "s--", color=BEFORE, label="Q²")
    panel.axvline(kept, color=BAND, linewidth=0.8)
    panel.set(xlabel=label, ylabel="explained [%]", xticks=count)
    panel.legend()
    return figure


def against_limit(values: np.ndarray, limit: float, label: str) -> PageFigure:
    """A statistic of each sample with its limit, logarithmic."""
    figure = figure_of(2.2)
    panel = figure.subplots()
    # The largest of each stretch is drawn, so that a spike is seen.
    parts = np.array_split(np.arange(values.size), min(values.size, POINTS))
    rows = [int(part[np.argmax(values[part])]) for part in parts]
    panel.semilogy(rows, np.maximum(values[rows], 1e-6), ".", markersize=2.5, color=AFTER)
    panel.axhline(limit, color=BEFORE, label=f"99 % limit {limit:.3g}")
    panel.set(xlabel="sample", ylabel=label)
    panel.legend()
    return figure


def before_and_after(nu: np.ndarray, kept: np.ndarray) -> PageFigure:
    """The velocity before and after removal of outliers (Fig. 7.5)."""
    figure = figure_of(4.2)
    panels = figure.subplots(3, 1, sharex=True)
    for panel, values, name in zip(panels, nu.T, ("u [m/s]", "v [m/s]", "r [rad/s]"), strict=True):
        gone = np.flatnonzero(~kept)
        stay = np.flatnonzero(kept)[thinned(int(kept.sum()))]
        some = gone[thinned(gone.size)] if gone.size else gone
        panel.plot(some, values[some], "x", markersize=3.0, color=BEFORE, label="removed")
        panel.plot(stay, values[stay], ".", markersize=2.0, color=AFTER, label="kept")
        panel.set_ylabel(name)
    panels[0].legend(ncols=2)
    panels[-1].set_xlabel("sample")
    return figure


def cloud(a: np.ndarray, b: np.ndarray, labels: tuple[str, str]) -> PageFigure:
    """Two scores against each other."""
    figure = figure_of(3.0)
    panel = figure.subplots()
    rows = thinned(a.size)
    panel.plot(a[rows], b[rows], ".", markersize=2.0, color=AFTER)
    panel.set(xlabel=labels[0], ylabel=labels[1])
    return figure


def loadings(points: np.ndarray, names: Sequence[str], label: str) -> PageFigure:
    """Variables in the plane of the first two components or factors (Figs. 7.6b, 7.8b)."""
    figure = figure_of(3.4)
    panel = figure.subplots()
    panel.axhline(0.0, color=BAND, linewidth=0.6)
    panel.axvline(0.0, color=BAND, linewidth=0.6)
    for (x, y), name in zip(points, names, strict=True):
        panel.plot(x, y, "o", markersize=3.0, color=BEFORE if name.startswith("omega") else AFTER)
        panel.annotate(name, (x, y), textcoords="offset points", xytext=(3, 3), fontsize=7.0)
    panel.set(xlabel=f"{label} 1", ylabel=f"{label} 2")
    panel.margins(0.12)
    return figure


def coefficient_bars(
    values: np.ndarray, spread: np.ndarray, names: Sequence[str], axis: str
) -> PageFigure:
    """Coefficients of standardised variables with their spread over the folds (Fig. 7.7)."""
    figure = figure_of(2.6)
    panel = figure.subplots()
    place = np.arange(len(names))
    panel.bar(place, values, yerr=spread, color=AFTER, ecolor=BEFORE, capsize=2.0)
    panel.axhline(0.0, color=BAND, linewidth=0.6)
    panel.set_xticks(place, names, rotation=70, fontsize=7.0)
    panel.set_ylabel(f"coefficient, ω {axis}")
    return figure


def model_error_over_time(
    measured: np.ndarray, models: dict[str, np.ndarray], time: np.ndarray
) -> PageFigure:
    """The model error of each axis and what models make of it (Figs. 7.2, 7.10)."""
    figure = figure_of(4.4)
    panels = figure.subplots(3, 1)
    rows = thinned(time.size)
    for k, (panel, label) in enumerate(zip(panels, ("X [N]", "Y [N]", "N [N·m]"), strict=True)):
        panel.plot(rows, measured[rows, k], color=BAND, linewidth=0.8, label="ω")
        for colour, (name, values) in zip(cycle(COLOURS), models.items(), strict=False):
            panel.plot(rows, values[rows, k], color=colour, linewidth=1.0, label=name)
        panel.set_ylabel(f"ω {label}")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, fontsize=7.5, columnspacing=1.0)
    panels[-1].set_xlabel("sample")
    return figure
