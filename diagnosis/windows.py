"""How far a model goes wrong within eight seconds: the window prediction error.

A run is cut into consecutive windows, what is left over is dropped. In each the model starts from where
the smoother says the ship was, with the thrusters' history from the commands before, and is held against
every raw sample that is no spike. Longer predictions say nothing: the nominal hull is unstable.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cosim import InputError
from fmus.ops import wrap

from .prediction import LONGEST_STEP, Starts, Values, predict
from .smoothing import Smoothed

LENGTH = 8.0  # s


@dataclass(frozen=True, eq=False)
class WindowErrors:
    """Root mean square errors of prediction; inf where the model runs away.

    Attributes:
        run: (w,), number of each window's run.
        start: (w,), when it starts [s].
        samples: (w,), how many samples it was held against.
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
        squares = (np.square(e[..., chosen]) @ n for e in (self.position, self.heading))
        with np.errstate(invalid="ignore"):
            position, heading = (np.sqrt(s / np.sum(n)) for s in squares)
        return position, heading


class Windows:
    """The windows of some runs, to hold models against.

    Args:
        runs: smoothed runs.

    Attributes:
        run, start: (w,), number of each window's run, and when it starts [s].
        sample_window: (samples,), the window of each sample that counts.
        measured: (samples, 3), the raw pose [m, m, rad].
        since: (samples,), time since its window began [s].

    Raises:
        InputError: no run has a window with enough samples.
    """

    def __init__(self, runs: Sequence[Smoothed]) -> None:
        cuts = [cut(smoothed) for smoothed in runs]
        counts = [c.heads.size for c in cuts]
        if not sum(counts):
            raise InputError(f"no window of {LENGTH:g} s has enough samples")
        before = np.cumsum([0, *counts[:-1]])
        self.run = np.repeat(np.arange(len(cuts)), counts)
        self.start = np.concatenate([c.time[c.heads] for c in cuts])
        self.sample_window = np.concatenate([c.window + a for c, a in zip(cuts, before, strict=True)])
        self.measured = np.concatenate([c.smoothed.track.pose[c.rows] for c in cuts])
        self.since = np.concatenate([c.time[c.rows] for c in cuts]) - self.start[self.sample_window]
        self._groups: list[tuple[Starts, np.ndarray]] = []
        for h, five in sorted({c.kind for c in cuts if c.heads.size}):
            alike = [k for k, c in enumerate(cuts) if c.kind == (h, five)]
            starts = tuple((cuts[k].smoothed, cuts[k].heads) for k in alike)
            together = Starts(starts, h, int(np.ceil(LENGTH / h - 1e-6)), five)
            self._groups.append((together, np.flatnonzero(np.isin(self.run, alike))))

    def residuals(
        self, vessel: Values | None = None, thrusters: Values | None = None, clock: float = 0.0
    ) -> np.ndarray:
        """Measured minus predicted pose at each sample that counts.

        Args:
            vessel, thrusters: name -> value of the parameters that are not nominal; an array (p, 1)
                tries p models at once.
            clock: seconds by which a pose is older than its stamp.

        Returns:
            (samples, 3) [m, m, rad], heading wrapped; (p, samples, 3) for p models.

        Raises:
            InputError: an unknown name.
        """
        ship, machine = dict(vessel or {}), dict(thrusters or {})
        shapes = [np.shape(v)[:1] for v in (*ship.values(), *machine.values())]
        models = np.broadcast_shapes(*shapes)
        off = np.empty((*(models or (1,)), *self.measured.shape))
        for starts, windows in self._groups:
            place = np.full(self.run.size, -1)
            place[windows] = np.arange(windows.size)
            mine = place[self.sample_window] >= 0
            column = place[self.sample_window[mine]]
            steps = predict(starts, ship, machine, clock)
            pose = between_steps(steps, column, self.since[mine] / starts.h)
            off[:, mine] = self.measured[mine] - pose
        off[..., 2] = wrap(off[..., 2])
        return off if models else off[0]

    def errors(
        self, vessel: Values | None = None, thrusters: Values | None = None, clock: float = 0.0
    ) -> WindowErrors:
        """The window prediction error of a model, arguments as of :meth:`residuals`."""
        return self.summary(self.residuals(vessel, thrusters, clock))

    def summary(self, off: np.ndarray) -> WindowErrors:
        """Errors by window of what :meth:`residuals` gives."""
        samples = np.bincount(self.sample_window, minlength=self.run.size)
        edges = np.cumsum([0, *samples[:-1]])  # samples lie window by window
        with np.errstate(over="ignore", invalid="ignore"):
            squares = np.add.reduceat(np.nan_to_num(off**2, nan=np.inf), edges, axis=-2)
            mean = squares / samples[:, None]
            position, heading = np.sqrt(mean[..., 0] + mean[..., 1]), np.sqrt(mean[..., 2])
        return WindowErrors(self.run, self.start, samples, position, heading)


class Cut(NamedTuple):
    """The windows of one run that can be used: first rows, and row and window of each sample."""

    smoothed: Smoothed
    heads: np.ndarray
    rows: np.ndarray
    window: np.ndarray

    @property
    def time(self) -> np.ndarray:
        return self.smoothed.time

    @property
    def kind(self) -> tuple[float, bool]:
        """Step of integration [s], a whole part of that between rows; whether commands are five."""
        row = round(float(np.median(np.diff(self.time))), 9)
        parts = int(np.ceil(row / LONGEST_STEP - 1e-6))
        return row / parts, self.smoothed.track.run.five is not None


def cut(smoothed: Smoothed) -> Cut:
    """The windows of a run that can be used."""
    track, used, period = smoothed.track, smoothed.used, smoothed.track.period
    since = smoothed.time - smoothed.time[0] + 0.25 * period
    number = np.floor(since / LENGTH).astype(int)
    whole = int((since[-1] + period) // LENGTH)
    measured = np.flatnonzero(~track.between & (number < whole))
    _, at = np.unique(number[measured], return_index=True)
    heads = measured[at]  # the first sample of each window that has any
    prompt = since[heads] - LENGTH * number[heads] < period
    chosen, samples = np.unique(number[used], return_counts=True)
    full = chosen[samples >= 0.5 * round(LENGTH / period)]
    heads = heads[prompt & used[heads] & np.isin(number[heads], full)]
    rows = np.flatnonzero(used & np.isin(number, number[heads]))
    return Cut(smoothed, heads, rows, np.searchsorted(number[heads], number[rows]))


def between_steps(predicted: np.ndarray, column: np.ndarray, place: np.ndarray) -> np.ndarray:
    """(p, samples, 3): a prediction (steps + 1, 3, p, w) at the samples, straight between steps.

    Args:
        predicted: pose [m, m, rad] at each step.
        column: (samples,), the window of each sample.
        place: (samples,), how many steps after the window's start it lies.
    """
    step = np.clip(np.floor(place + 1e-6).astype(int), 0, len(predicted) - 2)
    low, high = (predicted[k, :, :, column] for k in (step, step + 1))
    with np.errstate(invalid="ignore", over="ignore"):
        ahead = high - low
        ahead[:, 2] = wrap(ahead[:, 2])  # the measured heading is wrapped
        return (low + (place - step)[:, None, None] * ahead).transpose(2, 0, 1)
