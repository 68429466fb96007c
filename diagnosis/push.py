"""What the commands do to the pose: known beforehand but for some numbers, which the data give.

A thruster's force jumps with its command, and a smoother that knows nothing of it takes every jump for
noise or noise for a jump. The acceleration is therefore taken for a body-fixed one that is linear in the
commands of some time ago, plus one that is smooth. Gains and delay come from least squares between
commands and pose; no model of a ship enters.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import cho_solve_banded
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from .cleaning import Track
from .fitting import Fit, Problem, likeliest, solve, tuned
from .spline import Knots

FORGOTTEN = 30.0  # s; slower than that a push is no different from any smooth motion
DELAYS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # s, that are tried first
SURE = 0.01  # s, of a delay
ROUNDS = 3  # of gains and smoothness in turn
PRICE = 20.0  # twice the number of gains and delay: so much likelier they must make the pose
LEAST = 1e-9  # share of what the best known combination of gains tells; below, one is left at zero


class Push(NamedTuple):
    """What commands do, but for a smooth motion.

    Attributes:
        eta, eta_dot, eta_ddot: (n, 3), pose and derivatives [m, m, rad; /s; /s2].
        late: after how long commands act [s]; NaN where they tell nothing.
    """

    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray
    late: float = np.nan

    @classmethod
    def none(cls, n: int) -> "Push":
        """What no command does, for n samples."""
        still = np.zeros((n, 3))
        return cls(still, still, still)


@dataclass(frozen=True, eq=False)
class Course:
    """A run's commands and headings on even times.

    Attributes:
        track: the run.
        psi: (n,), its heading [rad], NaN where it is not known.
        grid: knots of the stretches, which know nothing of each other, times counted from the first.
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
        """Where each stretch but the first begins among them."""
        return np.cumsum([part.size for part in self.parts])[:-1]

    @cached_property
    def turn(self) -> np.ndarray:
        """(m,), from body to earth: a rotation in the complex plane, north its real axis."""
        known = np.isfinite(self.psi)
        return np.exp(1j * np.interp(self.even, self.track.run.time[known], self.psi[known]))

    def asked(self, late: float) -> np.ndarray:
        """(m, 3), tau that was asked for ``late`` [s] before each even time."""
        soon = self.even - late + 1e-6 * self.track.period
        row = np.searchsorted(self.track.run.time, soon, side="right") - 1
        return self.track.run.tau_cmd[np.maximum(row, 0)]

    def seen(self, x: np.ndarray, rows: Any = slice(None)) -> np.ndarray:
        """Signals (m, k) at the run's rows."""
        time = self.track.run.time[rows]
        return np.column_stack([np.interp(time, self.even, column) for column in x.T])

    def moved(self, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Position and velocity (m, k) that accelerations (m, k), each held for a step, have led to.

        Motion is forgotten, (d/dt + 1/T)^2 x = a, or it would grow beyond all numbers. First comes
        w = (d/dt + 1/T) x.
        """
        h, T = self.track.period, FORGOTTEN
        kept = np.exp(-h / T)
        w = self._recalled(T * (1.0 - kept) * a, kept)
        x = self._recalled(h * kept * w + T * (T * (1.0 - kept) - h * kept) * a, kept)
        return x, w - x / T

    def _recalled(self, x: np.ndarray, kept: float) -> np.ndarray:
        """Sum (m, k) of all that was before in a stretch, a share kept from one time to the next."""
        parts = [lfilter([0.0, 1.0], [1.0, -kept], part, axis=0) for part in np.split(x, self.first)]
        return np.concatenate(parts)

    def push(self, G: np.ndarray, late: float) -> Push:
        """What commands do by gains (3, 3), body-fixed acceleration for a unit of each."""
        surge, sway, yaw = (self.asked(late) @ G.T).T
        a = np.column_stack([self.turn * (surge + 1j * sway), yaw])
        x, x_dot = self.moved(a)
        x_ddot = a - 2.0 * x_dot / FORGOTTEN - x / FORGOTTEN**2
        eta, eta_dot, eta_ddot = (_apart(self.seen(each)) for each in (x, x_dot, x_ddot))
        return Push(eta, eta_dot, eta_ddot, late)


def _apart(x: np.ndarray) -> np.ndarray:
    """North, east and heading (n, 3) of the first two as one complex number, and the third (n, 2)."""
    return np.column_stack([np.real(x[:, 0]), np.imag(x[:, 0]), np.real(x[:, 1])])


def followed(
    even: Problem, smoothness: np.ndarray, fit: Fit, weights: np.ndarray, course: Course
) -> tuple[np.ndarray, Fit, Push]:
    """A smooth spline beside what the commands do, if that is likelier than a spline alone.

    Args:
        even: the pose, with an even penalty.
        smoothness, fit: (3,), of a spline that knows of no commands, and the spline.
        weights: (n,), of the samples.
        course: commands and headings.

    Returns:
        Smoothness (3,) and spline of what the commands do not do, and what they do.
    """
    pushed, likely = Push.none(course.psi.size), likeliest(even, weights)[1] - PRICE
    late = delay(even, fit, weights, course)
    rest, smoother = even, smoothness
    for _ in range(ROUNDS):
        more = course.push(gains(even, fit, weights, course, late)[0], late)
        tried = even._replace(z=even.z - more.eta[even.rows])
        found, cost = likeliest(tried, weights)
        if cost >= likely:
            break
        rest, smoother, pushed, likely = tried, found, more, cost
        fit = solve(rest, smoother, weights)
    if rest is even:
        return smoothness, fit, pushed
    adapted, smoother = tuned(rest, smoother, weights)
    return smoother, solve(adapted, smoother, weights), pushed


def delay(even: Problem, fit: Fit, weights: np.ndarray, course: Course) -> float:
    """After how long [s] commands act, as far as the pose tells; arguments as of :func:`followed`."""

    def left(late: float) -> float:
        return -gains(even, fit, weights, course, late)[1]

    best = float(min(DELAYS, key=left))
    around = max(best - DELAYS[1], 0.0), best + DELAYS[1]
    found: Any = minimize_scalar(left, bounds=around, method="bounded", options={"xatol": SURE})
    return min(best, float(found.x), key=left)


def gains(
    problem: Problem, fit: Fit, weights: np.ndarray, course: Course, late: float
) -> tuple[np.ndarray, float]:
    """Body-fixed acceleration for a unit of each command, (3, 3), and how much of the rest it takes.

    Args:
        problem, fit: the pose, and a smooth spline.
        weights: (n,), of the samples.
        course: commands and headings.
        late: after how long commands act [s].
    """
    tau = course.asked(late)
    ahead = course.seen(course.moved(course.turn[:, None] * tau)[0], problem.rows)
    yaw = course.seen(course.moved(tau)[0], problem.rows)
    # What pushes to starboard pushes as what pushes ahead does, a right angle further.
    north, east = np.real(ahead), np.imag(ahead)
    plane = {0: np.hstack([north, -east]), 1: np.hstack([east, north])}
    (flat, taken), (turn, more) = (_least(problem, fit, weights, c) for c in (plane, {2: yaw}))
    return np.vstack([flat.reshape(2, 3), turn]), taken + more


def _least(
    problem: Problem, fit: Fit, weights: np.ndarray, columns: Mapping[int, np.ndarray]
) -> tuple[np.ndarray, float]:
    """What is not smooth in some channels by columns (n, k) each: numbers (k,), and what they take."""
    told: Any = 0.0
    wanted: Any = 0.0
    for c, A in columns.items():
        right = problem.b.matrix.T @ (weights[:, None] * A)
        rough = A - problem.b(cho_solve_banded((fit.factors[c], True), right))
        rough *= weights[:, None] / problem.sigma[c] ** 2
        told = told + A.T @ rough
        wanted = wanted + problem.z[:, c] @ rough
    size = np.sqrt(np.maximum(np.diag(told), 1e-300))
    found = np.linalg.lstsq(told / np.outer(size, size), wanted / size, rcond=LEAST)[0] / size
    return found, float(wanted @ found)
