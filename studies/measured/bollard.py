"""Bollard pulls of the real ship's propellers: reference data that no model is learned from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from cosim import InputError
from cosim.errors import nearest
from diagnosis import Model

PULLS = Path("cse1_static", "vsp_surge_bollard.csv")
COLUMNS = ("pitch", "F_per_vsp")
WITHIN = 0.7  # of full pitch: what the ship was steered with
GRID = np.linspace(-1.0, 1.0, 201)


class Pulls(NamedTuple):
    """Commands (n,) [1] and the surge force (n,) [N] that one VSP gave at rest."""

    command: np.ndarray
    force: np.ndarray


class Difference(NamedTuple):
    """RMS [N] between a model's force and the pulls, as it is and with the best factor on the force."""

    rms: float
    factor: float
    scaled: float


def read(data: Path) -> Pulls:
    """The surge pulls in a folder of measurements.

    Raises:
        InputError: they are not there, or not as they should be.
    """
    path = data / PULLS
    if not path.is_file():
        raise InputError(f"no bollard pulls: '{path}' is missing")
    try:
        table = pd.read_csv(path)
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as a table: {error}") from None
    for name in COLUMNS:
        if name not in table:
            raise InputError(f"'{path}' has no column '{name}'{nearest(name, list(table))}")
    numbers = table[list(COLUMNS)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
    if not np.isfinite(numbers).all():
        raise InputError(f"'{path}' has cells that are not numbers")
    command, force = numbers.T
    if not (np.abs(command) <= WITHIN).any():
        raise InputError(f"'{path}' has no pull at a command of at most {WITHIN:g}")
    return Pulls(command, force)


def surge_force(model: Model, command: np.ndarray) -> np.ndarray:
    """What one VSP of a model gives in surge at rest, at full power.

    Args:
        model: its thrusters and their effects.
        command: (n,) [1].

    Returns:
        (n,) [N].
    """
    none = np.zeros_like(command)
    commands: Any = (command, none, none)
    layout = model.ship.layout
    now = layout.running(0.0, 0.0, 0.0, 0.0, commands, model.drive)
    X, _, _ = layout.act(commands, now, model.drive)
    return np.broadcast_to(X, command.shape)


def difference(model: Model, pulls: Pulls) -> Difference:
    """A model's force against the pulls with at most WITHIN of full pitch."""
    kept = np.abs(pulls.command) <= WITHIN
    commanded, pulled = pulls.command[kept], pulls.force[kept]
    given = surge_force(model, commanded)
    factor = float(given @ pulled / max(float(given @ given), 1e-12))

    def rms(x: np.ndarray) -> float:
        return float(np.sqrt(np.mean(x**2)))

    return Difference(rms(given - pulled), factor, rms(factor * given - pulled))


def picture(pulls: Pulls, learned: Model, folds: Mapping[str, Model]) -> Figure:
    """The force over the command: nominal line, learned from all runs, from each three, and pulled."""
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    axes = figure.subplots()
    axes.axvspan(-WITHIN, WITHIN, color="0.95")
    for k, model in enumerate(folds.values()):
        label = None if k else "learned, one run left out"
        axes.plot(
            GRID, surge_force(model, GRID), color="tab:blue", alpha=0.4, linewidth=0.8, label=label
        )
    axes.plot(GRID, surge_force(Model(), GRID), "--", color="0.4", label="nominal")
    axes.plot(GRID, surge_force(learned, GRID), color="tab:blue", linewidth=2.0, label="learned")
    axes.plot(*pulls, "o", color="tab:red", markersize=4.5, label="bollard pulls, not learned from")
    axes.set(xlabel="VSP command in surge [1]", ylabel="surge force of one VSP [N]")
    axes.grid(alpha=0.3)
    axes.legend()
    return figure
