"""Pictures of several runs: errors, and model error with its estimate (Figs. 7.12, 7.14, 7.15, 7.18)."""

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.figure import Figure

from ..tracking.outcome import AXES, Log, missing

UNITS = ("m", "m", "rad")
COLOURS = ("tab:blue", "tab:orange", "tab:green", "tab:red", "tab:purple")


def errors_picture(logs: Mapping[str, Log]) -> Figure:
    """z1 over time."""
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for panel, name, unit in zip(panels, ("x", "y", "psi"), UNITS, strict=True):
        for label, log in logs.items():
            panel.plot(log["time"], log[f"controller.z1_{name}"], label=label, linewidth=1.0)
        panel.set_ylabel(f"z1_{name} [{unit}]")
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=7, ncols=3)
    panels[-1].set_xlabel("time [s]")
    return figure


def spread(values: Sequence[np.ndarray], logs: Mapping[str, Log]) -> tuple[float, float]:
    """Between what a line of each log lies after the start, but for a hundredth of the samples."""
    late = [x[g["time"] > 0.1 * g["time"][-1]] for x, g in zip(values, logs.values(), strict=True)]
    low, high = np.quantile(np.concatenate(late), [0.005, 0.995])
    return float(low), float(high)


def force_picture(logs: Mapping[str, Log]) -> Figure:
    """Model error with the lost thrust, and dashed its estimate."""
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for panel, a in zip(panels, AXES, strict=True):
        for colour, (label, log) in zip(cycle(COLOURS), logs.items(), strict=False):
            panel.plot(log["time"], missing(log, a), color=colour, linewidth=1.0, label=f"ω {label}")
            panel.plot(log["time"], log[f"controller.omega_hat_{a}"], "--", color=colour, linewidth=1.0)
        panel.set_ylabel(f"ω_{a} [{'N m' if a == 'N' else 'N'}]")
        # The start, where ship and estimate are still far off, would flatten the rest.
        low, high = spread([missing(g, a) for g in logs.values()], logs)
        seen = spread([g[f"controller.omega_hat_{a}"] for g in logs.values()], logs)
        low, high = min(low, seen[0]), max(high, seen[1])
        panel.set_ylim(low - 0.5 * (high - low) - 0.02, high + 0.5 * (high - low) + 0.02)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8, ncols=3)
    panels[-1].set_xlabel("time [s]")
    return figure
