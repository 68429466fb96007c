"""What the commands do to the pose: known beforehand but for a few gains, which the data give.

A thruster's force jumps with its command, and a smoother that knows nothing of it takes every jump for
noise or noise for a jump. The acceleration is therefore taken for a body-fixed one that is linear in the
commands, plus one that is smooth. The gains come from least squares between commands and pose; no model
of a ship enters.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import cho_solve_banded
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from fmus.frames import rotate_to_earth

from .cleaning import Track
from .fitting import Fit, Problem, likeliest, solve, tuned

FORGOTTEN = 30.0  # s; slower than that a push is no different from any smooth motion
DELAYS = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)  # s, that are tried first
SURE = 0.01  # s, of a delay
ROUNDS = 3  # of gains and smoothness in turn
PRICE = (
    20.0  # twice the number of gains and delay: what they must take from minus twice the log likelihood
)
LEAST = 1e-9  # share of what the best known combination of gains tells; below, one is left at zero


class Push(NamedTuple):
    """Pose, velocity and acceleration (n, 3) [m, m, rad; /s; /s2], but for a smooth motion."""

    eta: np.ndarray
    eta_dot: np.ndarray
    eta_ddot: np.ndarray

    @classmethod
    def none(cls, n: int) -> "Push":
        """What no command does, for n samples."""
        return cls(*np.zeros((3, n, 3)))


def followed(
    even: Problem, smoothness: np.ndarray, fit: Fit, weights: np.ndarray, track: Track, psi: np.ndarray
) -> tuple[np.ndarray, Fit, Push]:
    """A smooth spline beside what the commands do, if that is likelier than a spline alone.

    Args:
        even: the pose, with an even penalty.
        smoothness, fit: (3,), of a spline that knows of no commands, and the spline.
        weights: (n,), of the samples.
        track, psi: see :func:`push`.

    Returns:
        Smoothness (3,) and spline of what the commands do not do, and what they do.
    """
    pushed, likely = Push.none(track.run.time.size), likeliest(even, weights)[1] - PRICE
    late = delay(even, fit, weights, track, psi)
    for _ in range(ROUNDS):
        G, _ = gains(even, fit, weights, track, psi, late)
        more = push(track, psi, commands(track, late) @ G.T)
        adapted, smoother, cost = tuned(even._replace(z=even.z - more.eta[even.rows]), weights)
        if cost >= likely:
            break
        smoothness, fit, pushed, likely = smoother, solve(adapted, smoother, weights), more, cost
    return smoothness, fit, pushed


def commands(track: Track, late: float) -> np.ndarray:
    """(n, 3), tau as it was asked for ``late`` [s] before each sample."""
    time = track.run.time
    row = np.searchsorted(time, time - late + 1e-6 * track.period, side="right") - 1
    return track.run.tau_cmd[np.maximum(row, 0)]


def delay(even: Problem, fit: Fit, weights: np.ndarray, track: Track, psi: np.ndarray) -> float:
    """After how long [s] commands act, as far as the pose tells; arguments as of :func:`followed`."""

    def left(late: float) -> float:
        return -gains(even, fit, weights, track, psi, late)[1]

    best = float(min(DELAYS, key=left))
    around = max(best - DELAYS[1], 0.0), best + DELAYS[1]
    found: Any = minimize_scalar(left, bounds=around, method="bounded", options={"xatol": SURE})
    return min(best, float(found.x), key=left)


def push(track: Track, psi: np.ndarray, acceleration: np.ndarray) -> Push:
    """What a body-fixed acceleration does to the pose at each sample.

    Args:
        track: the run.
        psi: (n,), heading [rad], NaN where it is not known.
        acceleration: (n, 3), from each sample to the next [m/s2, m/s2, rad/s2].
    """
    time, h = track.run.time, track.period
    even = np.arange(time[0], time[-1] + h, h)
    row = np.searchsorted(time, even + 1e-6 * h, side="right") - 1
    known = np.isfinite(psi)
    turned = np.interp(even, time[known], psi[known])
    a = np.column_stack([*rotate_to_earth(turned, *acceleration[row, :2].T), acceleration[row, 2]])
    # (d/dt + 1/T)^2 x = a, with a held from sample to sample: w = (d/dt + 1/T) x comes first.
    T, kept = FORGOTTEN, np.exp(-h / FORGOTTEN)
    w = _recalled(T * (1.0 - kept) * a, kept)
    x = _recalled(h * kept * w + T * (T * (1.0 - kept) - h * kept) * a, kept)
    x_dot = w - x / T
    x_ddot = a - w / T - x_dot / T
    return Push(*(np.column_stack([np.interp(time, even, c) for c in y.T]) for y in (x, x_dot, x_ddot)))


def _recalled(x: np.ndarray, kept: float) -> np.ndarray:
    """Sum (n, 3) of all that was there before each sample, a share of it kept from one to the next."""
    return np.asarray(lfilter([0.0, 1.0], [1.0, -kept], x, axis=0))


def gains(
    problem: Problem, fit: Fit, weights: np.ndarray, track: Track, psi: np.ndarray, late: float
) -> tuple[np.ndarray, float]:
    """Body-fixed acceleration for a unit of each command, (3, 3), and how much of the rest it takes.

    Args:
        problem, fit: the pose, and a smooth spline.
        weights: (n,), of the samples.
        track, psi: see :func:`push`.
        late: after how long commands act [s].
    """
    tau = commands(track, late)
    columns = np.empty((9, len(problem.rows), 3))
    for k, (axis, command) in enumerate(np.ndindex(3, 3)):
        along = np.zeros_like(tau)
        along[:, axis] = tau[:, command]
        columns[k] = push(track, psi, along).eta[problem.rows]
    told, wanted = np.zeros((9, 9)), np.zeros(9)
    for c in range(3):
        A = columns[:, :, c].T
        right = problem.b.matrix.T @ (weights[:, None] * A)
        rough = A - problem.b(cho_solve_banded((fit.factors[c], True), right))
        rough *= weights[:, None] / problem.sigma[c] ** 2
        told += A.T @ rough
        wanted += problem.z[:, c] @ rough
    size = np.sqrt(np.maximum(np.diag(told), 1e-300))
    found = np.linalg.lstsq(told / np.outer(size, size), wanted / size, rcond=LEAST)[0] / size
    return found.reshape(3, 3), float(wanted @ found)
