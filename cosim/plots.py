"""Pictures of one run, or of several laid over each other: ``python -m cosim.plots DIR... --out DIR``.

The five of the thesis, 5.1.

Matplotlib is imported only when a picture is drawn, and without pyplot: nothing here needs a display
or leaves global state behind.
"""

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .command import run_command
from .errors import InputError
from .files import whole
from .log import read_log
from .metrics import (
    AXES,
    OMEGA,
    OMEGA_HAT,
    POSE,
    TARGET,
    TAU,
    TAU_CMD,
    TAU_LIN,
    TAU_NONLIN,
    VELOCITY,
    Log,
    MetricsError,
    cross_track,
    over_time,
    wrap,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DPI = 150
WIDTH = 8.0  # of a picture [in]
MAX_POINTS = 2000  # of a line over time
MAX_PATH = 20000  # points of a trajectory: many laps need more
LARGEST = 1e9  # values beyond are left out, as those that are not finite

# The thesis' lines, 5.3, then matplotlib's colours.
LINES = (("blue", "-"), ("green", "--"), ("red", "--"), ("magenta", "-."))
MORE_COLORS = ("tab:orange", "tab:brown", "tab:cyan", "tab:olive", "tab:purple", "tab:gray")

HULL_LENGTH = 1.105  # m
HULL_WIDTH = 0.248  # m
# Corners of the hull seen from above, forward and to starboard of its middle, in lengths and widths.
HULL = ((0.5, 0.0), (0.22, 0.5), (-0.5, 0.42), (-0.5, -0.42), (0.22, -0.5))
OUTLINES = 12  # ships drawn along a path
SCALES = (1.0, 0.5, 0.25, 0.125, 0.05, 0.02, 0.01)  # of those ships
OUTLINE_SHARE = 0.1  # longest ship, as a share of the picture
LETTERS_PER_INCH = 12  # of a legend
STILL = 0.01  # m; a target that moves less is a point


class Run(NamedTuple):
    """One run as a picture shows it."""

    label: str
    log: Log
    line: dict[str, Any]


Runs = Sequence[Run]


def draw(
    runs: Mapping[str, Log],
    folder: str | Path,
    start: float | None = None,
    stop: float | None = None,
) -> list[Path]:
    """Draw every picture for which at least one log has the columns.

    Args:
        runs: label -> log; several logs are laid over each other.
        folder: where the PNG files go, made when missing.
        start, stop: the part of the runs that the picture of the metrics covers [s]; None is all.

    Returns:
        The files written, among trajectory.png, errors.png, metrics.png, forces.png and
        model_error.png.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    window = {"start": start, "stop": stop}
    written = []
    for name, (choices, picture) in PICTURES.items():
        able = [
            Run(label.replace("$", r"\$"), part, _line(k))
            for k, (label, log) in enumerate(runs.items())
            if (part := _usable(log, choices)) is not None
        ]
        if not able:
            continue
        file = folder / f"{name}.png"
        try:
            figure = picture(able, **window) if picture is metrics else picture(able)
        except MetricsError:  # nothing happened in the window
            continue
        _save(figure, file)
        written.append(file)
    return written


def _line(k: int) -> dict[str, Any]:
    """How the k-th run is drawn."""
    if k < len(LINES):
        color, style = LINES[k]
        return {"color": color, "linestyle": style, "linewidth": 1.2}
    return {
        "color": MORE_COLORS[(k - len(LINES)) % len(MORE_COLORS)],
        "linestyle": "-",
        "linewidth": 1.2,
    }


def _usable(log: Log, choices: Sequence[Sequence[str]]) -> Log | None:
    """The columns of the first choice that the log has, without rows that cannot be drawn."""
    for columns in choices:
        if all(name in log for name in columns):
            part = {name: np.asarray(log[name], float) for name in ("time", *columns)}
            good = np.all([np.abs(values) < LARGEST for values in part.values()], axis=0)
            if np.count_nonzero(good) < 2:
                return None
            return part if good.all() else {name: values[good] for name, values in part.items()}
    return None


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


def _figure(width: float, height: float) -> "Figure":
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    layout = ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.06)  # in
    return Figure(figsize=(width, height), dpi=DPI, layout=layout)


def _panels(
    rows: int, columns: int, height: float, width: float = WIDTH, sharey: Any = False
) -> "tuple[Figure, np.ndarray]":
    """A figure with a grid of panels over a common time axis."""
    figure = _figure(width, height)
    panels = figure.subplots(rows, columns, sharex=True, sharey=sharey, squeeze=False)
    for panel in panels.flat:
        _grid(panel)
        panel.margins(x=0.01)
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    return figure, panels


def _grid(panel: "Axes") -> None:
    panel.grid(visible=True, color="0.88", linewidth=0.6)
    panel.set_axisbelow(True)
    panel.spines[["top", "right"]].set_visible(False)


def _legend(figure: "Figure", panel: "Axes", entries: int) -> None:
    """A legend above the panels, for all of them, in as many columns as its labels leave room for."""
    handles, labels = panel.get_legend_handles_labels()
    widest = max(map(len, labels), default=0) + 6
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=max(1, min(entries, int(figure.get_figwidth() * LETTERS_PER_INCH / widest))),
        columnspacing=1.5,
        frameon=False,
    )


def _plot(panel: "Axes", run: Run, values: np.ndarray, **line: Any) -> None:
    time, values = thin(run.log["time"], values)
    panel.plot(time, values, **{"label": run.label, **run.line, **line})


def _finish(figure: "Figure", panels: np.ndarray, runs: Runs, least: float = 0.0) -> "Figure":
    """Align the labels, name the runs and keep a flat line from filling its panel with rounding."""
    for panel in panels.flat:
        low, high = panel.get_ylim()
        if high - low < least:
            middle = 0.5 * (low + high)
            panel.set_ylim(middle - 0.5 * least, middle + 0.5 * least)
    figure.align_ylabels(panels)
    if len(runs) > 1:
        _legend(figure, panels[0, 0], len(runs))
    return figure


def _norm(log: Log, names: Sequence[str]) -> np.ndarray:
    return np.sqrt(sum((log[name] ** 2 for name in names), np.zeros_like(log["time"])))


def _save(figure: "Figure", file: Path) -> None:
    """Write a figure, whole or not at all."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    FigureCanvasAgg(figure)
    with whole(file) as scratch:
        figure.savefig(scratch, format="png", dpi=DPI)


def _along(
    x: np.ndarray, y: np.ndarray, step: float, most: int = MAX_PATH
) -> tuple[np.ndarray, np.ndarray]:
    """The same path with points at equal distances of about ``step`` [m], or ``most`` points."""
    way = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    count = int(min(way[-1] / step, most)) + 2
    at = np.linspace(0.0, way[-1], count)
    return np.interp(at, way, x), np.interp(at, way, y)


def once(paths: Sequence[tuple[np.ndarray, np.ndarray]], size: float) -> tuple[np.ndarray, np.ndarray]:
    """Paths with each part only once, however many laps or runs follow it.

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


def outlines(log: Log, length: float) -> np.ndarray:
    """Hulls at equal distances in time, but not where the ship lies as in one drawn before.

    Args:
        log: with time [s] and the vessel's pose [m, m, rad].
        length: of the drawn hull [m].

    Returns:
        Corners, east then north [m]: (at most OUTLINES, corners, 2).
    """
    time = log["time"]
    rows = np.searchsorted(time, np.linspace(time[0], time[-1], OUTLINES)).clip(0, time.size - 1)
    drawn: list[np.ndarray] = []
    for pose in np.stack([log[name][rows] for name in POSE], axis=1):
        if not any(np.all(np.abs(pose - other) < (length / 4, length / 4, 0.2)) for other in drawn):
            drawn.append(pose)
    x, y, psi = np.array(drawn).T[:, :, None]
    forward, starboard = length * np.array(HULL).T * [[1.0], [HULL_WIDTH / HULL_LENGTH]]
    north = x + np.cos(psi) * forward - np.sin(psi) * starboard
    east = y + np.sin(psi) * forward + np.cos(psi) * starboard
    return np.stack([east, north], axis=2)


def _limits(values: Sequence[np.ndarray]) -> tuple[float, float]:
    low = min(float(v.min()) for v in values)
    high = max(float(v.max()) for v in values)
    return 0.5 * (low + high), high - low


def trajectory(runs: Runs) -> "Figure":
    """Path of ship and target, north over east."""
    from matplotlib.collections import PolyCollection

    aims = [run.log for run in runs if TARGET[0] in run.log]
    norths = [run.log["vessel.x"] for run in runs] + [log["guidance.x_t"] for log in aims]
    easts = [run.log["vessel.y"] for run in runs] + [log["guidance.y_t"] for log in aims]
    (north, tall), (east, wide) = _limits(norths), _limits(easts)
    size = max(tall, wide, STILL)
    # Neither side so short that the picture becomes a strip, and room for the ships.
    tall, wide = (max(span, 0.4 * size) + 0.16 * size for span in (tall, wide))
    figure = _figure(WIDTH, min(max(6.5 * tall / wide, 3.0), 9.0) + 1.0)
    panel = figure.subplots()
    _grid(panel)
    panel.set(
        xlabel="east y [m]",
        ylabel="north x [m]",
        xlim=(east - 0.5 * wide, east + 0.5 * wide),
        ylim=(north - 0.5 * tall, north + 0.5 * tall),
        aspect="equal",
    )
    scale = next((s for s in SCALES if s * HULL_LENGTH < OUTLINE_SHARE * size), SCALES[-1])
    for run in runs:
        x, y = _along(run.log["vessel.x"], run.log["vessel.y"], size / 1000.0)
        panel.plot(y, x, label=run.label, **{**run.line, "linewidth": 1.8})
        ships = PolyCollection(
            list(outlines(run.log, scale * HULL_LENGTH)),
            facecolors=(run.line["color"], 0.15 / len(runs)),
            edgecolors=run.line["color"],
            linewidths=0.7,
            zorder=2.5,
        )
        panel.add_collection(ships, autolim=False)
    for k, run in enumerate(runs):
        panel.plot(
            run.log["vessel.y"][0],
            run.log["vessel.x"][0],
            "o",
            markerfacecolor="white",
            markeredgecolor="black",
            zorder=4,
            label=None if k else "start",
        )
    if aims:
        _target(panel, aims, size)
    period = (runs[0].log["time"][-1] - runs[0].log["time"][0]) / (OUTLINES - 1)
    ratio = "full length" if scale == 1.0 else f"1:{1.0 / scale:g}"
    panel.set_title(f"ships drawn {ratio}, every {period:.3g} s", loc="right", fontsize=8, color="0.4")
    _legend(figure, panel, len(runs) + 2)
    return figure


def _target(panel: "Axes", logs: Sequence[Log], size: float) -> None:
    """The targets: a dashed line where they move, a cross where they do not."""
    line = {"color": "black", "zorder": 3, "label": "target"}
    paths = [(log["guidance.x_t"], log["guidance.y_t"]) for log in logs]
    moving = [path for path in paths if max(np.ptp(path[0]), np.ptp(path[1])) > STILL]
    if moving:
        x, y = once(moving, size)
        panel.plot(y, x, dashes=(6, 6), linewidth=0.9, **line)
        line["label"] = None
    points = [(x[0], y[0]) for x, y in paths if max(np.ptp(x), np.ptp(y)) <= STILL]
    if points:
        x, y = np.array(points).T
        panel.plot(y, x, "+", markersize=12, markeredgewidth=1.5, **{**line, "zorder": 5})


def errors(runs: Runs) -> "Figure":
    """Heading error and cross-track error over time."""
    figure, panels = _panels(2, 1, 5.0)
    for run in runs:
        x, y, psi = (run.log[name] for name in POSE)
        target = [run.log[name] for name in TARGET]
        _plot(panels[0, 0], run, np.degrees(wrap(psi - target[2])))
        _plot(panels[1, 0], run, cross_track(x, y, target))
    panels[0, 0].set_ylabel("heading error [deg]")
    panels[1, 0].set_ylabel("cross-track error e [m]")
    for panel in panels.flat:
        panel.axhline(0.0, color="0.4", linewidth=0.6, zorder=1)
    return _finish(figure, panels, runs, least=1e-4)


GROWING = (
    ("ISE", "ISE [m² s]"),
    ("IAE", "IAE [m s]"),
    ("W", "W [J]"),
    ("I_tau_dot", r"$I_{\dot\tau}$ [N]"),
    ("IAEW", "IAEW [m s J]"),
    ("IAEWWT", "IAEWWT [m s J N]"),
)


def metrics(runs: Runs, start: float | None = None, stop: float | None = None) -> "Figure":
    """The metrics as they grow over time, from ``start`` to ``stop`` [s]."""
    figure, panels = _panels(3, 2, 6.5)
    for run in runs:
        grown = over_time(run.log, start, stop)
        for panel, (name, _) in zip(panels.flat, GROWING, strict=True):
            _plot(panel, run._replace(log=grown), grown[name])
    for panel, (_, label) in zip(panels.flat, GROWING, strict=True):
        panel.set_ylabel(label)
        panel.set_ylim(bottom=0.0)
    return _finish(figure, panels, runs)


def forces(runs: Runs) -> "Figure":
    """Norms of the controller's linear, nonlinear and total force, (5.1)."""
    figure, panels = _panels(3, 1, 6.5)
    for panel, (title, names) in zip(
        panels.flat,
        (("linear", TAU_LIN), ("nonlinear", TAU_NONLIN), ("total", TAU)),
        strict=True,
    ):
        for run in runs:
            _plot(panel, run, _norm(run.log, names))
        panel.set_ylabel(f"{title} ‖τ‖ [N]")
        panel.set_ylim(bottom=0.0)
    return _finish(figure, panels, runs)


def model_error(runs: Runs) -> "Figure":
    """Model error and its estimate on each axis, one column of panels for each run."""
    figure, panels = _panels(3, len(runs), 6.5, max(WIDTH, 3.5 * len(runs)), sharey="row")
    for column, run in zip(panels.T, runs, strict=True):
        if len(runs) > 1:
            column[0].set_title(run.label, fontsize=10)
        for panel, true, estimate in zip(column, OMEGA, OMEGA_HAT, strict=True):
            # The thin black line stays visible on the estimate, and the estimate around it.
            _plot(panel, run, run.log[true], color="black", linestyle="-", linewidth=0.9, zorder=3)
            _plot(panel, run, run.log[estimate], linestyle="-", linewidth=1.8)
    for panel, axis in zip(panels[:, 0], AXES, strict=True):
        panel.set_ylabel(f"ω in {axis} [{'N m' if axis == 'N' else 'N'}]")
    # The estimates have the colours of their runs; the legend says which line is which.
    true, estimate = panels[0, 0].lines
    true.set_label("model error ω")
    estimate.set_label(None if len(runs) > 1 else "estimate ω̂")
    if len(runs) > 1:
        panels[0, 0].plot([], [], color="0.5", linewidth=1.8, label="estimate ω̂")
    _legend(figure, panels[0, 0], 2)
    return _finish(figure, panels, (), least=1e-4)


# File name -> columns read (the first choice that is there), function.
PICTURES: dict[str, tuple[Sequence[Sequence[str]], Callable[[Runs], "Figure"]]] = {
    "trajectory": (((*POSE, *TARGET), POSE), trajectory),
    "errors": (((*POSE, *TARGET),), errors),
    "metrics": (
        ((*POSE, *VELOCITY, *TARGET, *TAU_CMD), (*POSE, *VELOCITY, *TARGET, *TAU)),
        metrics,
    ),
    "forces": (((*TAU_LIN, *TAU_NONLIN, *TAU),), forces),
    "model_error": (((*OMEGA, *OMEGA_HAT),), model_error),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    parser = argparse.ArgumentParser(
        prog="python -m cosim.plots",
        description="Draw the pictures of finished runs, laid over each other.",
        epilog="example: python -m cosim.plots results/ellipse results/ellipse_bs --out results/both",
    )
    parser.add_argument("folders", metavar="DIR", nargs="+", type=Path, help="results of a run")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path(), help="where the PNGs go (.)")
    options = parser.parse_args(arguments)
    try:
        runs = {folder.resolve().name: read_log(folder) for folder in options.folders}
        for path in draw(runs, options.out):
            print(path)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"error: cannot write to '{options.out}': {error.strerror}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    run_command(main)
