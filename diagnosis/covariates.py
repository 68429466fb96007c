"""What the model error of a window is held against: time, speed, yaw rate, thruster level, heading."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .weak import Integrals

AXES = "XYN"
QUANTILES = 8
SECTORS = 8
LONGEST_PARTS = 16
SHORTEST_PART = 15.0  # s


@dataclass(frozen=True)
class Kind:
    """A covariate.

    Attributes:
        id: its name in results.
        unit: of its values.
        shown: what a value is multiplied with where people read it.
        above, below, between: phrases for regions, with places for the ends.
        ends: from values (K,) to the ends of the bins.
        any_range: whether a region may lie between two ends; else it is open to one side.
        cyclic: whether the last bin borders on the first.
    """

    id: str
    unit: str
    shown: float
    above: str
    below: str
    between: str
    ends: Callable[[np.ndarray], np.ndarray]
    any_range: bool = False
    cyclic: bool = False


def _quantiles(x: np.ndarray) -> np.ndarray:
    return np.unique(np.quantile(x, np.linspace(0.0, 1.0, QUANTILES + 1)))


def _parts(t: np.ndarray) -> np.ndarray:
    parts = int(np.clip((t.max() - t.min()) // SHORTEST_PART, 1, LONGEST_PARTS))
    return np.linspace(t.min(), t.max(), parts + 1)


def _sectors(psi: np.ndarray) -> np.ndarray:
    return np.linspace(-np.pi, np.pi, SECTORS + 1)


DEGREES = 180.0 / np.pi
TIME = Kind("time", "s", 1.0, "after {0} s", "before {0} s", "from {0} to {1} s", _parts, True)
SPEED = Kind(
    "speed",
    "m/s",
    1.0,
    "at surge speeds above {0} m/s",
    "at surge speeds below {0} m/s",
    "at surge speeds of {0} to {1} m/s",
    _quantiles,
)
YAW_RATE = Kind(
    "yaw_rate",
    "rad/s",
    DEGREES,
    "at turn rates above {0}°/s",
    "at turn rates below {0}°/s",
    "at turn rates of {0} to {1}°/s",
    _quantiles,
)
THRUST = Kind(
    "thrust",
    "1",
    100.0,
    "while its thrust is above {0} % of the most",
    "while its thrust is below {0} % of the most",
    "while its thrust is {0} to {1} % of the most",
    _quantiles,
)
HEADING = Kind(
    "heading",
    "rad",
    DEGREES,
    "on headings above {0}°",
    "on headings below {0}°",
    "on headings from {0}° to {1}°",
    _sectors,
    any_range=True,
    cyclic=True,
)


@dataclass(frozen=True, eq=False)
class Course:
    """A covariate over some windows.

    Attributes:
        kind: which.
        rows: (n,), windows that it is known in, of all runs one after the other.
        values: (n,), in the kind's unit.
        run: the only run that is meant; None: all.
    """

    kind: Kind
    rows: np.ndarray
    values: np.ndarray
    run: str | None = None

    @property
    def ends(self) -> np.ndarray:
        """(bins + 1,)."""
        return self.kind.ends(self.values)


def courses(data: Sequence[Integrals]) -> list[list[Course]]:
    """For each axis the covariates of all runs; time by itself in each of them."""
    counts = [w.middle.size for w in data]
    every = np.arange(sum(counts))
    first = np.cumsum([0, *counts])
    speed, turn, level, heading = (np.concatenate(x) for x in zip(*map(_of_run, data), strict=True))
    shared = [
        Course(SPEED, every, speed),
        Course(YAW_RATE, every, turn),
        Course(HEADING, every, heading),
    ]
    times = [
        Course(TIME, np.arange(a, a + w.middle.size), w.middle, w.run.name)
        for a, w in zip(first, data, strict=False)
    ]
    most = np.maximum(level.max(axis=0), 1e-9)
    return [[*shared, Course(THRUST, every, level[:, k] / most[k]), *times] for k in range(3)]


def _of_run(w: Integrals) -> tuple[np.ndarray, ...]:
    """Speed (K,), yaw rate (K,), thrust by axis (K, 3), heading (K,) of the windows of a run."""
    nu, eta = (np.where(w.known[:, None], x, 0.0) for x in (w.smoothed.nu, w.smoothed.eta))
    heading = np.arctan2(w.smooth @ np.sin(eta[:, 2]), w.smooth @ np.cos(eta[:, 2]))
    moving = w.smooth @ np.abs(nu[:, [0, 2]])
    return moving[:, 0], moving[:, 1], w.held @ np.abs(w.run.tau_cmd), heading
