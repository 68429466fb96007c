"""The picture of a ship's path."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..formats.outline import AnnotatedOutline
from ..scenario.roles import Columns
from .canvas import WIDTH, DrawnRun, Runs, arrange, blank, grid, legend, plot
from .lines import distance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

MAX_PATH = 20000  # points of a trajectory; chosen: many laps need more than a line over time
OUTLINES = 12  # ships drawn along a path, chosen
SCALES = (1.0, 0.5, 0.25, 0.125, 0.05, 0.02, 0.01)  # of those ships
# Longest ship, as a share of the picture: in its own length unless the track is hardly longer; chosen
OUTLINE_SHARE = 0.5
DISTANCE = 2.2  # in; height of the distance to the target below the tracks of several runs; chosen
STILL = 0.01  # m; a target that moves less is a point, chosen: below a line's width in most pictures


# North and east [m].
Path = tuple[np.ndarray, np.ndarray]


def _along(x: np.ndarray, y: np.ndarray, step: float, most: int = MAX_PATH) -> Path:
    """The same path with points at equal distances of about ``step`` [m], or ``most`` points."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    count = int(min(way[-1] / step, most)) + 2
    at = np.linspace(0.0, way[-1], count)
    return np.interp(at, way, x), np.interp(at, way, y)


def once(paths: Sequence[Path], size: float) -> Path:
    """Paths with each part only once, for any number of laps or runs along it.

    Laps laid over each other would close the gaps of a dashed line.

    Args:
        paths: north and east [m] of each path.
        size: of the picture [m].

    Returns:
        North and east [m], with NaN between parts that are not connected.
    """
    step = size / 500.0
    parts = [_along(x, y, step, 10 * MAX_PATH) for x, y in paths]
    x = np.concatenate([np.append(north, np.nan) for north, _ in parts])
    y = np.concatenate([np.append(east, np.nan) for _, east in parts])
    direction = np.concatenate([np.arctan2(np.gradient(e), np.gradient(n)) for n, e in parts])
    direction = np.insert(direction, np.cumsum([n.size for n, _ in parts]), np.nan)
    cell = 3.0 * step
    column = (x - np.nanmin(x)) // cell
    row = (y - np.nanmin(y)) // cell
    place = (column * 2.0**16 + row) * 8.0 + (direction % np.pi) // (np.pi / 6.0)
    _, first, which = np.unique(place, return_index=True, return_inverse=True)
    again = np.arange(x.size) - first[which] > 12
    return np.where(again, np.nan, x), np.where(again, np.nan, y)


def hulls(poses: np.ndarray, outline: "ArrayLike") -> np.ndarray:
    """The hull from above at some poses.

    Args:
        poses: (n, 3), north, east [m] and heading [rad].
        outline: its corners (forward, to starboard) [m, m].

    Returns:
        Corners, east then north [m]: (n, corners, 2).
    """
    x, y, psi = np.asarray(poses).T[:, :, None]
    forward, starboard = np.array(outline).T
    north = x + np.cos(psi) * forward - np.sin(psi) * starboard
    east = y + np.sin(psi) * forward + np.cos(psi) * starboard
    return np.stack([east, north], axis=2)


def outlines(run: DrawnRun, outline: AnnotatedOutline, scale: float) -> np.ndarray:
    """Hulls at equal distances in time, except where one is drawn already.

    Args:
        run: with time [s] and pose [m, m, rad].
        outline: of the ship.
        scale: of the drawn hull.

    Returns:
        Corners, east then north [m]: (at most OUTLINES, corners, 2).
    """
    time = run.log["time"]
    rows = np.searchsorted(time, np.linspace(time[0], time[-1], OUTLINES)).clip(0, time.size - 1)
    drawn: list[np.ndarray] = []
    length = scale * outline.length
    for pose in np.stack([run.log[name][rows] for name in run.stated.roles.pose], axis=1):
        if not any(np.all(np.abs(pose - other) < (length, length, 1.0)) for other in drawn):
            drawn.append(pose)
    return hulls(np.array(drawn), scale * np.array(outline.corners))


def _limits(values: Sequence[np.ndarray]) -> tuple[float, float]:
    low = min(float(v.min()) for v in values)
    high = max(float(v.max()) for v in values)
    return 0.5 * (low + high), high - low


def trajectory(runs: Runs) -> "Figure":
    """Path of ship and target, north over east; of several runs also the distance to the target.

    Two tracks that differ by millimetres are one line on a map.
    """
    from matplotlib.collections import PolyCollection

    paths = [_path(run, run.stated.roles.pose) for run in runs]
    targets = [
        _path(run, run.stated.roles.target) for run in runs if run.stated.roles.target[0] in run.log
    ]
    norths, easts = zip(*paths, *targets, strict=True)
    (north, tall), (east, wide) = _limits(norths), _limits(easts)
    size = max(tall, wide, STILL)
    # Neither side so short that the picture becomes a strip, and room for the ships.
    tall, wide = (max(span, 0.4 * size) + 0.16 * size for span in (tall, wide))
    high, below = min(max(6.5 * tall / wide, 3.0), 9.0) + 1.0, DISTANCE * (1 < len(runs) == len(targets))
    figure = blank(WIDTH, high + below)
    panel, *others = figure.subplots(
        2 if below else 1, height_ratios=[high, below][: 2 if below else 1], squeeze=False
    ).flat
    for each in (panel, *others):
        grid(each)
    for each in others:
        for run in runs:
            plot(each, run, distance(run))
        each.set(xlabel="time [s]", ylabel="distance to target [m]", ylim=(0.0, None))
    panel.set(
        xlabel="east y [m]",
        ylabel="north x [m]",
        xlim=(east - 0.5 * wide, east + 0.5 * wide),
        ylim=(north - 0.5 * tall, north + 0.5 * tall),
        aspect="equal",
    )
    longest = max((run.stated.outline.length for run in runs if run.stated.outline), default=0.0)
    scale = next((s for s in SCALES if s * longest < OUTLINE_SHARE * size), SCALES[-1])
    for run, path in zip(runs, paths, strict=True):
        x, y = _along(*path, size / 1000.0)
        panel.plot(y, x, label=run.label, **{**run.line, "linewidth": 1.8})
        if run.stated.outline is not None:
            ships = PolyCollection(
                list(outlines(run, run.stated.outline, scale)),
                facecolors=(run.line["color"], 0.15 / len(runs)),
                edgecolors=run.line["color"],
                linewidths=0.7,
                zorder=2.5,
            )
            panel.add_collection(ships, autolim=False)
    for k, (north_0, east_0) in enumerate((x[0], y[0]) for x, y in paths):
        panel.plot(
            east_0,
            north_0,
            "o",
            markerfacecolor="white",
            markeredgecolor="black",
            zorder=4,
            label=None if k else "start",
        )
    if targets:
        _target(panel, targets, size)
    period = (runs[0].log["time"][-1] - runs[0].log["time"][0]) / (OUTLINES - 1)
    ratio = "full length" if scale == 1.0 else f"1:{1.0 / scale:g}"
    stated = f"ships drawn {ratio}, every {period:.3g} s" if longest else ""
    panel.set_title(stated, loc="right", fontsize=8, color="0.4")
    legend(figure, panel, len(runs) + 2)
    return arrange(figure)


def _path(run: DrawnRun, columns: Columns) -> Path:
    return run.log[columns[0]], run.log[columns[1]]


def _target(panel: "Axes", paths: Sequence[Path], size: float) -> None:
    """Draw the targets: a dashed line where they move, a cross where they do not."""
    line = {"color": "black", "zorder": 3, "label": "target"}
    moving = [path for path in paths if max(np.ptp(path[0]), np.ptp(path[1])) > STILL]
    if moving:
        x, y = once(moving, size)
        panel.plot(y, x, dashes=(6, 6), linewidth=0.9, **line)
        line["label"] = None
    points = [(x[0], y[0]) for x, y in paths if max(np.ptp(x), np.ptp(y)) <= STILL]
    if points:
        x, y = np.array(points).T
        panel.plot(y, x, "+", markersize=12, markeredgewidth=1.5, **{**line, "zorder": 5})
