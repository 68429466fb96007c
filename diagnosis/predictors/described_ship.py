"""A described ship as a predictor: the functions of its vessel and thrusters, by its parameters."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim import InputError
from fmus.ship import Ship, ship
from fmus.ships.naming import described_ship

from ..execution.progress import Advance, silent
from ..execution.result_folder import sha256
from ..runs import Fingerprint, Smoothed
from .parameter_set import read_model, write_model
from .predictor import MODEL, Predictor, PredictorDescription
from .ship_model import Model
from .weak_form import WeakWindows
from .windows import Windows, free_runs


class DescribedShip:
    """A model of this project, see :class:`.predictor.Predictor` and :class:`.predictor.ModelSource`.

    Args:
        model: its parameters.
        file: that they were read from.
    """

    parametric, whole = True, False

    def __init__(self, model: Model, file: Path | None = None) -> None:
        self.model, self.file = model, file
        self.sha256 = "" if file is None else sha256(file)

    @property
    def files(self) -> list[tuple[str, Path, str]]:
        """What decides its predictions: role and path of each file, and its SHA-256 when it was read."""
        return [] if self.file is None else [("model", self.file, self.sha256)]

    def learning_from(self, runs: Sequence[WeakWindows]) -> "DescribedShip":
        """The same model, which remembers that it and what is made from it is learned from some runs."""
        known = (*self.model.learned_from, *(Fingerprint.of(w.smoothed) for w in runs))
        return DescribedShip(replace(self.model, learned_from=known), self.file)

    @property
    def name(self) -> str:
        return f"the model of {self.model.ship.name}"

    @property
    def start(self) -> Model:
        return self.model

    def on(self, runs: Sequence[WeakWindows], advance: Advance = silent) -> "DescribedShip":
        return self

    def run_in(self, smoothed: Smoothed) -> float:
        return 0.0

    def windows(self, runs: Sequence[Smoothed], length: float) -> Windows | None:
        return windows_of(runs, length)

    def residuals(self, windows: Windows, learned: Sequence[Model] = ()) -> list[np.ndarray]:
        first, *others = dict.fromkeys(smoothed.track.run.name for smoothed in windows.runs)
        models = (self.model, *learned)
        if others and any(m.runs for m in models):
            return [windows.residuals_by_run([m] * len(windows.runs)) for m in models]
        return windows.residuals_of_each([m.during(first) for m in models])

    def free_runs(
        self, smoothed: Smoothed, learned: Model | None = None, begin: float = -np.inf
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        return free_runs(smoothed, [self.model, learned or self.model], begin)

    def in_windows(self) -> Predictor:
        return self

    def description(self) -> PredictorDescription | None:
        return None

    def write(
        self, folder: Path, learned: Model | None = None, runs: Sequence[WeakWindows] = ()
    ) -> list[str]:
        if learned is not None:
            write_model(folder / MODEL, learned)
        return []


def windows_of(runs: Sequence[Smoothed], length: float) -> Windows | None:
    """Windows of a length [s]; None: none has enough samples."""
    try:
        return Windows(runs, length)
    except InputError:
        return None


def nominal(runs: Sequence[WeakWindows]) -> Model:
    """The nominal model of the ship that runs are of.

    Raises:
        InputError: they are of several ships.
    """
    ships = dict.fromkeys(described_ship(w.run.ship) for w in runs)
    if len(ships) > 1:
        names = (one.name for one in ships)
        raise InputError(f"the runs are of several ships: {', '.join(names)}")
    return Model(ship=ship(description=next(iter(ships), None)))


def open_parameters(path: Path | None, of: Ship | None) -> DescribedShip:
    """The model in a parameter set, or the nominal one, see :func:`.predictor.open_model`."""
    return DescribedShip(Model(ship=of or ship()) if path is None else read_model(path, of), path)
