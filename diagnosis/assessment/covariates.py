"""Covariates of the model error: time, place, speed, yaw rate, thruster level and heading of windows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..predictors import WeakWindows

AXES = "XYN"
QUANTILE_BINS = 8  # bins of equal numbers of windows; chosen
SECTORS = 8  # of heading, 45 degrees each; chosen
MAX_TIME_BINS = 16  # chosen, so that a profile of a long run stays short
# s, times the scale of the ship: a block of the cross-validation: shorter bins are not independent
MIN_TIME_BIN = 15.0
SMALLEST_LEVEL = 1e-9  # N or N m, keeps the relative level defined where an axis is never commanded


@dataclass(frozen=True)
class Covariate:
    """A quantity that the model error may depend on.

    Attributes:
        id: its name in results.
        unit: of its values.
        display_factor: what a value is multiplied by for people, such as degrees for radians.
        above, below, between: phrases for a region, with places for its ends.
        bin_edges: from values (K,) to the edges (bins + 1,) of the bins.
        bounded: whether a region may have two ends; else it is open to one side.
        cyclic: whether the last bin is next to the first.
    """

    id: str
    unit: str
    display_factor: float
    above: str
    below: str
    between: str
    bin_edges: Callable[[np.ndarray], np.ndarray]
    bounded: bool = False
    cyclic: bool = False


def _quantiles(x: np.ndarray) -> np.ndarray:
    return np.unique(np.quantile(x, np.linspace(0.0, 1.0, QUANTILE_BINS + 1)))


def _intervals(t: np.ndarray, least: float = MIN_TIME_BIN) -> np.ndarray:
    bins = int(np.clip((t.max() - t.min()) // least, 1, MAX_TIME_BINS))
    return np.linspace(t.min(), t.max(), bins + 1)


def _sectors(psi: np.ndarray) -> np.ndarray:
    return np.linspace(-np.pi, np.pi, SECTORS + 1)


DEGREES = 180.0 / np.pi
TIME = Covariate("time", "s", 1.0, "after {0} s", "before {0} s", "from {0} to {1} s", _intervals, True)
SPEED = Covariate(
    "speed",
    "m/s",
    1.0,
    "at surge speeds above {0} m/s",
    "at surge speeds below {0} m/s",
    "at surge speeds of {0} to {1} m/s",
    _quantiles,
)
YAW_RATE = Covariate(
    "yaw_rate",
    "rad/s",
    DEGREES,
    "at turn rates above {0}°/s",
    "at turn rates below {0}°/s",
    "at turn rates of {0} to {1}°/s",
    _quantiles,
)
THRUST = Covariate(
    "thrust",
    "1",
    100.0,
    "while its thrust is above {0} % of the most",
    "while its thrust is below {0} % of the most",
    "while its thrust is {0} to {1} % of the most",
    _quantiles,
)
HEADING = Covariate(
    "heading",
    "rad",
    DEGREES,
    "on headings above {0}°",
    "on headings below {0}°",
    "on headings from {0}° to {1}°",
    _sectors,
    bounded=True,
    cyclic=True,
)
NORTH = Covariate(
    "north", "m", 1.0, "north of {0} m", "south of {0} m", "from {0} to {1} m north", _quantiles, True
)
EAST = Covariate(
    "east", "m", 1.0, "east of {0} m", "west of {0} m", "from {0} to {1} m east", _quantiles, True
)


@dataclass(frozen=True, eq=False)
class CovariateValues:
    """The values of a covariate in the windows of one run or of all.

    Attributes:
        covariate: which.
        rows: (n,), numbers of the windows, counted over all runs one after the other.
        values: (n,), in the covariate's unit.
        run: name of the only run that is meant; None: all.
    """

    covariate: Covariate
    rows: np.ndarray
    values: np.ndarray
    run: str | None = None

    @property
    def edges(self) -> np.ndarray:
        """(bins + 1,), in the covariate's unit."""
        return self.covariate.bin_edges(self.values)


def covariates_by_axis(data: Sequence[WeakWindows]) -> list[list[CovariateValues]]:
    """The covariates for X, Y and N: those of all runs together, then the time of each run.

    Args:
        data: windows of each run.
    """
    counts = [w.middle.size for w in data]
    every = np.arange(sum(counts))
    first = np.cumsum([0, *counts])
    speed, turn, level, heading, place = map(np.concatenate, zip(*map(means_of_run, data), strict=True))
    shared = [
        CovariateValues(SPEED, every, speed),
        CovariateValues(YAW_RATE, every, turn),
        CovariateValues(HEADING, every, heading),
        CovariateValues(NORTH, every, place[:, 0]),
        CovariateValues(EAST, every, place[:, 1]),
    ]
    least = MIN_TIME_BIN * data[0].scale.time
    by_time = (
        TIME if least == MIN_TIME_BIN else replace(TIME, bin_edges=partial(_intervals, least=least))
    )
    times = [
        CovariateValues(by_time, np.arange(a, a + w.middle.size), w.middle, w.run.name)
        for a, w in zip(first, data, strict=False)
    ]
    most = np.maximum(level.max(axis=0), SMALLEST_LEVEL)
    return [[*shared, CovariateValues(THRUST, every, level[:, k] / most[k]), *times] for k in range(3)]


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
