"""What the channels of a run say of its motion, side by side: pose, velocity and yaw rate."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import pinvh

from fmus.frames import rotate_to_earth
from fmus.scale import REFERENCE

from ..cleaning import long_gap, lost, median_std, noise
from ..files.reading import Run
from ..files.telegrams import filled
from ..frozen import repeated
from ..run_constants import FAR_OFF, FEWEST

SURE = 4.0  # 1, standard deviations; the noise is estimated, and some ten faults are looked for (chosen)
AGREED = 0.7  # 1, correlation from which on two channels measure the same motion (chosen)
ALIKE = 0.3  # 1, relative difference up to which two quantities may be the same but for a fault (chosen)
LEAST_TURN = 0.1  # rad in a step, from which on a heading may have jumped (chosen)
# 1, of the largest yaw rate, 95 % of all, up to which rows are on straight legs (chosen).
STRAIGHT = 0.25
# Channels that give the velocity over ground, best first: with the heading, or without it.
VELOCITIES = (("u", "v"), ("x_dot", "y_dot"), ("speed", "course"))


@dataclass(frozen=True, eq=False)
class Evidence:
    """The channels of a run, all of its rows in order.

    Attributes:
        run: its rows in the order of time.
        rows: (k,), those with a measured pose.
        psi: (n,), heading, continuous [rad].
        velocity: (n, 2), over ground, north and east [m/s]; None if it is not measured.
        rate: (n,), of turn [rad/s]; None if it is not measured.
        by: the channels of the velocity.
        filled: (n,), rows whose pose a line between two telegrams has filled.
    """

    run: Run
    rows: np.ndarray
    psi: np.ndarray
    velocity: np.ndarray | None
    rate: np.ndarray | None
    by: tuple[str, str] | None
    filled: np.ndarray

    @property
    def time(self) -> np.ndarray:
        """(n,) [s], of the log."""
        return self.run.time

    @cached_property
    def still(self) -> tuple[float, float]:
        """Speed [m/s] and yaw rate [rad/s] up to which those that are measured may be noise alone."""
        return _of_noise(self.velocity), _of_noise(self.rate)

    @cached_property
    def unlogged(self) -> list[tuple[float, float]]:
        """Begin and end [s] of each stretch without rows, or without the velocity."""
        columns = np.column_stack([self.time, *(self.run.measured[name] for name in self.by or ())])
        known = self.time[np.isfinite(columns).all(axis=1)]
        time = np.concatenate([self.time[:1], known, self.time[-1:]])
        step = np.diff(time)
        at = np.flatnonzero(step > long_gap(float(np.median(step)), REFERENCE))
        return [(float(time[k]), float(time[k + 1])) for k in at]

    @cached_property
    def turned(self) -> np.ndarray:
        """(n,): the yaw rate integrated over the log's time [rad]; zero where there is none."""
        return integral(self.time, np.zeros_like(self.time) if self.rate is None else self.rate)

    @cached_property
    def gone(self) -> np.ndarray:
        """(n, 2): the velocity integrated over the log's time [m]; zero where there is none."""
        still = np.zeros((self.time.size, 2))
        return integral(self.time, still if self.velocity is None else self.velocity)


def evidence(run: Run) -> Evidence | None:
    """What the channels of a run say; None where hardly anything is measured beside the pose."""
    there = ~lost(run.pose)
    fresh = np.flatnonzero(there & ~repeated(run.pose, there))
    # A position that was held while the heading went on is of an earlier instant.
    moved = np.flatnonzero(there & ~repeated(run.pose[:, :2], there))
    fresh = moved if moved.size >= FEWEST else fresh
    if fresh.size < FEWEST:
        return None
    between = np.zeros(run.time.size, bool)
    between[fresh] = filled(run.time[fresh], run.pose[fresh, :2], float(run.coarse[:, :2].max()))
    rows = fresh[~between[fresh]]
    psi = np.interp(run.time, run.time[fresh], np.unwrap(run.pose[fresh, 2]))
    by = next((pair for pair in VELOCITIES if all(_given(run, name) for name in pair)), None)
    rate = _rate_of_turn(run, psi) if _given(run, "r") else None
    velocity = None if by is None else velocity_over_ground(run, by, psi)
    return None if by is None and rate is None else Evidence(run, rows, psi, velocity, rate, by, between)


def _of_noise(values: np.ndarray | None) -> float:
    """Size up to which a velocity (n,) or (n, k) may be noise alone; 0: it is not measured."""
    if values is None:
        return 0.0
    columns = values.reshape(len(values), -1)
    new = np.any(np.diff(columns, axis=0, prepend=np.nan) != 0.0, axis=1)  # a slow channel is held
    return FAR_OFF * float(np.hypot.reduce(noise(columns[new]))) if new.sum() >= FEWEST else 0.0


def integral(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n,) or (n, k) integrated from the first time [s] on, by trapezia."""
    steps = np.diff(time).reshape(-1, *[1] * (values.ndim - 1)) * (values[1:] + values[:-1]) / 2.0
    return np.concatenate([np.zeros_like(values[:1]), np.cumsum(steps, axis=0)])


def _given(run: Run, name: str) -> bool:
    """Whether a channel is there for at least half of the time, and does not stand still.

    Rows of other channels lie between the samples of a slow one: no share of the rows says so.
    """
    values = run.measured.get(name)
    if values is None:
        return False
    there = np.isfinite(values)
    if not there.any() or not np.std(values[there]) > 0.0:
        return False
    step = np.diff(run.time[there])
    between = step[step <= long_gap(float(np.median(step)), REFERENCE)]
    return bool(between.sum() > 0.5 * (run.time[-1] - run.time[0]))


def _whole(run: Run, name: str) -> np.ndarray:
    there = np.isfinite(run.measured[name])
    values = run.measured[name][there]
    return np.interp(run.time, run.time[there], np.unwrap(values) if name == "course" else values)


def without_rate(run: Run) -> np.ndarray:
    """Rows (n,) far from any measured yaw rate."""
    missing = ~np.isfinite(run.measured["r"])
    known = run.time[~missing]
    step = np.diff([-np.inf, *known, np.inf])[np.searchsorted(known, run.time, side="right")]
    return missing & (step > long_gap(float(np.median(np.diff(known))), REFERENCE))


def _rate_of_turn(run: Run, psi: np.ndarray) -> np.ndarray:
    """(n,) [rad/s]; where it is missing for long that of the heading (n,), which contradicts nothing."""
    with np.errstate(all="ignore"):  # two rows may have one time
        turning = np.gradient(psi, run.time)
    return np.where(without_rate(run) & np.isfinite(turning), turning, _whole(run, "r"))


def velocity_over_ground(run: Run, by: tuple[str, str], psi: np.ndarray) -> np.ndarray:
    """Velocity (n, 2) to north and east [m/s]."""
    first, second = (_whole(run, name) for name in by)
    if by == ("x_dot", "y_dot"):
        return np.column_stack([first, second])
    if by == ("speed", "course"):
        return np.column_stack([first * np.cos(second), first * np.sin(second)])
    return np.column_stack(rotate_to_earth(psi, first, second))


def straight(rate: np.ndarray) -> np.ndarray:
    """(n,): rows with a yaw rate (n,) of straight legs."""
    return np.abs(rate) < STRAIGHT * np.quantile(np.abs(rate), 0.95)


def large(values: np.ndarray) -> np.ndarray:
    """(n,): values (n,) that are at least half as large as the largest, 90 % of all."""
    return np.abs(values) > np.nanquantile(np.abs(values), 0.9) / 2.0


def spread_of(values: np.ndarray) -> float:
    """Standard deviation of normal values about their median, by the median of their distances to it."""
    return float(median_std(values - np.median(values)))


def blocked_fit(
    columns: np.ndarray, right: np.ndarray, time: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Least squares where errors last, and the standard deviation by the jackknife over the run's parts.

    It is no less than that by the noise of what is left, as if this were white.

    Args:
        columns: (d n, k), what one unit of each unknown gives.
        right: (d n,), d quantities one after the other.
        time: (n,), of each of their rows [s].

    Returns:
        Two arrays (k,).
    """
    several = right.size // time.size
    block = np.tile((FEWEST * np.arange(time.size)) // time.size, several)

    def solved(keep: np.ndarray) -> np.ndarray:
        return np.linalg.lstsq(columns[keep], right[keep], rcond=None)[0]

    value = solved(np.ones(right.size, bool))
    parts = np.array([solved(block != k) for k in range(FEWEST)])
    std = np.sqrt((FEWEST - 1) / FEWEST * ((parts - parts.mean(axis=0)) ** 2).sum(axis=0))
    left = noise((right - columns @ value)[:, None])[0]
    return value, np.maximum(std, left * np.sqrt(np.diag(pinvh(columns.T @ columns))))
