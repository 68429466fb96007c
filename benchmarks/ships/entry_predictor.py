"""What an entry of the table is given, what it gives, and how that is scored."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import numpy as np

from diagnosis import Model, Smoothed, WeakWindows, Windows

from .same_windows import Law, Nominal, law_residuals

BINS = 8  # of a window's time, in each of which a spread is constant; chosen
LEVEL = 0.9  # 1, probability of the bands whose coverage is counted


@dataclass(frozen=True)
class Training:
    """What an entry may learn from.

    Attributes:
        runs: training runs with all that the project knows of them.
        model: the description of the ship, before anything is learned.
        horizon: length of the windows that are predicted [s].
    """

    runs: Sequence[WeakWindows]
    model: Model
    horizon: float

    @cached_property
    def smoothed(self) -> list[Smoothed]:
        """The smoothed runs."""
        return [w.smoothed for w in self.runs]

    @cached_property
    def nominal(self) -> Nominal:
        """The description as functions of velocity and commands; one, by which entries may cache."""
        return Nominal(self.model, self.runs[0].run.commands)


class Predictor(Protocol):
    """What an entry gives."""

    def residuals(self, windows: Windows) -> np.ndarray:
        """(samples, 3), measured minus predicted pose [m, m, rad] of the windows of one run."""
        ...

    def covariance(self, windows: Windows, left: np.ndarray) -> np.ndarray | None:
        """(samples, 3, 3) of residuals ``left``; None: the entry states none."""
        ...


Entry = Callable[[Training], Predictor]


@dataclass(frozen=True)
class OfLaw:
    """A law of motion, see :class:`.same_windows.Law`, without an uncertainty of its own."""

    law: Law

    def residuals(self, windows: Windows) -> np.ndarray:
        """As of :class:`Predictor`."""
        return law_residuals(self.law, windows)

    def covariance(self, windows: Windows, left: np.ndarray) -> np.ndarray | None:
        """None."""
        return None


@dataclass(frozen=True)
class OfModel:
    """A model of the project, and what gives the bands about its predictions."""

    model: Model
    bands: Callable[[Smoothed, Windows], Any] | None = None

    def residuals(self, windows: Windows) -> np.ndarray:
        """As of :class:`Predictor`."""
        return windows.residuals(self.model)

    def covariance(self, windows: Windows, left: np.ndarray) -> np.ndarray | None:
        """By the bands."""
        found = None if self.bands is None else self.bands(windows.runs[0], windows)
        return None if found is None else found.at_samples


class Score(NamedTuple):
    """Root mean square errors of the windows of a run, and how likely they are.

    Attributes:
        position: [m].
        heading: [rad].
        likelihood: negative logarithm, mean over the samples [1].
        inside: share of the samples' positions and headings inside the bands of 90 % [1].
    """

    position: float
    heading: float
    likelihood: float
    inside: float


def spread(predictor: Predictor, windows: Sequence[Windows]) -> np.ndarray:
    """(BINS, 3): RMS error in training windows, by the time since their start [m, m, rad]."""
    squares, counts = np.zeros((BINS, 3)), np.zeros((BINS, 1))
    for w in windows:
        at = _bin(w)
        np.add.at(squares, at, np.nan_to_num(predictor.residuals(w) ** 2, posinf=1e12))
        np.add.at(counts, at, 1.0)
    return np.sqrt(squares / np.maximum(counts, 1.0))


def _bin(windows: Windows) -> np.ndarray:
    return np.clip((BINS * windows.since / windows.length).astype(int), 0, BINS - 1)


def score(predictor: Predictor, windows: Windows, usual: np.ndarray) -> Score:
    """The score of an entry on the windows of one run.

    Args:
        predictor: what the entry gave.
        windows: of a test run.
        usual: :func:`spread` in the training windows, for an entry that states no uncertainty.
    """
    left = predictor.residuals(windows)
    stated = predictor.covariance(windows, left)
    noise = np.diag(windows.runs[0].noise ** 2)
    if stated is None:
        stated = np.eye(3) * usual[_bin(windows)][:, None, :] ** 2 + noise
    position, heading = windows.summary(left).over_all()
    squares, size = _standardised(left, stated)
    nll = 0.5 * (squares.sum(axis=1) + size + 3.0 * np.log(2.0 * np.pi))
    within = squares <= np.array([-2.0 * np.log(1.0 - LEVEL), 2.7055])  # chi-squared, 2 and 1
    return Score(float(position), float(heading), float(nll.mean()), float(within.mean()))


def _standardised(left: np.ndarray, V: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squares (n, 2) of position and heading over their variances, and log determinants (n,)."""
    place = left[:, :2, None]
    squares = (np.swapaxes(place, 1, 2) @ np.linalg.solve(V[:, :2, :2], place))[:, 0, 0]
    heading = left[:, 2] ** 2 / V[:, 2, 2]
    size = np.linalg.slogdet(V[:, :2, :2])[1] + np.log(V[:, 2, 2])
    return np.column_stack([squares, heading]), size
