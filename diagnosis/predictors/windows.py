"""Window prediction error: how far a model departs from the measurement within some seconds.

A run is cut into consecutive windows, the remainder is dropped. In each the model starts from the
smoothed state, with the thrusters' history from the commands before, and is compared with every raw
sample that is no spike. Longer predictions say nothing: the nominal hull is unstable.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from cosim import InputError
from fmus.ops import wrap

from ..execution.short_text import ShortRepr
from ..runs import Smoothed
from ..runs.cleaning import BRIEF
from .prediction import WindowStarts, at_constant_velocities, by_measurement, predict, predict_each
from .ship_model import Model
from .thrust import LONGEST_STEP
from .uncertainty import NOISE_TOLERANCE
from .weak_form import BLOCK, BLOCKS, HORIZON, WeakWindows

# Of a run that is predicted as a whole, times the scale of the ship.
LONGEST_FREE = BLOCKS * BLOCK  # as long as blocks of the weak form do not grow; takes some seconds
ANY_TIME = (-np.inf, np.inf)  # s
# m, times the scale of the ship, and rad; where predictions begin a velocity is known if its standard
# deviation displaces the ship by no more over a window. Chosen: a tenth of its length.
DISPLACED = 0.1


@dataclass(frozen=True, eq=False, repr=False)
class WindowErrors(ShortRepr):
    """Root mean square errors of prediction in each window; inf where the model diverges.

    Attributes:
        run: (w,), number of each window's run.
        start: (w,), when it starts [s].
        samples: (w,), number of samples that it was compared with.
        position: (..., w) [m], over north and east together.
        heading: (..., w) [rad].
    """

    run: np.ndarray
    start: np.ndarray
    samples: np.ndarray
    position: np.ndarray
    heading: np.ndarray

    def over_all(self, run: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Position [m] and heading [rad], over all samples of one run or of all; NaN without any.

        Returns:
            Two arrays without the last axis of ``position``.
        """
        chosen = np.ones(self.run.size, bool) if run is None else self.run == run
        n = self.samples[chosen]
        with np.errstate(invalid="ignore"):
            squares = (np.square(e[..., chosen]) @ n / np.sum(n) for e in (self.position, self.heading))
            position, heading = map(np.sqrt, squares)
        return position, heading


class Windows:
    """The windows of some runs, in which models are compared with the measurement.

    Args:
        runs: of one ship, from :func:`diagnosis.load` or :func:`diagnosis.smooth`.
        length: of the windows [s]; by default that of the ship.
        spans: for each run first and last time [s] at which a window may begin; by default any.

    Attributes:
        runs: the smoothed runs.
        length: of the windows [s].
        run, start: (w,), number of each window's run, and when it starts [s].
        sample_window: (samples,), the window of each sample that is used.
        measured: (samples, 3), the raw pose [m, m, rad].
        since: (samples,), time since its window began [s].

    Raises:
        InputError: no run has a window with enough samples.
    """

    def __init__(
        self,
        runs: Sequence[Smoothed | WeakWindows],
        length: float | None = None,
        spans: Sequence[tuple[float, float]] | None = None,
    ) -> None:
        runs = [r.smoothed if isinstance(r, WeakWindows) else r for r in runs]
        self.runs = tuple(runs)
        self.length = length or HORIZON * runs[0].scale.time
        spans = spans or [ANY_TIME] * len(runs)
        parts = [usable_windows(s, self.length, span) for s, span in zip(runs, spans, strict=True)]
        counts = [p.first_rows.size for p in parts]
        if not sum(counts):
            raise InputError(f"no window of {self.length:.3g} s has enough samples")
        before = np.cumsum([0, *counts[:-1]])
        self.run = np.repeat(np.arange(len(parts)), counts)
        self.start = np.concatenate([p.smoothed.time[p.first_rows] for p in parts])
        self.sample_window = np.concatenate([p.window + a for p, a in zip(parts, before, strict=True)])
        self.measured = np.concatenate([p.smoothed.track.pose[p.rows] for p in parts])
        time = np.concatenate([p.smoothed.time[p.rows] for p in parts])
        self.since = time - self.start[self.sample_window]
        self._groups: list[tuple[WindowStarts, np.ndarray]] = []
        kinds = [(step_of(s), s.track.run.signals) for s in runs]
        for kind in sorted({kinds[k] for k in np.unique(self.run)}):
            members = [k for k in np.unique(self.run).tolist() if kinds[k] == kind]
            starts = tuple((runs[k], parts[k].first_rows) for k in members)
            group = WindowStarts(starts, kind[0], int(np.ceil(self.length / kind[0] - 1e-6)))
            self._groups.append((group, np.flatnonzero(np.isin(self.run, members))))

    @property
    def groups(self) -> Sequence[tuple[WindowStarts, np.ndarray]]:
        """Windows that are predicted together, and the number of each."""
        return self._groups

    def after(self, seconds: float) -> "Windows":
        """The same windows without the samples of their first seconds.

        Raises:
            InputError: nothing is left of one.
        """
        kept, samples = copy(self), self.since >= seconds
        kept.sample_window, kept.since = self.sample_window[samples], self.since[samples]
        kept.measured = self.measured[samples]
        if np.unique(kept.sample_window).size < self.run.size:
            raise InputError(f"a run-in of {seconds:.3g} s leaves nothing of {self.length:.3g} s")
        return kept

    def finer(self, parts: int) -> "Windows":
        """The same windows, predicted with steps that are divided into so many."""
        kept = copy(self)
        kept._groups = [
            (replace(s, h=s.h / parts, steps=s.steps * parts), windows) for s, windows in self._groups
        ]
        return kept

    def residuals(self, model: Model | None = None) -> np.ndarray:
        """Measured minus predicted pose at each sample that is used.

        Args:
            model: the nominal one by default; a parameter that is an array (p, 1) stands for p models
                at once.

        Returns:
            (samples, 3) [m, m, rad], heading wrapped; (p, samples, 3) for p models.

        Raises:
            InputError: an unknown name.
        """
        model = model or Model()
        shapes = [np.shape(v)[:1] for v in (*model.vessel.values(), *model.thrusters.values())]
        models = np.broadcast_shapes(*shapes)
        found = self.residuals_by(lambda starts: predict(starts, model), *(models or (1,)))
        return found if models else found[0]

    def residuals_by(self, poses: Callable[[WindowStarts], np.ndarray], models: int = 1) -> np.ndarray:
        """Residuals (p, samples, 3) of p models.

        Args:
            poses: gives the predicted pose (steps + 1, 3, p, w) at each step of windows.
            models: p.
        """
        found = np.empty((models, *self.measured.shape))
        for starts, windows in self._groups:
            place = np.full(self.run.size, -1)
            place[windows] = np.arange(windows.size)
            mine = place[self.sample_window] >= 0
            column = place[self.sample_window[mine]]
            pose = between_steps(poses(starts), column, self.since[mine] / starts.h)
            found[:, mine] = self.measured[mine] - pose
        found[..., 2] = wrap(found[..., 2])
        return found

    def residuals_by_run(self, models: Sequence[Model]) -> np.ndarray:
        """Residuals (samples, 3), predicted by a model for each run; these have the same measurement."""
        of = {
            id(starts): [models[k] for k in np.unique(self.run[windows])]
            for starts, windows in self._groups
        }
        return self.residuals_by(lambda starts: predict_each(starts, of[id(starts)]))[0]

    def residuals_of_each(self, models: Sequence[Model]) -> list[np.ndarray]:
        """Residuals (samples, 3) of some models, many predicted at once."""
        found: dict[int, np.ndarray] = {}
        for chosen, together in by_measurement(models):
            each = np.broadcast_to(self.residuals(together), (len(chosen), *self.measured.shape))
            found |= zip(chosen, each, strict=True)
        return [found[k] for k in range(len(models))]

    def errors(self, model: Model | None = None) -> WindowErrors:
        """The window prediction error of a model, argument as of :meth:`residuals`."""
        return self.summary(self.residuals(model))

    def errors_at_constant_velocities(self) -> WindowErrors:
        """The window prediction error of a ship that keeps its velocities."""
        return self.summary(self.residuals_by(at_constant_velocities)[0])

    def summary(self, residuals: np.ndarray) -> WindowErrors:
        """Root mean squares by window of the result (..., samples, 3) of :meth:`residuals`."""
        samples = np.bincount(self.sample_window, minlength=self.run.size)
        edges = np.cumsum([0, *samples[:-1]])  # samples lie window by window
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.add.reduceat(np.nan_to_num(residuals**2, nan=np.inf), edges, axis=-2)
            mean = squares / samples[:, None]
            position, heading = np.sqrt(mean[..., 0] + mean[..., 1]), np.sqrt(mean[..., 2])
        return WindowErrors(self.run, self.start, samples, position, heading)


class RunWindows(NamedTuple):
    """The windows of one run that can be used.

    Attributes:
        smoothed: the run.
        first_rows: (w,), row of each window's first sample.
        rows, window: (samples,), row and window of each sample that is used.
    """

    smoothed: Smoothed
    first_rows: np.ndarray
    rows: np.ndarray
    window: np.ndarray


def step_of(smoothed: Smoothed) -> float:
    """Step of predictions [s], which divides the sample period."""
    row = round(float(np.median(np.diff(smoothed.time))), 9)
    parts = int(np.ceil(row / (LONGEST_STEP * smoothed.scale.time) - 1e-6))
    return row / parts


def usable_windows(
    smoothed: Smoothed, length: float, span: tuple[float, float] = ANY_TIME
) -> RunWindows:
    """The windows of a length [s] of a run that have their first sample and at least half of all.

    They follow each other from the first sample that is used, and at which actuators that lag hardly
    follow commands from before the run any more. If whole windows leave a remainder, the first begins
    within it where the velocity is known: at the beginning of a run the smoothed motion follows few
    samples. Those count that begin in a span [s].
    """
    track, used, period = smoothed.track, smoothed.used, smoothed.track.period
    begin = max(first_time(smoothed), track.responded)
    left = (smoothed.time[-1] + 1.25 * period - begin) % length - 0.25 * period
    begin = min(settled_time(smoothed, begin, length), begin + max(left, 0.0))
    since = smoothed.time - begin + 0.25 * period
    number = np.floor(since / length).astype(int)
    complete = int((since[-1] + period) // length)
    measured = np.flatnonzero(~track.between & (number >= 0) & (number < complete))
    _, at = np.unique(number[measured], return_index=True)
    first = measured[at]  # the first sample of each window that has any
    prompt = since[first] - length * number[first] < period
    started = smoothed.time[first]
    prompt &= (started >= span[0]) & (started <= span[1])
    chosen, samples = np.unique(number[used], return_counts=True)
    full = chosen[2 * samples >= round(length / period)]
    silent = number[track.silences % 2 == 1]  # the commands there are not known
    first = first[prompt & used[first] & np.isin(number[first], full) & ~np.isin(number[first], silent)]
    rows = np.flatnonzero(used & np.isin(number, number[first]))
    return RunWindows(smoothed, first, rows, np.searchsorted(number[first], number[rows]))


def first_time(smoothed: Smoothed) -> float:
    """Time of the first sample that is used, which an outlier is not [s]; else that of the first row."""
    return float(smoothed.time[smoothed.used.argmax()])


def settled_time(smoothed: Smoothed, begin: float, length: float) -> float:
    """Time [s] of the first sample from ``begin`` on whose velocity is known; else that.

    ``length`` is that of the windows [s].
    """
    size = np.array([smoothed.scale.length, smoothed.scale.length, 1.0])
    used = smoothed.used & (smoothed.time >= begin)
    usual = np.median(smoothed.nu_std[smoothed.used], axis=0)
    most = np.maximum(NOISE_TOLERANCE * usual, DISPLACED * size / length)
    rows = np.flatnonzero(used)
    known = (smoothed.nu_std[rows] <= most).all(axis=1)
    return float(smoothed.time[rows[known.argmax()]]) if known.any() else begin


def first_row(smoothed: Smoothed, begin: float) -> int:
    """The row of the last sample that is used up to a time [s], else of the first."""
    usable = np.flatnonzero(smoothed.used)
    before = np.searchsorted(smoothed.time[usable], begin, side="right")
    return int(usable[max(before - 1, 0)])


def free_runs(
    smoothed: Smoothed, models: Sequence[Model], begin: float = -np.inf
) -> tuple[np.ndarray, list[np.ndarray]]:
    """A run as models predict it from one state, by the commands that were given.

    Args:
        smoothed: the run, of which ``LONGEST_FREE`` seconds at the most.
        models: what predicts it.
        begin: the state is that of the last sample before [s], else of the first there is.

    Returns:
        (n,), times at equal distances [s], and for each model (n, 3), pose [m, m, rad]; not finite where
        the model runs away.
    """
    first = first_row(smoothed, begin)
    h = max(step_of(smoothed), BRIEF * smoothed.scale.time)  # the mean of the commands acts
    left = float(smoothed.time[-1] - smoothed.time[first])
    seconds = min(left, LONGEST_FREE * smoothed.scale.time)
    starts = WindowStarts(((smoothed, np.array([first])),), h, int(seconds / h))
    # One after the other takes half the time of all at once; where nothing is learned they are one.
    distinct = {id(m): m.during(smoothed.track.run.name) for m in models}
    found = {k: predict(starts, m)[:, :, 0, 0] for k, m in distinct.items()}
    times = smoothed.time[first] + h * np.arange(starts.steps + 1)
    return times, [found[id(m)] for m in models]


def between_steps(predicted: np.ndarray, column: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Pose (p, samples, 3) of p models at samples, by cubic interpolation between steps.

    Args:
        predicted: (steps + 1, 3, p, w), in w windows at each step.
        column, place: (samples,), the window of each sample, and steps from its start to it.
    """
    first = np.clip(np.floor(place + 1e-6).astype(int) - 1, 0, max(len(predicted) - 4, 0))
    nodes = range(min(4, len(predicted)))
    poses = [predicted[first + k, :, :, column] for k in nodes]
    with np.errstate(invalid="ignore", over="ignore"):
        found = poses[0]
        for k in nodes[1:]:
            rest = (place - first - j for j in nodes if j != k)
            share = np.prod([*rest], axis=0) / np.prod([float(k - j) for j in nodes if j != k])
            change = poses[k] - poses[0]
            change[:, 2] = wrap(change[:, 2])  # the measured heading is wrapped
            found = found + share[:, None, None] * change
        return found.transpose(2, 0, 1)
