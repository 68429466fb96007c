"""The part of the motion that follows from the commands: known beforehand but for gains and a delay.

A thruster's force jumps with its command, and a smoother that does not know it takes every jump for
noise or noise for a jump. The pose is therefore modelled as

    eta(t) = f(t) + x(t),    (d/dt + 1/T)^2 x = R(psi) G tau(t - delay),

f a smoothing spline (:mod:`.penalised`), G constant gains from the commanded force to a body-fixed
acceleration, one 2 x 3 block for the plane and one row for yaw. Gains and delay have the largest
likelihood with f integrated out, which is generalised least squares: with A the motions for unit gains,
P the hat matrix of the spline, and r(a) the residuals [sqrt(W) (a - P a), sqrt(s) roughness of P a],

    g = argmin |r(z) - r(A) g|^2,    taken = r(z)^T r(A) g / sigma^2.

No model of a ship enters.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError
from scipy.signal import lfilter

from ..data import Track
from .likelihood import adapt, likeliest
from .penalised import Fit, Problem, solve
from .spline import Knots

FORGETTING = (
    30.0  # s, T; a slower motion by the commands is no different from any smooth motion (chosen)
)
COARSE = 0.2  # s, between the delays that are tried first
LONGEST = 1.0  # s, of these; a ship of this size has 0.4 s (docs/studies/measured_ship)
FINE = 0.01  # s, to which a delay is found, or a sampling period if that is longer
# Of a sampling period: commands that are so little late are on time. Far above the rounding of time
# stamps, far below any jitter.
ROUNDING = 1e-3
ROUNDS = 3  # of gains and smoothness in turn; further ones change neither (chosen)
# Least fall of -2 log L by gains and delay: twice their number, 9 + 1 (Akaike's criterion).
PARAMETERS = 20.0
# Least fall of -2 log L by another round: far above rounding, and far below what any parameter is worth.
BETTER = 1e-3
RANK = 1e-9  # of the largest singular value; below, commands do not differ and share their effect evenly


class CommandResponse(NamedTuple):
    """The motion that follows from the commands, but for a smooth one.

    Attributes:
        eta, eta_dot, eta_ddot: (n, 3), pose and derivatives [m, m, rad; /s; /s2].
        delay: from a command to its effect [s]; NaN where the commands explain nothing.
    """

    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    delay: float = np.nan

    @classmethod
    def none(cls, n: int) -> "CommandResponse":
        """No response, for n samples."""
        still = np.zeros((n, 3))
        return cls(still, still, still)


@dataclass(frozen=True, eq=False)
class Commands:
    """A run's commands and headings on evenly spaced times.

    Attributes:
        track: the run.
        psi: (n,), its heading [rad], NaN where it is not known.
        grid: knots of the stretches, independent of each other, times counted from the first sample.
    """

    track: Track
    psi: np.ndarray
    grid: Knots

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
    def first(self) -> np.ndarray:
        """Index of the start of each stretch but the first among them."""
        return np.cumsum([part.size for part in self.parts])[:-1]

    @cached_property
    def rotation(self) -> np.ndarray:
        """(m,), from body to earth: a rotation in the complex plane, north its real axis."""
        known = np.isfinite(self.psi)
        return np.exp(1j * np.interp(self.even, self.track.run.time[known], self.psi[known]))

    def delayed(self, delay: float) -> np.ndarray:
        """(m, 3), tau that was commanded ``delay`` [s] before each even time [N, N, N m]."""
        given = self.even - delay + ROUNDING * self.track.period
        row = np.searchsorted(self.track.run.time, given, side="right") - 1
        return self.track.run.tau_cmd[np.maximum(row, 0)]

    def sampled(self, x: np.ndarray, rows: Any = slice(None)) -> np.ndarray:
        """Signals (m, k) at the run's rows."""
        time = self.track.run.time[rows]
        return np.column_stack([np.interp(time, self.even, column) for column in x.T])

    def motion(self, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (m, k) by accelerations (m, k), each held for a step.

        (d/dt + 1/T)^2 x = a forgets, as a double integral would grow beyond all numbers. First comes
        w = (d/dt + 1/T) x.
        """
        h, T = self.track.period, FORGETTING
        kept = np.exp(-h / T)
        w = self._recursion(T * (1.0 - kept) * a, kept)
        x = self._recursion(h * kept * w + T * (T * (1.0 - kept) - h * kept) * a, kept)
        return x, w - x / T

    def _recursion(self, x: np.ndarray, kept: float) -> np.ndarray:
        """y (m, k) with y_i = kept y_(i-1) + x_(i-1), from zero in each stretch."""
        parts = [lfilter([0.0, 1.0], [1.0, -kept], part, axis=0) for part in np.split(x, self.first)]
        return np.concatenate(parts)

    def response(self, gains: np.ndarray, delay: float) -> CommandResponse:
        """The motion by gains (3, 3), body-fixed acceleration by a unit of each, and a delay [s]."""
        surge, sway, yaw = (self.delayed(delay) @ gains.T).T
        a = np.column_stack([self.rotation * (surge + 1j * sway), yaw])
        x, x_dot = self.motion(a)
        x_ddot = a - 2.0 * x_dot / FORGETTING - x / FORGETTING**2
        eta, eta_dot, eta_ddot = (_channels(self.sampled(each)) for each in (x, x_dot, x_ddot))
        return CommandResponse(eta, eta_dot, eta_ddot, delay)


def _channels(x: np.ndarray) -> np.ndarray:
    """North, east and heading (n, 3) of the first two as one complex number, and the third (n, 2)."""
    return np.column_stack([np.real(x[:, 0]), np.imag(x[:, 0]), np.real(x[:, 1])])


def with_commands(
    even: Problem, smoothness: np.ndarray, fit: Fit, weights: np.ndarray, commands: Commands
) -> tuple[np.ndarray, Fit, CommandResponse]:
    """A smoothing spline beside the response to the commands, if that is likelier than a spline alone.

    Args:
        even: the pose, with an even penalty.
        smoothness, fit: (3,), of a spline that knows of no commands, and the spline.
        weights: (n,), of the samples.
        commands: commands and headings.

    Returns:
        Smoothness (3,) and spline of what is left beside the response, and the response.
    """
    response = CommandResponse.none(commands.psi.size)
    least = likeliest(even, weights, smoothness)[1] - PARAMETERS
    delay = likeliest_delay(Regression(even, fit, commands))
    rest, smoother, near = even, smoothness, None
    for _ in range(ROUNDS):
        gains, _ = Regression(even, fit, commands).gains(delay)
        tried = commands.response(gains, delay)
        left = even._replace(z=even.z - tried.eta[even.rows])
        near, cost = likeliest(left, weights, near)
        if cost >= least:
            break
        rest, smoother, response, least = left, near, tried, cost - BETTER
        fit = solve(rest, smoother, weights)
    if rest is even:
        return smoothness, fit, response
    adapted, smoother = adapt(rest, smoother, weights)
    return smoother, solve(adapted, smoother, weights), response


class Regression:
    """Generalised least squares of a run's pose on its commands, beside a spline.

    Args:
        problem: the pose.
        fit: a smoothing spline of it.
        commands: commands and headings.
    """

    def __init__(self, problem: Problem, fit: Fit, commands: Commands) -> None:
        self.problem, self.fit, self.commands = problem, fit, commands
        self._pose = [self._residual(c, problem.z[:, [c]])[:, 0] for c in range(3)]

    def gains(self, delay: float) -> tuple[np.ndarray, float]:
        """Body-fixed acceleration by a unit of each command, (3, 3), and the fall of |r|^2 / sigma^2.

        Args:
            delay: from a command to its effect [s].
        """
        tau, commands, rows = self.commands.delayed(delay), self.commands, self.problem.rows
        ahead = commands.sampled(commands.motion(commands.rotation[:, None] * tau)[0], rows)
        yaw = commands.sampled(commands.motion(tau)[0], rows)
        # A force to starboard moves the ship as one ahead does, a right angle further.
        north, east = np.real(ahead), np.imag(ahead)
        plane = {0: np.hstack([north, -east]), 1: np.hstack([east, north])}
        (flat, taken), (turn, more) = self._least_squares(plane), self._least_squares({2: yaw})
        return np.vstack([flat.reshape(2, 3), turn]), taken + more

    def _residual(self, channel: int, x: np.ndarray) -> np.ndarray:
        """r(x) of signals (n, k) in a channel, in units of the noise."""
        system = self.fit.systems[channel]
        return np.vstack(system.residual(x, system.solve(x))) / self.problem.sigma[channel]

    def _least_squares(self, motions: Mapping[int, np.ndarray]) -> tuple[np.ndarray, float]:
        """Gains (k,) by which motions (n, k) in some channels explain the pose, and the fall."""
        normal: Any = 0.0
        right: Any = 0.0
        for channel, motion in motions.items():
            r = self._residual(channel, motion)
            normal = normal + r.T @ r
            right = right + r.T @ self._pose[channel]
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        if not (np.isfinite(normal).all() and np.isfinite(right).all()):  # LAPACK may not end
            raise LinAlgError("the response to its commands is not finite")
        found = np.linalg.lstsq(normal / np.outer(size, size), right / size, rcond=RANK)[0] / size
        return found, float(right @ found)


def likeliest_delay(regression: Regression) -> float:
    """From a command to its effect [s], as far as the pose shows.

    Commands are held from row to row, so that the likelihood is a step function of the delay. The search
    is over whole sampling periods: coarse at first, then downhill with halved steps.
    """
    period = regression.commands.track.period

    @cache
    def left(periods: int) -> float:
        return -regression.gains(periods * period)[1]

    tried = {round(k * COARSE / period) for k in range(round(LONGEST / COARSE) + 1)}
    best = min(sorted(tried), key=left)
    step, finest = COARSE / period, max(1, round(FINE / period))
    while step > finest:
        step = max(finest, np.ceil(step / 2.0))
        best = min((best, max(best - int(step), 0), best + int(step)), key=left)
    return best * period
