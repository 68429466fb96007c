"""Covariates of the model error: time, place, speed, yaw rate, thruster level and heading of windows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fmus.scale import Scale

from ..predictors import WeakWindows
from ..predictors.weak_form import BLOCK
from ..runs.columns.unit_check import UNITS

AXES = "XYN"
BINS = 8  # 1, of equal numbers of windows, or sectors of heading; of time twice as many at most; chosen
# Unit of values -> quantity and unit for people.
DISPLAYED = {"rad": ("angle", "deg"), "rad/s": ("rate", "deg/s"), "1": ("command", "%")}


@dataclass(frozen=True)
class Covariate:
    """A quantity that the model error may depend on.

    Attributes:
        id: its name in results.
        unit: of its values.
        bin_edges: from values (K,) and the length of a block [s] to the edges (bins + 1,) of the bins.
        above, below, between: phrases for a region, with places for its ends.
        bounded: whether a region may have two ends; else it is open to one side.
        cyclic: whether the last bin is next to the first.
    """

    id: str
    unit: str
    bin_edges: Callable[[np.ndarray, float], np.ndarray]
    above: str
    below: str
    between: str
    bounded: bool = False
    cyclic: bool = False

    @property
    def display_factor(self) -> float:
        """What a value is multiplied by for people, such as degrees for radians."""
        if self.unit not in DISPLAYED:
            return 1.0
        quantity, shown = DISPLAYED[self.unit]
        return 1.0 / UNITS[quantity][shown]


def _quantiles(x: np.ndarray, block: float) -> np.ndarray:
    return np.unique(np.quantile(x, np.linspace(0.0, 1.0, BINS + 1)))


def _intervals(t: np.ndarray, block: float) -> np.ndarray:
    """Bins no shorter than a block of the cross-validation, as shorter ones are not independent."""
    bins = int(np.clip((t.max() - t.min()) // block, 1, 2 * BINS))
    return np.linspace(t.min(), t.max(), bins + 1)


def _sectors(psi: np.ndarray, block: float) -> np.ndarray:
    return np.linspace(-np.pi, np.pi, BINS + 1)


def _phrases(what: str, unit: str) -> tuple[str, str, str]:
    return f"{what} above {{0}}{unit}", f"{what} below {{0}}{unit}", f"{what} of {{0}} to {{1}}{unit}"


TIME = Covariate("time", "s", _intervals, "after {0} s", "before {0} s", "from {0} to {1} s", True)
SPEED = Covariate("speed", "m/s", _quantiles, *_phrases("at surge speeds", " m/s"))
YAW_RATE = Covariate("yaw_rate", "rad/s", _quantiles, *_phrases("at turn rates", "°/s"))
THRUST = Covariate("thrust", "1", _quantiles, *_phrases("at thrusts", " % of the most"))
HEADING = Covariate("heading", "rad", _sectors, *_phrases("on headings", "°"), True, True)
NORTH = Covariate(
    "north", "m", _quantiles, "north of {0} m", "south of {0} m", "from {0} to {1} m north", True
)
EAST = Covariate(
    "east", "m", _quantiles, "east of {0} m", "west of {0} m", "from {0} to {1} m east", True
)


@dataclass(frozen=True, eq=False)
class CovariateValues:
    """The values of a covariate in the windows of one run or of all.

    Attributes:
        covariate: which.
        rows: (n,), numbers of the windows, counted over all runs one after the other.
        values: (n,), in the covariate's unit.
        scale: of the ship.
        run: name of the only run that is meant; None: all.
    """

    covariate: Covariate
    rows: np.ndarray
    values: np.ndarray
    scale: Scale
    run: str | None = None

    @property
    def edges(self) -> np.ndarray:
        """(bins + 1,), in the covariate's unit."""
        return self.covariate.bin_edges(self.values, BLOCK * self.scale.time)


def covariates_by_axis(data: Sequence[WeakWindows]) -> list[list[CovariateValues]]:
    """The covariates for X, Y and N: those of all runs together, then the time of each run."""
    counts, scale = [w.middle.size for w in data], data[0].scale
    every = np.arange(sum(counts))
    speed, turn, level, heading, place = map(np.concatenate, zip(*map(means_of_run, data), strict=True))
    common = {SPEED: speed, YAW_RATE: turn, HEADING: heading, NORTH: place[:, 0], EAST: place[:, 1]}
    shared = [CovariateValues(by, every, values, scale) for by, values in common.items()]
    times = [
        CovariateValues(TIME, rows, w.middle, scale, w.run.name)
        for rows, w in zip(np.split(every, np.cumsum(counts)), data, strict=False)
    ]
    relative = level / np.maximum(level.max(axis=0), np.finfo(float).tiny)
    return [[*shared, CovariateValues(THRUST, every, each, scale), *times] for each in relative.T]


def means_of_run(w: WeakWindows) -> tuple[np.ndarray, ...]:
    """Means over the windows of a run.

    Returns:
        Speed (K,) [m/s], yaw rate (K,) [rad/s], command by axis (K, 3) [N, N, N m], heading (K,) [rad],
        place (K, 2) [m].
    """
    nu, eta = (np.where(w.known[:, None], x, 0.0) for x in (w.smoothed.nu, w.smoothed.eta))
    heading = np.arctan2(w.smooth @ np.sin(eta[:, 2]), w.smooth @ np.cos(eta[:, 2]))
    magnitude = w.smooth @ np.abs(nu[:, [0, 2]])
    level, place = w.held @ np.abs(w.run.tau_cmd), w.smooth @ eta[:, :2]
    return magnitude[:, 0], magnitude[:, 1], level, heading, place
