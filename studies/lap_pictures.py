"""Pictures of laps of several controllers: trajectories, errors, model error (Figs. 7.17 and 7.18)."""

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from .outcome import AXES, Log, missing

UNITS = ("m", "m", "rad")


def errors_picture(logs: Mapping[str, Log]) -> Figure:
    """z1 over time (Fig. 7.18a)."""
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


def force_picture(log: Log) -> Figure:
    """Model error with the lost thrust, and its estimate (Fig. 7.18b)."""
    figure = Figure(figsize=(8.0, 7.0), layout="constrained")
    panels = figure.subplots(3, 1, sharex=True)
    for panel, a in zip(panels, AXES, strict=True):
        panel.plot(log["time"], missing(log, a), "k", label="ω", linewidth=1.0)
        panel.plot(log["time"], log[f"controller.omega_hat_{a}"], "tab:red", label="estimate")
        panel.set_ylabel(f"ω_{a} [{'N m' if a == 'N' else 'N'}]")
        # The start, where ship and estimate are still far off, would flatten the rest.
        settled = log["time"] > 0.1 * log["time"][-1]
        low, high = np.quantile(missing(log, a)[settled], [0.005, 0.995])
        panel.set_ylim(low - 0.5 * (high - low) - 0.02, high + 0.5 * (high - low) + 0.02)
        panel.grid(alpha=0.3)
    panels[0].legend(fontsize=8)
    panels[-1].set_xlabel("time [s]")
    return figure


def path_picture(logs: Mapping[str, Log]) -> Figure:
    """The trajectories (Fig. 7.17)."""
    figure = Figure(figsize=(7.0, 5.0), layout="constrained")
    axes = figure.subplots()
    for label, log in logs.items():
        axes.plot(log["vessel.y"], log["vessel.x"], label=label, linewidth=1.0)
    last = next(iter(logs.values()))
    axes.plot(last["guidance.y_t"], last["guidance.x_t"], "k--", label="target", linewidth=1.0)
    axes.set(xlabel="east [m]", ylabel="north [m]", aspect="equal")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    return figure
