"""The figures of the report. Each is as wide as a phone; the page puts them side by side where it can."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cosim.plots import thin

from ..evidence import Evidence, Seen
from ..weak import EVERY
from ..windows import LENGTH
from .curves import Curve
from .regions import Quantity, Region
from .svg import AFTER, BAND, BEFORE, INK, THIRD, WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

FORCES = ("X [N]", "Y [N]", "N [N·m]")
MOST_POINTS = 3000  # of a track
MARGIN = 0.06  # around a track
SURE = 1.96  # standard deviations, 95 %
QUARTILES = (0.25, 0.5, 0.75)
STRETCH = 0.25  # s of a window in which errors are counted together
MOST_RANKED = 14
WIDE_SPREAD = 20.0  # ratio of scores from which on their axis is logarithmic


def _figure(height: float) -> "Figure":
    from matplotlib.figure import Figure

    return Figure(figsize=(WIDTH, height), layout="constrained")


def _stack(height: float, sharex: bool = True) -> "tuple[Figure, Sequence[Axes]]":
    """Three panels over each other, one for each axis of the ship."""
    figure = _figure(height)
    panels = list(figure.subplots(3, 1, sharex=sharex))
    for panel, label in zip(panels, FORCES, strict=True):
        panel.set_ylabel(f"ω {label}")
    figure.align_ylabels(panels)
    return figure, panels


def _legend(figure: "Figure", panel: "Axes", columns: int = 2) -> None:
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=columns, columnspacing=1.4)


def _plain(axis: "Axis") -> None:
    """Numbers of a logarithmic axis as they are, not as powers."""
    from matplotlib.ticker import FuncFormatter, NullFormatter

    axis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{value:,.0f}".replace(",", " ") if value >= 1.0 else f"{value:g}")
    )
    axis.set_minor_formatter(NullFormatter())


def _breaks(groups: np.ndarray) -> np.ndarray:
    """Where a new group begins, as places to insert a gap."""
    return np.flatnonzero(np.diff(groups)) + 1


def track(e: Evidence, learned: bool) -> "Figure":
    """The measured track of a run, and what the models foretell from the start of each window."""
    eta = e.smoothed.eta
    rows = np.arange(0, len(eta), max(1, len(eta) // MOST_POINTS))
    figure, panel = _map(eta[:, :2])
    panel.plot(eta[rows, 1], eta[rows, 0], color=INK, lw=3.4, alpha=0.3, label="measured")
    if e.windows is not None:
        window, measured = e.windows.sample_window, e.windows.measured
        step = max(1, len(window) // MOST_POINTS)
        for seen, colour, label in _models(e, learned):
            predicted = _finite(measured - seen.off)[::step, :2]
            north, east = np.insert(predicted, _breaks(window[::step]), np.nan, axis=0).T
            panel.plot(east, north, color=colour, lw=1.1, label=label)
        starts = measured[np.r_[0, _breaks(window)]]
        panel.plot(starts[:, 1], starts[:, 0], ".", color=INK, ms=4.0)
    _legend(figure, panel, 3)
    return figure


def worst(e: Evidence, learned: bool) -> "Figure | None":
    """The window whose position the model foretells worst; None where none runs its eight seconds."""
    if e.windows is None or e.before.errors is None:
        return None
    finite = np.where(np.isfinite(e.before.errors.position), e.before.errors.position, -1.0)
    inside = e.windows.sample_window == int(np.argmax(finite))
    measured = e.windows.measured[inside]
    paths = [(_finite(measured - s.off[inside]), c, label) for s, c, label in _models(e, learned)]
    figure, panel = _map(np.concatenate([measured[:, :2], *(p[:, :2] for p, _, _ in paths)]))
    panel.plot(measured[:, 1], measured[:, 0], color=INK, lw=3.4, alpha=0.3, label="measured")
    for predicted, colour, label in paths:
        panel.plot(predicted[:, 1], predicted[:, 0], color=colour, lw=1.5, label=label)
        panel.plot(predicted[-1:, 1], predicted[-1:, 0], "o", color=colour, ms=4.5)
    panel.plot(measured[:1, 1], measured[:1, 0], ".", color=INK, ms=8.0)
    panel.plot(measured[-1:, 1], measured[-1:, 0], "o", color=INK, ms=4.5, mfc="none")
    _legend(figure, panel, 3)
    return figure


def _models(e: Evidence, learned: bool) -> list[tuple[Seen, str, str]]:
    """What each model makes of a run, its colour, and what it is called."""
    if not learned:
        return [(e.before, BEFORE, "predicted")]
    return [(e.before, BEFORE, "before"), (e.after, AFTER, "after")]


def _finite(pose: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(pose), pose, np.nan)


def _map(places: np.ndarray) -> "tuple[Figure, Axes]":
    """A panel with north up that holds all places (n, 2) [m], in the same scale both ways."""
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    middle, reach = 0.5 * (low + high), 0.5 * (high - low)
    # No picture is a thin strip.
    half = np.maximum(reach + MARGIN * reach.max(), 0.4 * reach.max()) + 1e-3
    figure = _figure(float(np.clip(0.75 + (WIDTH - 0.75) * half[0] / half[1], 2.4, 5.2)))
    panel = figure.subplots()
    panel.set_aspect("equal", adjustable="box")
    panel.set_xlim(middle[1] - half[1], middle[1] + half[1])
    panel.set_ylim(middle[0] - half[0], middle[0] + half[0])
    panel.set_xlabel("east [m]")
    panel.set_ylabel("north [m]")
    return figure, panel


def growth(evidence: Sequence[Evidence], learned: bool) -> "Figure":
    """How far predictions of some runs are off, over the time since their windows began."""
    figure = _figure(3.6)
    panels = figure.subplots(2, 1, sharex=True)
    known = [e for e in evidence if e.windows is not None]
    since = np.concatenate([e.windows.since for e in known if e.windows is not None])
    edges = np.arange(0.0, LENGTH + 1e-9, STRETCH)
    place = np.clip(np.digitize(since, edges) - 1, 0, edges.size - 2)
    sides = [_models(e, learned) for e in known]
    for number in range(len(sides[0])):
        off = np.concatenate([models[number][0].off for models in sides])
        _, colour, label = sides[0][number]
        errors = (1e3 * np.hypot(off[:, 0], off[:, 1]), np.degrees(np.abs(off[:, 2])))
        for panel, error in zip(panels, errors, strict=True):
            bands = np.full((3, edges.size - 1), np.nan)
            for k in np.unique(place):
                bands[:, k] = np.quantile(error[place == k], QUARTILES, method="nearest")
            middle = edges[:-1] + 0.5 * STRETCH
            panel.fill_between(middle, bands[0], bands[2], color=colour, alpha=0.2, lw=0.0)
            panel.plot(middle, bands[1], color=colour, label=label)
    for panel, label in zip(panels, ("position [mm]", "heading [°]"), strict=True):
        panel.set_yscale("log")
        _plain(panel.yaxis)
        panel.set_ylabel(label)
    figure.align_ylabels(panels)
    panels[1].set_xlabel("time since the window began [s]")
    panels[1].set_xlim(0.0, LENGTH)
    if learned:
        _legend(figure, panels[0])
    return figure


def model_error(e: Evidence, std: np.ndarray | None, learned: bool) -> "Figure":
    """Omega over time, axis by axis: measured with its uncertainty, and the part that is explained."""
    figure, panels = _stack(4.6)
    time = e.integrals.middle
    for axis, panel in enumerate(panels):
        measured = e.before.omega[:, axis]
        chosen = thin(np.arange(time.size), measured)[0]
        gaps = np.flatnonzero(np.diff(time[chosen]) > 1.5 * EVERY * max(1, time.size // chosen.size)) + 1

        def drawn(
            values: np.ndarray, rows: np.ndarray = chosen, cuts: np.ndarray = gaps
        ) -> np.ndarray:
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
    _legend(figure, panels[0], 3)
    return figure


def where(quantity: Quantity, found: Sequence[Region], learned: bool) -> "Figure":
    """RMS of omega over a quantity, axis by axis."""
    own = len(set(quantity.labels)) > 1
    figure, panels = _stack(5.0 if own else 4.2, sharex=not own)
    for panel, region, label in zip(panels, found, quantity.labels, strict=True):
        if region.unsure is not None:
            panel.stairs(region.unsure, region.edges, fill=True, color=BAND, alpha=0.45, label="noise")
        parts = [("before", region.before, BEFORE, 1.6)]
        parts += [("after", region.after, AFTER, 1.6)] if learned else []
        for name, rms, colour, width in parts:
            known = name if learned else "model error"
            panel.stairs(rms, region.edges, baseline=None, color=colour, lw=width, label=known)
            middle = 0.5 * (region.edges[1:] + region.edges[:-1])
            panel.plot(middle, rms, "o" if name == "before" else "s", color=colour, ms=3.0)
        panel.set_ylim(bottom=0.0)
        if own or panel is panels[2]:
            panel.set_xlabel(label)
    if quantity.edges is not None:
        panels[2].set_xticks(np.linspace(quantity.edges[0], quantity.edges[-1], 5))
    _legend(figure, panels[0], 3)
    return figure


def ranking(ranked: Sequence[Mapping[str, Any]], alike: Sequence[str]) -> "Figure":
    """Candidates by their loss: the best, and hollow those that the data cannot tell from the first."""
    shown = [r for k, r in enumerate(ranked) if k < MOST_RANKED or r["id"] in alike]
    figure = _figure(0.8 + 0.24 * len(shown))
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
    if scores.min() > 0.0 and scores.max() > WIDE_SPREAD * scores.min():
        panel.set_xscale("log")
        _plain(panel.xaxis)
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
    figure = _figure(3.3)
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
    _legend(figure, panel, 2 + len(c.points))
    return figure
