"""Figures of measured and predicted tracks, and of the growth of the prediction error."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cosim.results import hulls
from fmus.ops import wrap
from fmus.ship import Ship

from ..predictors.evaluation import LEVELS, Evaluation, PredictionError
from .panels import ABOVE, BELOW, LEFT, RIGHT, breaks, legend, panels_of, plain_numbers, polygons
from .profiles import heading, window_mean
from .svg import AFTER, BEFORE, INK, THIRD, WIDTH

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_POINTS = 3000  # of a track; chosen, keeps a page below a megabyte or so
MARGIN = 0.06  # of the reach, around a track; chosen
MIN_ASPECT = 0.4  # shorter side of a map by its longer one; chosen
MAX_REACH = 2.0  # times the measured extent, beyond which a prediction leaves the figure; chosen
QUARTILES = (0.25, 0.5, 0.75)
ARROWS, ARROW = 80, 0.15  # of a force: how many, and the longest as a share of the reach; chosen
SHIP = 0.5  # longest ship, as a share of a map; chosen
BINS = 32  # parts of a window over which errors are summarised; chosen


def track(e: Evaluation, learned: bool) -> "Figure":
    """The measured track of a run, and the predictions of the models from the start of each window."""
    eta = e.smoothed.eta
    rows = np.arange(0, len(eta), max(1, len(eta) // MAX_POINTS))
    figure, panel = _map(eta[:, :2])
    panel.plot(eta[rows, 1], eta[rows, 0], color=INK, lw=3.4, alpha=0.3, label="measured")
    if e.windows is not None:
        window, measured = e.windows.sample_window, e.windows.measured
        step = max(1, len(window) // MAX_POINTS)
        for prediction, colour, label in _models(e, learned):
            predicted = _finite(measured - prediction.residuals)[::step, :2]
            north, east = np.insert(predicted, breaks(window[::step]), np.nan, axis=0).T
            panel.plot(east, north, color=colour, lw=1.0, alpha=0.85, label=label)
        starts = measured[np.r_[0, breaks(window)]]
        panel.plot(starts[:, 1], starts[:, 0], ".", color=INK, ms=4.0)
        _ships(panel, starts, e.model.ship)
    legend(figure, panel, 3)
    return figure


def free(e: Evaluation) -> "Figure":
    """A whole run, predicted by the models from its first state."""
    measured = e.smoothed.eta[:, :2]
    low, high = np.nanmin(measured, axis=0), np.nanmax(measured, axis=0)
    far = MAX_REACH * (high - low).max()
    before, after = e.free_runs()[1]
    paths = [(before[:, :2], BEFORE, "before" if e.learned else "predicted")]
    paths += [(after[:, :2], AFTER, "after")] if e.learned else []
    near = [np.clip(_finite(path), low - far, high + far) for path, _, _ in paths]
    figure, panel = _map(np.concatenate([measured, *near]))
    panel.plot(measured[:, 1], measured[:, 0], color=INK, lw=3.4, alpha=0.3, label="measured")
    for path, colour, label in paths:
        rows = np.arange(0, len(path), max(1, len(path) // MAX_POINTS))
        panel.plot(_finite(path)[rows, 1], _finite(path)[rows, 0], color=colour, lw=1.2, label=label)
    panel.plot(measured[:1, 1], measured[:1, 0], ".", color=INK, ms=8.0)
    legend(figure, panel, 3)
    return figure


def place(e: Evaluation, learned: bool, stretches: Sequence[tuple[float, float]] = ()) -> "Figure":
    """The force that the model lacks as arrows along the track, over north and east.

    Args:
        e: the run.
        learned: whether something was; then the force that is left is drawn as well.
        stretches: begin and end [s] of parts that are marked; then only what is left is drawn.
    """
    eta, time = e.smoothed.eta, e.smoothed.time
    rows = np.arange(0, len(eta), max(1, len(eta) // MAX_POINTS))
    shown = np.linspace(0, e.weak_windows.middle.size - 1, ARROWS).astype(int)
    at = window_mean(e.weak_windows, eta[:, :2])[shown]
    psi = np.radians(heading(e.weak_windows))[shown]
    c, s = np.cos(psi), np.sin(psi)
    models = _models(e, learned)[-1 if stretches else 0 :]
    forces = [p.omega[shown] for p, _, _ in models]
    most = max(float(np.hypot(f[:, 0], f[:, 1]).max()) for f in forces) or 1.0
    reach = ARROW * np.ptp(eta[np.isfinite(eta[:, 0]), :2], axis=0).max() / most
    arrows = [
        reach * np.column_stack([c * X - s * Y, s * X + c * Y]) for X, Y in (f[:, :2].T for f in forces)
    ]
    figure, panel = _map(np.concatenate([eta[:, :2], *(at + arrow for arrow in arrows)]))
    panel.plot(eta[rows, 1], eta[rows, 0], color=INK, lw=1.0, alpha=0.3, label="track")
    for k, (begin, end) in enumerate(stretches):
        part = (time >= begin) & (time <= end)
        label = None if k else "pushed"
        panel.plot(eta[part, 1], eta[part, 0], color=THIRD, lw=4.0, alpha=0.6, label=label)
    for arrow, (_, colour, label) in zip(arrows, models, strict=True):
        panel.quiver(
            *at.T[::-1], *arrow.T[::-1], color=colour, angles="xy", scale_units="xy", scale=1.0,
            width=0.004, label=label,
        )  # fmt: skip
    panel.set_title(f"longest arrow {most:.2g} N", loc="right", fontsize="medium")
    legend(figure, panel, 4)
    return figure


def worst_of(e: Evaluation) -> int | None:
    """The window with the largest position error of the initial model; None where there is no window."""
    if e.windows is None or e.before.errors is None:
        return None
    return int(
        np.argmax(np.where(np.isfinite(e.before.errors.position), e.before.errors.position, -1.0))
    )


def heading_bands(e: Evaluation) -> "Figure | None":
    """Heading over the worst window, with the bands of the learned model; None where there are none."""
    worst = worst_of(e)
    if worst is None or e.windows is None or e.bands is None:
        return None
    inside = e.windows.sample_window == worst
    since, predicted = e.windows.since[inside], e.bands.predicted[worst, :, 2]
    centre = np.interp(since, e.bands.since, predicted)
    figure, (panel,) = panels_of(2.4)
    measured = centre + wrap(e.windows.measured[inside, 2] - centre)
    panel.plot(since, np.degrees(measured), color=INK, lw=3.4, alpha=0.3, label="measured")
    panel.plot(e.bands.since, np.degrees(predicted), color=AFTER, lw=1.5, label="after")
    for level in LEVELS:
        low, high = np.degrees(e.bands.headings(worst, level))
        panel.fill_between(e.bands.since, low, high, color=AFTER, alpha=0.15, lw=0.0)
    panel.set_xlabel("time since the window began [s]")
    panel.set_ylabel("heading [°]")
    legend(figure, panel, 2)
    return figure


def worst_window(e: Evaluation, learned: bool) -> "Figure | None":
    """The worst window, with the bands of the learned model; None where there is no window."""
    worst = worst_of(e)
    if worst is None or e.windows is None:
        return None
    inside = e.windows.sample_window == worst
    measured = e.windows.measured[inside]
    paths = [(_finite(measured - p.residuals[inside]), c, label) for p, c, label in _models(e, learned)]
    low, high = measured.min(axis=0), measured.max(axis=0)
    far = MAX_REACH * (high - low).max()
    near = [np.clip(p, low - far, high + far) for p, _, _ in paths]
    figure, panel = _map(np.concatenate([measured, *near])[:, :2])
    panel.plot(measured[:, 1], measured[:, 0], color=INK, lw=3.4, alpha=0.3, label="measured")
    if e.bands is not None:
        ellipses = [at for level in LEVELS for at in e.bands.ellipses(worst, level)[..., ::-1]]
        polygons(panel, ellipses, facecolors=paths[-1][1], alpha=0.08, linewidths=0.0)
    for predicted, colour, label in paths:
        panel.plot(predicted[:, 1], predicted[:, 0], color=colour, lw=1.5, label=label)
        panel.plot(predicted[-1:, 1], predicted[-1:, 0], "o", color=colour, ms=4.5)
    panel.plot(measured[:1, 1], measured[:1, 0], ".", color=INK, ms=8.0)
    panel.plot(measured[-1:, 1], measured[-1:, 0], "o", color=INK, ms=4.5, mfc="none")
    _ships(panel, measured[[0, -1]], e.model.ship)
    legend(figure, panel, 3)
    return figure


def error_growth(evaluations: Sequence[Evaluation], learned: bool) -> "Figure":
    """Quartiles of the prediction error of some runs over the time since their windows began."""
    figure, panels = panels_of(3.6, 2)
    known = [e for e in evaluations if e.windows is not None]
    windows = [e.windows for e in known if e.windows is not None]
    since = np.concatenate([w.since for w in windows])
    edges = np.linspace(0.0, windows[0].length, BINS + 1)
    place = np.clip(np.digitize(since, edges) - 1, 0, edges.size - 2)
    sides = [_models(e, learned) for e in known]
    for number in range(len(sides[0])):
        residuals = np.concatenate([models[number][0].residuals for models in sides])
        _, colour, label = sides[0][number]
        errors = (1e3 * np.hypot(residuals[:, 0], residuals[:, 1]), np.degrees(np.abs(residuals[:, 2])))
        for panel, error in zip(panels, errors, strict=True):
            bands = np.full((3, edges.size - 1), np.nan)
            for k in np.unique(place):
                bands[:, k] = np.quantile(error[place == k], QUARTILES, method="nearest")
            middle = 0.5 * (edges[:-1] + edges[1:])
            panel.fill_between(middle, bands[0], bands[2], color=colour, alpha=0.2, lw=0.0)
            panel.plot(middle, bands[1], color=colour, label=label)
    for panel, label in zip(panels, ("position [mm]", "heading [°]"), strict=True):
        panel.set_yscale("log")
        plain_numbers(panel.yaxis)
        panel.set_ylabel(label)
    panels[1].set_xlabel("time since the window began [s]")
    panels[1].set_xlim(0.0, edges[-1])
    if learned:
        legend(figure, panels[0])
    return figure


def _models(e: Evaluation, learned: bool) -> list[tuple[PredictionError, str, str]]:
    """Prediction error, colour and label of each model of a run."""
    if not learned:
        return [(e.before, BEFORE, "predicted")]
    return [(e.before, BEFORE, "before"), (e.after, AFTER, "after")]


def _ships(panel: "Axes", poses: np.ndarray, of: Ship) -> None:
    """The ship in its own length at some poses, if that leaves something of the track to see."""
    room = max(np.ptp(panel.get_xlim()), np.ptp(panel.get_ylim()))
    outline = of.vessel.outline
    drawn = [] if outline is None else hulls(poses, outline.corners)
    fitting = [corners for corners in drawn if np.ptp(corners, axis=0).max() < SHIP * room]
    polygons(panel, fitting, facecolors="none", edgecolors=INK, linewidths=0.5, alpha=0.4)


def _finite(pose: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(pose), pose, np.nan)


def _map(places: np.ndarray) -> "tuple[Figure, Axes]":
    """A panel with north up that holds all places (n, 2) [m], in the same scale both ways."""
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    middle, reach = 0.5 * (low + high), 0.5 * (high - low)
    half = np.maximum(reach + MARGIN * reach.max(), MIN_ASPECT * reach.max()) + 1e-3
    figure, (panel,) = panels_of(
        float(np.clip(BELOW + ABOVE + (WIDTH - LEFT - RIGHT) * half[0] / half[1], 2.4, 5.2))
    )
    panel.set_aspect("equal", adjustable="box")
    panel.set_xlim(middle[1] - half[1], middle[1] + half[1])
    panel.set_ylim(middle[0] - half[0], middle[0] + half[0])
    panel.set_xlabel("east [m]")
    panel.set_ylabel("north [m]")
    return figure, panel
