"""System identification by concurrent learning, 7.2: repeated passes of (7.10)-(7.11) over runs.

With F = [-Phi, -R_tau] and phi = (phi, omega_tau), y = omega of (7.7) and eps = y - F phi,

    phi' = beta Gamma (F^T eps + sum_j F_j^T eps_j)

over a window of stored samples, whose errors are formed anew with today's estimate (corrected). A pass
begins with the estimate that the last one ended with.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fmus.controller import cl_improved
from fmus.controller.blocker import BlockerOptions
from fmus.controller.models import SURGE
from fmus.controller.parametrisation import ControllerModel
from fmus.controller.store import SIZE

from .principal_components import sequential
from .samples import Samples, joined

EVERY = 0.05  # s between the samples that are used: a tenth of the quickest motion (chosen)
CHANGE = 0.01  # of the estimate over a pass, below which it has come to rest (7.2.4)
MOST = 60  # passes (chosen)
GAP = 1.0  # s; over a longer gap nothing is learned (chosen)
RIDGE = np.logspace(-8, 0, 17)  # penalties that are tried, of columns of unit root mean square (chosen)
# Gains and thresholds are those of the improved controller.
PARAMS = cl_improved.COMPONENT.params()
GAMMA = np.array(PARAMS.gamma)


def regressors(s: Samples) -> np.ndarray:
    """F (n, 3, 14) of (7.1) and (7.4), with its sign: omega = F phi."""
    parts = SURGE.regressors(tuple(s.nu.T), tuple(s.nu_dot.T), tuple(s.tau.T), ControllerModel())
    F = np.zeros((s.time.size, 3, len(SURGE.coefficients)))
    for axis, (indices, columns) in enumerate(zip(SURGE.pattern, parts, strict=True)):
        for k, column in zip(indices, columns, strict=True):
            F[:, axis, k] = column
    return F


def thinned(s: Samples) -> Samples:
    """Samples of one run no closer than EVERY in time.

    Raises:
        ValueError: time goes back, as where runs are joined.
    """
    if (np.diff(s.time) < 0.0).any():
        raise ValueError(f"time decreases in {', '.join(s.names)}: give each run separately (by_run)")
    place = np.floor((s.time - s.time[0]) / EVERY + 1e-9)
    return s.rows(np.concatenate([[True], np.diff(place) > 0.0]))


def fences(runs: Sequence[Samples]) -> BlockerOptions:
    """Limits of Algorithm 4 from the data: Tukey's far fence (1977) of the norms of all samples.

    It is the third quartile and three times the distance of the quartiles: 4.7 standard deviations of a
    normal distribution.
    """
    norms = [np.linalg.norm(getattr(joined(runs), name), axis=1) for name in ("nu_dot", "nu", "tau")]
    low, high = np.quantile(norms, [0.25, 0.75], axis=1)
    nu_dot, nu, tau = (high + 3.0 * (high - low)).tolist()
    return BlockerOptions(nu_dot, nu, tau, PARAMS.blocker.block_time)


def allowed(s: Samples, limits: BlockerOptions = PARAMS.blocker) -> np.ndarray:
    """beta (n,): False within ``block_time`` after a spike of nu_dot, nu or tau (Algorithm 4)."""
    pairs = ((s.nu_dot, limits.nu_dot_max), (s.nu, limits.nu_max), (s.tau, limits.tau_max))
    spikes = np.any([np.linalg.norm(x, axis=1) > most for x, most in pairs], axis=0)
    last = np.maximum.accumulate(np.where(spikes, s.time, -np.inf))
    return s.time - last > limits.block_time


@dataclass(frozen=True, eq=False)
class Material:
    """One run, ready for passes.

    Attributes:
        F: (n, 3, 14).
        y: (n, 3) [N, N, N m].
        dt: (n,) [s]; zero where nothing is learned.
        stored: (n,), samples that go into the window.
    """

    F: np.ndarray
    y: np.ndarray
    dt: np.ndarray
    stored: np.ndarray


def material(s: Samples, limits: BlockerOptions = PARAMS.blocker) -> Material:
    """What the passes over a run need; which samples are stored does not depend on the estimate."""
    s = thinned(s)
    F, beta = regressors(s), allowed(s, limits)
    dt = np.diff(s.time, prepend=s.time[0])
    stored = np.zeros(s.time.size, bool)
    last = np.zeros(F.shape[1:])
    for k in np.flatnonzero(beta):
        if np.linalg.norm(F[k] - last) >= PARAMS.store.store_change:
            stored[k], last = True, F[k]
    return Material(F, s.omega, np.where(beta & (dt < GAP), dt, 0.0), stored)


def one_pass(phi: np.ndarray, m: Material, gamma: np.ndarray = GAMMA) -> np.ndarray:
    """The estimate (14,) after a run, with gains (14,)."""
    window: deque[int] = deque(maxlen=SIZE)
    Q, b = np.zeros((phi.size, phi.size)), np.zeros(phi.size)
    for F, y, dt, stored, k in zip(m.F, m.y, m.dt, m.stored, range(m.dt.size), strict=True):
        if stored:
            window.append(k)
            rows = list(window)
            A = m.F[rows].reshape(-1, phi.size)
            Q, b = A.T @ A, A.T @ m.y[rows].ravel()
        if dt > 0.0:
            # Explicit Euler with h Gamma trace(Q) <= 1, as in the controllers.
            trace = gamma @ (np.diag(Q) + np.sum(F * F, axis=0))
            pace = dt / max(1.0, dt * trace)
            phi = phi + pace * gamma * (F.T @ (y - F @ phi) + b - Q @ phi)
    return phi


@dataclass(frozen=True, eq=False)
class Identified:
    """What the passes came to.

    Attributes:
        phi: (14,).
        passes: their number.
        change: relative change over the last one.
        least_squares, ridge: (14,), of the same samples at once.
        condition: (3,), of the columns of each axis, divided by their norms.
        own: (14,), share of each column that the others of its axis cannot give.
        passed: share of each run's time in which the spike blocker lets it learn.
    """

    phi: np.ndarray
    passes: int
    change: float
    least_squares: np.ndarray
    ridge: np.ndarray
    condition: np.ndarray
    own: np.ndarray
    passed: list[float]

    @property
    def settled(self) -> bool:
        """Whether the last pass changed less than CHANGE."""
        return self.change < CHANGE


def identify(runs: Sequence[Samples], limits: BlockerOptions = PARAMS.blocker) -> Identified:
    """Passes over runs until the estimate rests.

    Args:
        runs: of the same ship, each by itself.
        limits: of the spike blocker, those of the improved controller by default.

    Raises:
        ValueError: time goes back within a run.
    """
    made = [material(s, limits) for s in runs]
    phi, change, count = np.zeros(GAMMA.size), np.inf, 0
    while count < MOST and change >= CHANGE:
        before = phi
        for m in made:
            phi = one_pass(phi, m)
        change = float(np.linalg.norm(phi - before) / max(np.linalg.norm(phi), 1e-12))
        count += 1
    F, y = np.concatenate([m.F for m in made]), np.concatenate([m.y for m in made])
    least, ridge = np.zeros(phi.size), np.zeros(phi.size)
    condition, own = np.zeros(3), np.zeros(phi.size)
    for axis, indices in enumerate(SURGE.pattern):
        columns = list(indices)
        A = F[:, axis, columns]
        least[columns] = np.linalg.lstsq(A, y[:, axis], rcond=None)[0]
        ridge[columns] = by_ridge(A, y[:, axis])
        condition[axis], own[columns] = separability(A)
    passed = [float(np.mean(m.dt > 0.0)) for m in made]
    return Identified(phi, count, change, least, ridge, condition, own, passed)


def penalised(A: np.ndarray, y: np.ndarray, penalty: float) -> np.ndarray:
    """argmin |y - A b|^2 + penalty n |s b|^2 with s the root mean squares of the columns."""
    s = np.sqrt(np.mean(A * A, axis=0)) + 1e-300
    B = A / s
    return np.linalg.solve(B.T @ B + penalty * len(B) * np.eye(s.size), B.T @ y) / s


def by_ridge(A: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Ridge regression; the penalty has the least squared error of sequential blocks left out."""
    losses = np.zeros(RIDGE.size)
    for rows in sequential(len(y)):
        rest = np.delete(A, rows, axis=0), np.delete(y, rows)
        losses += [np.sum((y[rows] - A[rows] @ penalised(*rest, x)) ** 2) for x in RIDGE]
    return penalised(A, y, float(RIDGE[losses.argmin()]))


def separability(A: np.ndarray) -> tuple[float, np.ndarray]:
    """Condition number of the columns of unit norm, and the share of each that is its own."""
    norms = np.linalg.norm(A, axis=0)
    if not (norms > 0.0).all():
        return np.inf, np.zeros(norms.size)
    B = A / norms
    shares = []
    for k in range(norms.size):
        rest = np.delete(B, k, axis=1)
        left = B[:, k] - rest @ np.linalg.lstsq(rest, B[:, k], rcond=None)[0]
        shares.append(float(np.linalg.norm(left)))
    return float(np.linalg.cond(B)), np.array(shares)


def explained(runs: Sequence[Samples], phi: np.ndarray) -> np.ndarray:
    """R2 (3,) of omega about its mean, of a model (14,) on runs."""
    left, total = np.zeros(3), np.zeros(3)
    for s in map(thinned, runs):
        left += np.sum((s.omega - regressors(s) @ phi) ** 2, axis=0)
        total += np.sum((s.omega - s.omega.mean(axis=0)) ** 2, axis=0)
    return 1.0 - left / total
