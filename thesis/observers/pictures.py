"""Pictures of several observers laid over each other and over the truth."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from .estimates_replayed import SIGNALS, UNITS, Log, wraps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

UNIT_OF: dict[str, str] = {**UNITS, "x_m": "m", "y_m": "m", "psi_m": "rad"}
COLORS = {
    "df": "tab:red",
    "mdf": "tab:blue",
    "nonlinear": "tab:green",
    "luenberger": "tab:orange",
    "kalman": "magenta",
}


def _axes(names: Sequence[str]) -> "tuple[Figure, list[Axes]]":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 1.0 + 1.9 * len(names)), layout="constrained")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for panel, name in zip(panels, names, strict=True):
        panel.set_ylabel(f"{name} [{UNIT_OF[name]}]")
        panel.grid(alpha=0.3)
    panels[-1].set_xlabel("time [s]")
    return figure, list(panels)


def _lines(
    panel: "Axes", time: np.ndarray, name: str, true: Log, estimates: Mapping[str, Log], label: str
) -> None:
    """The estimates of one signal, the truth on top, and limits that the truth sets."""
    for observer, estimate in estimates.items():
        wide = 1.6 if observer == "kalman" else 1.0
        panel.plot(time, estimate[name], label=observer, color=COLORS[observer], linewidth=wide)
    panel.plot(time, true[name], color="black", linewidth=1.0, linestyle="--", label=label)
    low, high = np.nanmin(true[name]), np.nanmax(true[name])
    margin = 0.5 * (high - low) + {"u": 0.01, "v": 0.01}.get(name, 0.02)
    panel.set_ylim(low - margin, high + margin)


def _cut(values: Mapping[str, np.ndarray], part: slice) -> dict[str, np.ndarray]:
    return {name: column[part] for name, column in values.items()}


def _true(log: Log) -> dict[str, np.ndarray]:
    return {name: log[f"vessel.{name}"] for name in SIGNALS}


def _window(
    names: Sequence[str],
    part: slice,
    time: np.ndarray,
    true: Log,
    estimates: Mapping[str, Log],
    label: str = "truth",
) -> "tuple[Figure, list[Axes]]":
    figure, panels = _axes(names)
    cut = {observer: _cut(estimate, part) for observer, estimate in estimates.items()}
    for panel, name in zip(panels, names, strict=True):
        _lines(panel, time[part], name, _cut(true, part), cut, label)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=6, frameon=False)
    return figure, panels


def compared(log: Log, estimates: Mapping[str, Log], reference: Log | None = None) -> "Figure":
    """u, v, r over 20 s from the middle of a run; a measured run has a reference for a truth."""
    time = log["time"]
    h = float(np.median(np.diff(time)))
    start = time.size // 2
    part = slice(start, start + round(20.0 / h))
    true, label = (_true(log), "truth") if reference is None else (reference, "smoother")
    return _window(("u", "v", "r"), part, time, true, estimates, label)[0]


def freeze(log: Log, estimates: Mapping[str, Log], first: int, end: int) -> "Figure":
    """Velocity and acceleration in surge and sway through a freeze from row ``first`` to ``end``."""
    time = log["time"]
    h = float(np.median(np.diff(time)))
    part = slice(max(0, first - round(1.0 / h)), end + round(2.0 / h))
    figure, panels = _window(("u", "v", "u_dot", "v_dot"), part, time, _true(log), estimates)
    for panel in panels:
        panel.axvspan(time[first], time[end - 1], color="0.85", zorder=0)
    return figure


def wrap(log: Log, estimates: Mapping[str, Log]) -> "Figure | None":
    """Pose, yaw rate and acceleration through a wrap of the heading; None where there is none."""
    rows = wraps(log)
    if not rows:
        return None
    time = log["time"]
    h = float(np.median(np.diff(time)))
    part = slice(max(0, rows[0] - round(1.0 / h)), rows[0] + round(3.0 / h))
    pose = ("x_m", "y_m", "psi_m")
    shown = {
        o: {**e, "x_m": e["x_hat"], "y_m": e["y_hat"], "psi_m": np.angle(np.exp(1j * e["psi_hat"]))}
        for o, e in estimates.items()
    }
    measured = {name: log[f"observer.{name}"] for name in pose}
    figure, panels = _window((*pose, "r", "r_dot"), part, time, {**_true(log), **measured}, shown)
    panels[2].set_ylim(-3.5, 3.5)
    return figure
