"""The motion that commands would give a ship that is nothing but a mass, and how late they act.

    x(t):  (d/dt + 1/T)^2 x = R(psi) [G tau_late + H tau_slow],

on evenly spaced times, of commands that are held from row to row. tau_late is tau behind a delay or a
lag, tau_slow the same behind a lag of a second.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from fmus.scale import Scale
from fmus.ship import ship

from ..cleaning import Track, between
from ..held_signal import Integral
from ..linear_filter import filtered
from .spline import Knots

# Of CyberShip Enterprise 1, times the scale of the ship.
# [m/s, m/s, rad/s] a ship slower than that at a run's start had no thrusters at work before. Chosen; of
# a turn at 0.035 rad/s at the start, by noise alone, a run of the Otter was predicted nine times worse.
IDLE = (0.02, 0.02, 0.05)
FORGETTING = 30.0  # s, T; a slower motion by the commands is like any smooth motion (chosen)
# s, lag of tau_slow. Chosen: above the periods in which a controller answers noise, and below the time
# in which a ship gets under way, so that damping is in it.
SLOW = 1.0


def idle(scale: Scale) -> np.ndarray:
    """(3,), speeds [m/s, m/s, rad/s] below which a ship of a size hardly moves."""
    return np.multiply(IDLE, scale.speeds)


def acting(track: Track, surge: np.ndarray) -> tuple[Track, bool]:
    """A run whose commanded force is that behind the described lags, and at its speed.

    A rudder in a free flow has no force at rest, and a force that comes later than its command is none
    that jumps: a smoother that takes it for one shifts the motion to the front.

    Args:
        track: the run.
        surge: (n,), its speed ahead [m/s].

    Returns:
        The run, and whether its yaw moment depends on the speed, as that of a rudder.
    """
    run = track.run
    of = ship(description=run.ship)
    layout, given = of.layout_of(run.commands), run.commands
    if given is None:
        if not any(layout.lags):
            return track, False
        shares = layout.allocate(tuple(run.tau_cmd.T), of.nominal_drive.params)
        given = np.column_stack(np.broadcast_arrays(*shares))
    steps = np.diff(run.time, append=run.time[-1] + track.period)
    each = zip(given.T, layout.lags, layout.round, strict=True)
    commands = [lagged(np.unwrap(c) if angle else c, steps, lag) for c, lag, angle in each]
    at_rest, tau = (of.commanded_force(np.column_stack(commands), run.power, u) for u in (0.0, surge))
    steered = bool((tau[:, 2] != at_rest[:, 2]).any())
    return replace(track, run=replace(run, tau_cmd=tau)), steered


def lagged(x: np.ndarray, steps: np.ndarray, lag: float) -> np.ndarray:
    """Means over steps [s] of a signal behind a lag of first order [s], x (n,) being held over each.

    The signal before is the first.
    """
    if lag == 0.0:
        return x
    kept = np.exp(-steps / lag)
    rises = zip(kept.tolist(), ((1.0 - kept) * x).tolist(), strict=True)
    found = accumulate(rises, lambda y, step: step[0] * y + step[1], initial=float(x[0]))
    begin = np.array([*found])[:-1]
    return x + (begin - x) * (1.0 - kept) * lag / steps


class Lateness(NamedTuple):
    """How late commands act.

    Attributes:
        delay: from a command to its effect [s].
        lag: time constant of first order, behind the delay [s].
    """

    delay: float = 0.0
    lag: float = 0.0


PROMPT = Lateness()


class Gains(NamedTuple):
    """Accelerations in the body frame.

    Attributes:
        force: G (3, 3), by a unit of each command.
        bend: share of :attr:`Commands.bend` that acts.
        slow: H (3, 3), by a unit of each command behind a lag; 0: none.
    """

    force: np.ndarray
    bend: float
    slow: np.ndarray | float = 0.0


class CommandResponse(NamedTuple):
    """The motion that follows from the commands, but for a smooth one.

    Attributes:
        eta, eta_dot, eta_ddot: (n, 3), pose and derivatives [m, m, rad; /s; /s2].
        delay: from a command to its effect [s]; NaN where the commands explain nothing.
        sure: whether the whole run agrees that there is a delay.
        described: whether G is that of the ship's description.
        late: how late the commands act in this motion.
    """

    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    delay: float = np.nan
    sure: bool = False
    described: bool = False
    late: Lateness = PROMPT


@dataclass(frozen=True, eq=False)
class Commands:
    """A run's commands and headings on evenly spaced times.

    Attributes:
        track: the run.
        psi: (n,), its heading [rad], NaN where it is not known.
        grid: knots of the stretches, independent of each other, times counted from the first sample.
        at_rest: whether the ship hardly moves at first: then nothing was commanded before the run.
        swing: (n,), u r [m/s2], by which the way bends where the heading turns.
    """

    track: Track
    psi: np.ndarray
    grid: Knots
    at_rest: bool = False
    swing: np.ndarray = field(default_factory=lambda: np.zeros(0))

    @property
    def forgetting(self) -> float:
        """T [s]."""
        return FORGETTING * self.track.scale.time

    @cached_property
    def parts(self) -> list[np.ndarray]:
        """Times [s] of each stretch, one for each measurement that there should be."""
        first, h = self.track.run.time[0], self.track.period
        return [
            first + np.arange(a, b + h, h) for a, b in zip(self.grid.start, self.grid.end, strict=True)
        ]

    @cached_property
    def even(self) -> np.ndarray:
        """(m,), times [s] of all stretches."""
        return np.concatenate(self.parts)

    @cached_property
    def rotation(self) -> np.ndarray:
        """(m,), from body to earth: a rotation in the complex plane, north its real axis."""
        known = np.isfinite(self.psi)
        return np.exp(1j * np.interp(self.even, self.track.run.time[known], self.psi[known]))

    def delayed(self, delay: float) -> np.ndarray:
        """(m, 3), mean of tau over each even step, as commanded ``delay`` [s] before [N, N, N m].

        A mean, as rounded time stamps put the jump of a command a little before or behind a step's edge.
        """
        given = self.even - delay
        return (self._impulse(given + self.track.period) - self._impulse(given)) / self.track.period

    @cached_property
    def bend(self) -> np.ndarray:
        """(m,), u r over each even step, an acceleration to starboard in the complex plane."""
        known = np.isfinite(self.swing)
        middle = self.even + 0.5 * self.track.period
        swing = np.interp(middle, self.track.run.time[known], self.swing[known])
        return 1j * self.rotation * swing

    def tau_late(self, late: Lateness) -> np.ndarray:
        """tau_late (m, 3), means over the even steps [N, N, N m]."""
        tau, h = self.delayed(late.delay), self.track.period
        if late.lag == 0.0:
            return tau
        # Before a stretch the command was its first, of a ship at rest none.
        sizes = [part.size for part in self.parts]
        before = tau[np.cumsum([0, *sizes[:-1]])]
        if self.at_rest:
            before[0] = 0.0
        before = before.repeat(sizes, axis=0)
        behind = before + self.lagging(tau - before, late.lag)
        return tau + (behind - tau) * late.lag / h * (1.0 - np.exp(-h / late.lag))

    def slow(self, late: Lateness) -> np.ndarray:
        """tau_slow (m, 3) [N, N, N m]."""
        return self.lagging(self.tau_late(late), SLOW * self.track.scale.time)

    def lagging(self, tau: np.ndarray, lag: float) -> np.ndarray:
        """Commands (m, 3) behind a lag of first order [s]; from zero in each stretch."""
        kept = np.exp(-self.track.period / lag)
        return self._recursion((1.0 - kept) * tau, kept)

    @cached_property
    def _impulse(self) -> Integral:
        """Integral of the commands [N s, N s, N m s]."""
        time, tau = self.track.run.time, self.track.run.tau_cmd
        edges = np.append(time, time[-1] + self.track.period)
        return Integral(edges, tau, 0.0 * tau[0] if self.at_rest else tau[0])

    def motion(self, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (m, k) by accelerations (m, k), each held for a step.

        (d/dt + 1/T)^2 x = a forgets, as a double integral would grow beyond all numbers. First comes
        w = (d/dt + 1/T) x.
        """
        h, T = self.track.period, self.forgetting
        kept = np.exp(-h / T)
        w = self._recursion(T * (1.0 - kept) * a, kept)
        x = self._recursion(h * kept * w + T * (T * (1.0 - kept) - h * kept) * a, kept)
        return x, w - x / T

    def _recursion(self, x: np.ndarray, kept: float) -> np.ndarray:
        """y (m, k) with y_i = kept y_(i-1) + x_(i-1), from zero in each stretch."""
        parts = np.split(x, np.cumsum([part.size for part in self.parts])[:-1])
        return np.concatenate([filtered((0.0, 1.0), (1.0, -kept), part) for part in parts])

    def response(self, gains: Gains, late: Lateness = PROMPT) -> CommandResponse:
        """The motion by the commands, and by the bend of the way."""
        accelerations = self.tau_late(late) @ gains.force.T
        if np.any(gains.slow):
            accelerations = accelerations + self.slow(late) @ np.transpose(gains.slow)
        surge, sway, yaw = accelerations.T
        plane = self.rotation * (surge + 1j * sway)
        if gains.bend:
            plane = plane + gains.bend * self.bend
        a = np.column_stack([plane, yaw])
        x, x_dot = self.motion(a)
        x_ddot = a - 2.0 * x_dot / self.forgetting - x / self.forgetting**2
        sampled = (between(self.track.run.time, self.even, each).T for each in (x, x_dot, x_ddot))
        eta = [np.column_stack([plane.real, plane.imag, yaw.real]) for plane, yaw in sampled]
        return CommandResponse(eta[0], eta[1], eta[2], late.delay, late=late)
