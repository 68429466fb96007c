"""Charts of measured and predicted tracks, and of the growth of the prediction error."""

from collections.abc import Sequence

import numpy as np

from cosim.results import hulls
from fmus.ops import wrap
from fmus.ship import Ship

from ...assessment.covariates import means_of_run
from ...execution.short_text import SHOWN
from ...predictors.evaluation import LEVELS, Evaluation, PredictionError
from ...predictors.shooting import INSTANTS
from .chart import AFTER, BEFORE, INK, LINE, MARGIN, ROW, THIRD, WIDTH, Chart, ChartAxis, Panel
from .figures import interrupted


def track(e: Evaluation, learned: bool) -> Chart:
    """The measured track of a run, and the predictions of the models from the start of each window."""
    eta = e.smoothed.eta
    panel = _map(eta[:, :2])
    _broad(panel, *_east_north(eta))
    if e.windows is not None:
        window, measured = e.windows.sample_window, e.windows.measured
        for prediction, colour, label in _models(e, learned):
            parts = interrupted(_finite(measured - prediction.residuals), window)
            panel.draw(*_east_north(parts), colour, label)
        starts = measured[np.r_[0, np.flatnonzero(np.diff(window)) + 1]]
        panel.draw(*_east_north(starts), INK, dots=True)
        _ships(panel, starts, e.model.ship)
    return _chart(panel)


def free(e: Evaluation, found: str = "") -> Chart:
    """A whole run, predicted by the models from its first state."""
    measured = e.smoothed.eta[:, :2]
    paths = [p[:, :2] for p in e.free_runs()[1]][: 2 if e.learned else 1]
    panel = _map(_around(measured, paths))
    panel.x.label += f"\n{found}" if found else ""
    _broad(panel, *_east_north(measured))
    for path, (_, colour, label) in zip(paths, _models(e, bool(e.learned)), strict=True):
        predicted = label if label == "predicted" else f"predicted {label}"
        panel.draw(*_east_north(_finite(path)), colour, predicted)
    panel.draw(*_east_north(measured[:1]), INK, dots=True)
    return _chart(panel)


def place(e: Evaluation, learned: bool, stretches: Sequence[tuple[float, float]] = ()) -> Chart:
    """The force that the model lacks as lines from places of the track, over north and east.

    Args:
        e: the run.
        learned: whether something was; then the force that is left is drawn as well.
        stretches: begin and end [s] of parts that are marked; then only what is left is drawn.
    """
    eta, time = e.smoothed.eta, e.smoothed.time
    shown = np.linspace(0, e.weak_windows.middle.size - 1, 4 * INSTANTS).astype(int)
    *_, headings, places = means_of_run(e.weak_windows)
    at, psi = places[shown], headings[shown]
    c, s = np.cos(psi), np.sin(psi)
    models = _models(e, learned)[-1 if stretches else 0 :]
    forces = [p.omega[shown, :2].T for p, _, _ in models]
    most = max(float(np.hypot(*f).max()) for f in forces) or 1.0
    reach = 2 * MARGIN * np.ptp(eta[np.isfinite(eta[:, 0]), :2], axis=0).max() / most
    tips = [at + reach * np.column_stack([c * X - s * Y, s * X + c * Y]) for X, Y in forces]
    panel = _map(np.concatenate([eta[:, :2], *tips]))
    _broad(panel, *_east_north(eta), "track")
    for k, (begin, end) in enumerate(stretches):
        part = eta[(time >= begin) & (time <= end)]
        panel.draw(*_east_north(part), THIRD, "" if k else "pushed", width=2 * LINE)
    for tip, (_, colour, label) in zip(tips, models, strict=True):
        sticks = np.stack([at, tip, np.full_like(at, np.nan)], axis=1)
        panel.draw(*_east_north(sticks.reshape(-1, 2)), colour, label)
    panel.x.label += f"\nlongest line from the track: {most:.2g} N"
    return _chart(panel)


def worst_of(e: Evaluation) -> int | None:
    """The window with the largest position error of the initial model; None where there is no window."""
    if e.windows is None or e.before.errors is None:
        return None
    off = e.before.errors.position
    return int(np.argmax(np.where(np.isfinite(off), off, -1.0)))


def heading_bands(e: Evaluation) -> Chart | None:
    """Heading over the worst window, with the bands of the learned model; None where there are none."""
    if (worst := worst_of(e)) is None or e.windows is None or e.bands is None:
        return None
    inside = e.windows.sample_window == worst
    since, predicted = e.windows.since[inside], e.bands.predicted[worst, :, 2]
    centre = np.interp(since, e.bands.since, predicted)
    panel = Panel(ChartAxis("time since the start of the window [s]"), ChartAxis("heading [°]"))
    _broad(panel, since, np.degrees(centre + wrap(e.windows.measured[inside, 2] - centre)))
    panel.draw(e.bands.since, np.degrees(predicted), AFTER, "after")
    for level in LEVELS:
        low, high = np.degrees(e.bands.headings(worst, level))
        panel.fill(e.bands.since, low, high, AFTER)
    return Chart(WIDTH / 2, [panel])


def worst_window(e: Evaluation, learned: bool) -> Chart | None:
    """The worst window, with the bands of the learned model; None where there is no window."""
    if (worst := worst_of(e)) is None or e.windows is None:
        return None
    inside = e.windows.sample_window == worst
    measured = e.windows.measured[inside]
    paths = [(_finite(measured - p.residuals[inside]), c, label) for p, c, label in _models(e, learned)]
    panel = _map(_around(measured[:, :2], [p[:, :2] for p, _, _ in paths]))
    _broad(panel, *_east_north(measured))
    for around in [] if e.bands is None else [e.bands.ellipses(worst, level) for level in LEVELS]:
        around = _some(around, 2 * SHOWN // len(LEVELS))
        closed = np.insert(around, around.shape[1], np.nan, axis=1).reshape(-1, 2)
        panel.draw(*_east_north(closed), AFTER, area=True, faint=True)
    for predicted, colour, label in paths:
        panel.draw(*_east_north(predicted), colour, label)
        panel.draw(*_east_north(predicted[-1:]), colour, dots=True)
    panel.draw(*_east_north(measured[:1]), INK, dots=True)
    panel.draw(*_east_north(measured[-1:]), INK, dots=True, hollow=True)
    _ships(panel, measured[[0, -1]], e.model.ship)
    return _chart(panel)


def error_growth(evaluations: Sequence[Evaluation], learned: bool) -> Chart:
    """Quartiles of the prediction error of some runs over the time since their windows began."""
    known = [e for e in evaluations if e.windows is not None]
    windows = [e.windows for e in known if e.windows is not None]
    since = np.concatenate([w.since for w in windows])
    parts = 2 * INSTANTS
    edges = np.linspace(0.0, windows[0].length, parts + 1)
    middle = (edges[:-1] + edges[1:]) / 2
    part = np.clip(np.digitize(since, edges) - 1, 0, parts - 1)
    time = ChartAxis("time since the start of the window [s]", (0.0, edges[-1]))
    position = Panel(
        ChartAxis(limits=time.limits, shown=False), ChartAxis("position [mm]", scale=np.log10)
    )
    panels = (position, Panel(time, ChartAxis("heading [°]", scale=np.log10)))
    for models in zip(*(_models(e, learned) for e in known), strict=True):
        residuals = np.concatenate([p.residuals for p, _, _ in models])
        _, colour, label = models[0]
        errors = (1e3 * np.hypot(residuals[:, 0], residuals[:, 1]), np.degrees(np.abs(residuals[:, 2])))
        for panel, error in zip(panels, errors, strict=True):
            bands, quarters = np.full((3, parts), np.nan), np.linspace(0.0, 1.0, 5)
            for k in np.unique(part):
                bands[:, k] = np.quantile(error[part == k], quarters[1:-1], method="nearest")
            panel.fill(middle, bands[0], bands[2], colour)
            panel.draw(middle, bands[1], colour, label if learned else "")
    return Chart(WIDTH, panels)


def _models(e: Evaluation, learned: bool) -> list[tuple[PredictionError, str, str]]:
    """Prediction error, colour and label of each model of a run."""
    before = (e.before, BEFORE, "before" if learned else "predicted")
    return [before, (e.after, AFTER, "after")] if learned else [before]


def _ships(panel: Panel, poses: np.ndarray, of: Ship) -> None:
    """The ship in its own length at some poses, if that leaves something of the track to see."""
    room = max(high - low for low, high in panel.ends())
    outline = of.vessel.outline
    for corners in [] if outline is None else hulls(_some(poses, 2 * SHOWN), outline.corners):
        if 2 * np.ptp(corners, axis=0).max() < room:
            east, north = np.vstack([corners, corners[:1]]).T
            panel.draw(east, north, INK, width=LINE / 2)


def _some(items: np.ndarray, most: int) -> np.ndarray:
    """At most so many of all (n, ...), at equal distances, the last one among them."""
    return items[np.linspace(items.shape[0] - 1, 0, min(most, items.shape[0])).astype(int)]


def _broad(panel: Panel, x: np.ndarray, y: np.ndarray, label: str = "measured") -> None:
    """What was measured, below what is predicted."""
    panel.draw(x, y, INK, label, width=2 * LINE, faint=True)


def _finite(pose: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(pose), pose, np.nan)


def _east_north(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a map has across and up, of poses (n, 2 or more)."""
    return pose[:, 1], pose[:, 0]


def _around(measured: np.ndarray, paths: Sequence[np.ndarray]) -> np.ndarray:
    """Places (n, 2) that a map holds: all measured ones, and predicted ones that are not too far."""
    low, high = np.nanmin(measured, axis=0), np.nanmax(measured, axis=0)
    far = (high - low).max()
    return np.concatenate([measured, *(np.clip(_finite(p), low - far, high + far) for p in paths)])


def _map(places: np.ndarray) -> Panel:
    """A panel with north up that holds all places (n, 2) [m], in the same scale both ways."""
    low, high = np.nanmin(places, axis=0), np.nanmax(places, axis=0)
    middle, reach = (low + high) / 2, (high - low) / 2
    most = reach.max() or 1.0
    half = np.maximum(reach + MARGIN * most, most / 2)  # no narrower than half of its height
    north, east = zip((middle - half).tolist(), (middle + half).tolist(), strict=True)
    return Panel(ChartAxis("east [m]", east), ChartAxis("north [m]", north), equal=True)


def _chart(panel: Panel) -> Chart:
    """A map, as high as it is wide, within bounds."""
    (west, east), (south, north) = panel.ends()
    height = WIDTH * (north - south) / (east - west)
    return Chart(float(np.clip(height, WIDTH / 2, WIDTH)) + 2 * ROW, [panel])
