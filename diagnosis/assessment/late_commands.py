"""Commands that are logged late: the motion follows them before they are there, as no ship does.

On each axis the inertial force of a motion is regressed on the forces of the thrusters and on all else
that may act on a hull, as in :mod:`.gains`, with the commands of one column, or of all, taken earlier by
a time. Residuals r over K windows, s their standard deviation by noise, of which n are independent, have
the likelihood

    2 log L = -sum_axes n log sum (r^2 + s^2).

A column is late if that is far likelier than commands as they are, later, or of actuators with smaller
lags and faster rates than in the ship's file, and if the blocks of the run agree (Student's test). The
factor of the force must be one to MEASURED, or nearer to one than as it is logged. A controller commands
what its ship has just done, so that disturbances look like commands to come, with another factor. Of one
column and all of them the first is reported, unless all are far likelier.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from itertools import compress
from typing import NamedTuple

import numpy as np

from ..predictors import Model, WeakWindows, omega, weak_windows
from ..predictors.uncertainty import MEASURED, correlated_windows, omega_std
from ..predictors.weak_form import OVERLAP, inertial, needed_force
from ..runs import Run
from ..runs.cleaning import BRIEF
from ..runs.columns.columns import TAU
from ..runs.held_signal import Integral
from ..runs.paired_test import surely_positive
from ..runs.run_constants import CHANCE, PARTS
from ..runs.smoothing.command_regression import least_squares
from ..runs.smoothing.lateness import LONGEST
from ..runs.smoothing.smoother import without_commands
from .gains import other_forces
from .settings import SETTINGS


class Late(NamedTuple):
    """Signals whose commands are logged late, by how much [s], and the logarithm of the odds."""

    signals: Sequence[str]
    seconds: float
    log_odds: float


class _Score(NamedTuple):
    """How well a force of the thrusters explains the inertial force.

    Attributes:
        total: logarithm of the likelihood.
        size: (3,), of the residual.
        squares: (blocks, 3), of the residual.
        factor: (3,), by which the force acts.
    """

    total: float
    size: np.ndarray
    squares: np.ndarray
    factor: np.ndarray


def earlier(run: Run, columns: Sequence[int], seconds: float) -> Run:
    """A run with some columns of its commands earlier by a time [s]; the last one is held."""
    given = run.given
    steps = np.diff(run.time)
    edges = np.append(run.time, run.time[-1] + np.median(steps))
    moved = given.copy()
    whole = Integral(edges, given[:, columns], given[0, columns])(edges + seconds)
    moved[:, columns] = np.diff(whole, axis=0) / np.diff(edges)[:, None]
    return run.with_given(moved)


class Timing:
    """The likelihood of times by which columns of a run's commands are earlier than they are logged.

    Args:
        w: windows of the run; of a long one its excerpt counts.
        model: of its ship.
    """

    def __init__(self, w: WeakWindows, model: Model) -> None:
        w = w.excerpt
        self._noise = np.sum(omega_std(w, model) ** 2, axis=0)
        self.w, self.model = w.thinned, model
        self._a, self._needed = inertial(w, model), needed_force(w, model)
        self._others = other_forces(w, self._a, self._needed)
        self._block = np.unique(w.block, return_inverse=True)[1]

    def force(self, columns: Sequence[int], seconds: float, model: Model | None = None) -> np.ndarray:
        """(K, 3), force of the thrusters, of another model if one is given, with columns earlier."""
        run = self.w.run
        w = self.w.commanded_as(earlier(run, columns, seconds) if seconds else run)
        return np.nan_to_num(self._needed - omega(w, model or self.model))

    @property
    def unknowns(self) -> int:
        """Factors that are fitted on an axis, at the most."""
        return self._a.shape[1] + max(x.shape[1] for x in self._others)

    @cached_property
    def as_logged(self) -> np.ndarray:
        """(K, 3), force of the thrusters by the commands as they are logged."""
        return self.force((), 0.0)

    def _regressed(self, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(K, 3), what a force of the thrusters leaves of the inertial force, and its factor (3,)."""
        left, factor = np.zeros_like(self._a), np.zeros(3)
        for j, others in enumerate(self._others):
            x = np.column_stack([force, others])
            fitted = least_squares(x, self._a[:, j])
            left[:, j], factor[j] = self._a[:, j] - x @ fitted, fitted[j]
        return left, factor

    @cached_property
    def independent(self) -> np.ndarray:
        """(3,), independent windows by the residual of the commands as they are logged."""
        left, _ = self._regressed(self.as_logged)
        return len(left) / np.maximum(OVERLAP, correlated_windows([self.w], left))

    def score(self, force: np.ndarray) -> _Score:
        """The likelihood of a force of the thrusters."""
        left, factor = self._regressed(force)
        left = left**2
        size = left.sum(axis=0) + self._noise
        squares = np.stack([np.bincount(self._block, each) for each in left.T], axis=1)
        return _Score(-0.5 * float(self.independent @ np.log(size)), size, squares, factor)

    def likeliest(self, columns: Sequence[int], times: np.ndarray) -> tuple[float, _Score]:
        """The likeliest of some times [s] for columns."""
        scores = [(float(t), self.score(self.force(columns, float(t)))) for t in times]
        return max(scores, key=lambda each: each[1].total)

    def rivals(self, columns: Sequence[int], times: np.ndarray) -> Iterator[_Score]:
        """Commands as they are, later by some times [s], or of actuators that follow faster."""
        yield self.score(self.as_logged)
        yield self.likeliest(columns, -times)[1]
        lags, rates = self.model.lags, self.model.rates
        for share in np.arange(1, PARTS + 1) / PARTS if lags or rates else ():
            # At a rate of zero there is no limit.
            more = share / (1.0 - share) if share < 1.0 else -1.0
            sooner = {n: -share * lag for n, lag in lags.items()}
            quicker = {n: more * rate for n, rate in rates.items()}
            yield self.score(self.force((), 0.0, self.model.plus(sooner | quicker)))


def slower(w: WeakWindows, model: Model) -> list[Model]:
    """A model with slower actuators, for each lag that is as likely as any by a run's motion."""
    # Smoothed beside commands that act as described, the motion would follow these.
    s, lags = w.smoothed, model.lags or {"lag": 0.0}
    eta, eta_dot, eta_ddot, nu = without_commands(s)
    alone = replace(s, eta=eta, eta_dot=eta_dot, eta_ddot=eta_ddot, nu=nu)
    timing = Timing(weak_windows(alone), model)
    times = BRIEF * w.scale.time * np.arange(2, 2 * round(LONGEST / BRIEF) + 1, 2)
    models = [model, *(model.plus(dict.fromkeys(lags, float(time))) for time in times)]
    scores = np.array([timing.score(timing.force((), 0.0, each)).total for each in models])
    likely = scores[1:] > np.nanmax(scores) + np.log(CHANCE)
    return [*compress(models[1:], likely)]


def late_commands(w: WeakWindows, model: Model) -> Late | None:
    """The commands of a run that are logged late; None: none surely is, or the run does not show it."""
    run, scale = w.run, w.scale
    given = run.given
    names = TAU if run.commands is None else run.signals
    varied = [k for k in range(len(names)) if np.ptp(given[:, k]) > 0.0]
    times = BRIEF * scale.time * np.arange(1, round(LONGEST / BRIEF) + 1)
    with np.errstate(all="ignore"):  # in a wrong unit forces may be beyond all numbers
        timing = Timing(w, model)
        if not varied or len(timing.w.middle) < OVERLAP * timing.unknowns:
            return None
        groups = [[k] for k in varied] + ([varied] if len(varied) > 1 else [])
        found = [(*timing.likeliest(columns, times), columns) for columns in groups]
        as_given = max(timing.rivals(varied, times), key=lambda score: score.total)
    asked, tries = -np.log(CHANCE), len(groups) * len(times)
    highest = max(score.total for _, score, _ in found)
    seconds, best, columns = next(f for f in found if f[1].total > highest - asked)
    odds = best.total - as_given.total - np.log(tries)
    fall = (as_given.squares - best.squares) @ (timing.independent / best.size)
    if not (odds > asked and surely_positive(fall, CHANCE / tries)):
        return None
    axis = int(np.argmax(timing.independent * np.log(as_given.size / best.size)))
    off = abs(timing.score(timing.as_logged).factor[axis] - 1.0)
    if abs(best.factor[axis] - 1.0) > max(MEASURED, min(off, SETTINGS.much)):
        return None
    return Late([names[k] for k in columns], seconds, float(odds))
