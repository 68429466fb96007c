"""The project's windows of prediction, predicted by any law of motion.

Windows, start states, samples and errors are those of :class:`diagnosis.Windows`; the law is another's.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from diagnosis import Model, Smoothed, Windows
from fmus.frames import rotate_to_body
from fmus.ops import wrap
from fmus.signals import Force
from fmus.vessel.vessel import State, blown, disturbed

DELAYS = (0.0, 0.4)  # s, of the commands; a search goes on beyond the last
UNSURE = 3.0  # times the median standard deviation of acceleration: there none is known; chosen


class Law(Protocol):
    """How a ship moves on.

    Attributes:
        h: step [s].
        lags: how many steps it looks back, 1 or more.
        delay: of the commands [s].
    """

    h: float
    lags: int
    delay: float

    def step(self, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """Body-fixed velocity (w, 3) a step later.

        Args:
            nu: (lags, w, 3), the last ones [m/s, m/s, rad/s], the present one at the end.
            given: (lags, w, k), mean commands of the steps up to the one ahead; behind them, where the
                wind is measured, the body-fixed velocity of the air over ground [m/s, m/s].
        """
        ...


@dataclass(frozen=True)
class Continuous:
    """A law that gives nu_dot (w, 3) of nu (w, 3) and what is given (w, k)."""

    acceleration: Any
    h: float
    delay: float = 0.0
    lags: int = 1

    def step(self, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """By the midpoint rule."""
        half = nu[-1] + 0.5 * self.h * self.acceleration(nu[-1], given[-1])
        return nu[-1] + self.h * self.acceleration(half, given[-1])


class Nominal:
    """The nominal model as functions of velocity (n, 3) and what is given (n, k), see :class:`Law`."""

    def __init__(self, model: Model, layout: np.ndarray) -> None:
        drive, self.hull = model.drive, model.hull
        self.layout, self.width = model.ship.layout_of(layout), layout.shape[1]
        self.drive = drive._replace(effects=drive.effects._replace(layout=self.layout))

    def push(self, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """(n, 3), force of the actuators [N, N, N m]."""
        commands = tuple(given[:, : self.width].T)
        now = self.layout.running(0.0, *nu.T, commands, self.drive)
        return np.column_stack(np.broadcast_arrays(*self.layout.act(commands, now, self.drive)))

    def acceleration(self, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """nu_dot (n, 3) [m/s2, m/s2, rad/s2]."""
        return self._moved(nu, given, self.push(nu, given))

    def _moved(self, nu: np.ndarray, given: np.ndarray, push: np.ndarray) -> np.ndarray:
        s, air = State(0.0, 0.0, 0.0, *nu.T, 0.0), given[:, self.width :].T  # seen from aboard
        hull = blown(self.hull, s, *air) if air.size else self.hull
        return np.column_stack(np.broadcast_arrays(*disturbed(s, Force(*push.T), hull)))

    def inputs(self, kind: str, nu: np.ndarray, given: np.ndarray) -> np.ndarray:
        """What a method learns from: ``commands`` with the air, or their nominal ``forces``.

        The force of the wind is one at rest [m/s2, m/s2, rad/s2].
        """
        if kind == "commands":
            return given
        push = self.push(nu, given)
        if given.shape[1] == self.width:
            return push
        still = np.zeros_like(nu)
        return np.hstack([push, self._moved(still, given, still)])


class Table(NamedTuple):
    """A run at equal distances of time, as a method may learn from it; NaN where nothing is known.

    Attributes:
        h: distance of the rows [s].
        nu, nu_dot: (n, 3), velocity and acceleration, body-fixed, from the smoother that knows no model.
        given: (n, k), mean commands from a row to the next, and air, see :class:`Law`.
        pose: (n, 3), the nearest raw sample [m, m, rad], heading continuous.
        noise: (3,), standard deviation of ``pose``.
    """

    h: float
    nu: np.ndarray
    nu_dot: np.ndarray
    given: np.ndarray
    pose: np.ndarray
    noise: np.ndarray

    @property
    def parts(self) -> list[slice]:
        """Stretches in which everything is known, of ten rows or more."""
        known = np.isfinite(np.hstack([self.nu, self.nu_dot])).all(axis=1)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], known.astype(int), [0]])))
        return [slice(a, b) for a, b in edges.reshape(-1, 2) if b - a >= 10]


def table(smoothed: Smoothed, h: float, delay: float = 0.0) -> Table:
    """A run for a method that looks at every h seconds, commands late by ``delay`` [s]."""
    time = np.arange(smoothed.time[0], smoothed.time[-1], h)
    psi, dd, nu = smoothed.eta[:, 2], smoothed.eta_ddot, smoothed.nu
    c, s, (u, v, r) = np.cos(psi), np.sin(psi), nu.T
    nu_dot = [c * dd[:, 0] + s * dd[:, 1] + r * v, c * dd[:, 1] - s * dd[:, 0] - r * u, dd[:, 2]]
    spread = smoothed.eta_ddot_std
    sure = (spread < UNSURE * np.nanmedian(spread, axis=0)).all(axis=1)  # not at ends and gaps
    known = np.where(sure[:, None], np.column_stack(nu_dot), np.nan)
    row = np.clip(np.searchsorted(smoothed.time, time), 0, smoothed.time.size - 1)
    raw = np.where(smoothed.used[:, None], smoothed.track.pose, np.nan)
    raw[:, 2] = psi + wrap(raw[:, 2] - psi)
    given = mean_commands(smoothed, time - delay, h)
    if smoothed.air is not None:
        heading = at(smoothed.time, psi[:, None], time)[:, 0]
        given = np.hstack([given, seen_from_aboard(at(smoothed.time, smoothed.air, time), heading)])
    return Table(
        h,
        at(smoothed.time, nu, time),
        at(smoothed.time, known, time),
        given,
        raw[row],
        smoothed.noise,
    )


def stacked(
    runs: Sequence[Smoothed], h: float, delay: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Velocities and accelerations (n, 3), commands (n, k) of all parts of runs; see :func:`table`."""
    parts = [(t, p) for t in (table(r, h, delay) for r in runs) for p in t.parts]
    nu, nu_dot, given = (
        np.vstack([getattr(t, name)[p] for t, p in parts]) for name in ("nu", "nu_dot", "given")
    )
    return nu, nu_dot, given


def at(time: np.ndarray, values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Columns of values (n, k) at the wanted times, by linear interpolation."""
    return np.stack([np.interp(wanted, time, column) for column in values.T], axis=-1)


def mean_commands(smoothed: Smoothed, start: np.ndarray, h: float) -> np.ndarray:
    """(..., k): mean commands over h seconds from ``start`` [s], as shares of force at full power."""
    run = smoothed.track.run
    given = run.commands
    if run.power is not None:  # a setting for all actuators but the last, and one for that
        given = given * np.where(
            np.arange(given.shape[1]) < given.shape[1] - 1, run.power[:, :1], run.power[:, -1:]
        )
    lasting = np.diff(np.append(run.time, run.time[-1] + smoothed.track.period))
    edges = np.append(run.time, run.time[-1] + lasting[-1])
    sums = np.vstack([np.zeros(given.shape[1]), np.cumsum(given * lasting[:, None], axis=0)])
    return (at(edges, sums, start + h) - at(edges, sums, start)) / h


def seen_from_aboard(air: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Velocity of the air (..., 2) along the ship's axes, from one to north and east [m/s]."""
    return np.stack(rotate_to_body(heading, air[..., 0], air[..., 1]), axis=-1)


def law_residuals(law: Law, w: Windows) -> np.ndarray:
    """Measured minus predicted pose (samples, 3) [m, m, rad] of windows, by a law."""
    h, runs = law.h, enumerate(w.runs)
    steps = int(np.ceil(w.length / h - 1e-6))
    parts = [(smoothed, w.start[w.run == k]) for k, smoothed in runs]
    back, ahead = h * np.arange(1 - law.lags, 1), h * np.arange(1 - law.lags, steps)
    given = np.concatenate(
        [mean_commands(s, start + ahead[:, None] - law.delay, h) for s, start in parts], axis=1
    )
    nu = np.concatenate([at(s.time, s.nu, start + back[:, None]) for s, start in parts], axis=1)
    eta = np.concatenate([at(s.time, s.eta, start) for s, start in parts])
    winds = [at(s.time, s.air, start + ahead[:, None]) for s, start in parts if s.air is not None]
    air = np.concatenate(winds, axis=1) if winds else None
    if air is not None:
        given = np.concatenate([given, seen_from_aboard(air, eta[:, 2])], axis=-1)
    nu = np.where(np.isfinite(nu), nu, nu[-1:])  # before the first sample: as at the start
    poses, place = [eta], w.since / h
    with np.errstate(all="ignore"):
        for k in range(steps):
            if air is not None:
                now = k + law.lags - 1
                given[now, :, -2:] = seen_from_aboard(air[now], poses[-1][:, 2])
            after = np.clip(np.nan_to_num(law.step(nu, given[k : k + law.lags]), nan=1e6), -1e6, 1e6)
            poses.append(moved(poses[-1], 0.5 * (nu[-1] + after), h))
            nu = np.concatenate([nu[1:], after[None]])
        k = np.clip(np.floor(place + 1e-6).astype(int), 0, steps - 1)
        track = np.array(poses)
        low, high = track[k, w.sample_window], track[k + 1, w.sample_window]
        residuals = w.measured - (low + (place - k)[:, None] * (high - low))
        residuals[:, 2] = wrap(residuals[:, 2])
    return residuals


def law_errors(law: Law, w: Windows) -> tuple[float, float]:
    """Root mean square errors of position [m] and heading [rad] over all windows."""
    position, heading = w.summary(law_residuals(law, w)).over_all()
    return float(position), float(heading)


def moved(eta: np.ndarray, nu: np.ndarray, h: float) -> np.ndarray:
    """Pose (w, 3) after h seconds of a mean velocity (w, 3)."""
    psi = eta[:, 2] + 0.5 * h * nu[:, 2]
    c, s = np.cos(psi), np.sin(psi)
    rate = np.column_stack([c * nu[:, 0] - s * nu[:, 1], s * nu[:, 0] + c * nu[:, 1], nu[:, 2]])
    return eta + h * rate
