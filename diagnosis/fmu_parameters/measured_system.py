"""Measured runs of any system, and the predictions that are asked of its FMU along them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from cosim.fmu import FmuModel
from cybership.message_text import quoted

from ..predictors.fmu.fmu_playback import PlaybackRequest
from ..runs.columns.columns import Layout, stated_layout
from ..runs.files.reading import LOGS
from ..runs.files.tables import MeasuredTable, as_table, numbers
from ..runs.sensors.evidence import FEWEST
from .system_map import TIME, SystemMap, column_of_start

MOST_STEPS = 20  # 1, between two samples; chosen, an FMU that wants more of them takes them itself
LEAST_SHARE = 1e-5  # 1, of an output's spread: noise below that is rounding; chosen
# 1, by which the standard deviation of a start value is larger than that of its parabola, which also
# bends otherwise than the signal, by as much as the noise hides; chosen.
UNSURE = 3.0
WIDTHS = (5, 7, 11, 15, 21, 31, 45, 65)  # 1, samples of a parabola through the start of a window


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """One measured run.

    Attributes:
        name: of the run.
        time: (n,) [s], rising.
        columns: name -> values (n,); NaN where there is none.
    """

    name: str
    time: np.ndarray
    columns: Mapping[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Window:
    """A stretch of a run that is predicted as a whole.

    Attributes:
        run: name of the run.
        begin: [s].
        course: what the FMU gets.
        time: (T,), since the beginning, of the samples that count [s].
        measured: (T, m), in the units of the FMU's outputs; NaN where there is no sample.
        start_std: start variable -> standard deviation of its value.
        onto: pose (3,) onto which a predicted track is laid where the first sample counts; None: it is
            not.
    """

    run: str
    begin: float
    course: PlaybackRequest
    time: np.ndarray
    measured: np.ndarray
    start_std: Mapping[str, float]
    onto: np.ndarray | None = None


def read_runs(paths: Sequence[Path], wanted: Sequence[str]) -> list[MeasuredRun]:
    """Runs from tables, or from the folders of logs.

    Args:
        paths: of the runs.
        wanted: columns that each must have.

    Raises:
        InputError: a file cannot be read, or lacks a column.
    """
    runs = [_read(path, wanted) for path in paths]
    names = [r.name for r in runs]
    return [
        r if names.count(r.name) == 1 else MeasuredRun(str(p), r.time, r.columns)
        for r, p in zip(runs, paths, strict=True)
    ]


def columns_of(path: Path) -> list[str]:
    """The names of a run's columns.

    Raises:
        InputError: the file cannot be read.
    """
    with as_table(path):
        return _table(path).names


def _table(path: Path) -> MeasuredTable:
    file = next((path / n for n in LOGS if (path / n).is_file()), path) if path.is_dir() else path
    return MeasuredTable(file, stated_layout(file) or Layout())


def _read(path: Path, wanted: Sequence[str]) -> MeasuredRun:
    table, there = _table(path), columns_of(path)
    names = [TIME, *wanted]
    for name in names:
        if name not in there:
            raise InputError(f"'{path}' has no column {quoted(name)}{nearest(name, there)}")
    with as_table(path):
        frame = table.columns(names)
    columns = {name: numbers(frame[name], table.path, table.layout) for name in names}
    time = columns.pop(TIME)
    if time.size < FEWEST or not (np.isfinite(time).all() and (np.diff(time) > 0.0).all()):
        raise InputError(f"'{path}': time needs at least {FEWEST} increasing numbers")
    return MeasuredRun(path.stem if path.is_file() else path.name, time, columns)


def noise_of(values: np.ndarray) -> float:
    """Standard deviation of white noise on a smooth signal (n,), by its differences.

    Of white noise those of an order have the variance of the sum of the squared binomial coefficients.
    Signals that a few samples resolve are in those of second order, steps widen those of fourth order:
    the smaller estimate is taken. The median is not moved by a few steps of the signal.
    """
    known = values[np.isfinite(values)]
    return min(_noise_by_differences(known, order) for order in (2, 4))


def _noise_by_differences(values: np.ndarray, order: int) -> float:
    off = np.abs(np.diff(values, order))
    if not off.size:
        return 0.0
    gain = float(np.sqrt(comb(2 * order, order)))
    if np.mean(off == 0.0) > 0.5:  # of a coarse channel the median is zero
        return float(np.sqrt(np.mean(off**2))) / gain
    # Of a normal distribution the median of the absolute value is 0.6745 standard deviations.
    return float(np.median(off)) / 0.6745 / gain


def noises(runs: Sequence[MeasuredRun], given: SystemMap) -> np.ndarray:
    """(m,), noise of each output in the unit of its variable.

    Raises:
        InputError: a column has no samples.
    """
    found = []
    for column, c in given.outputs.items():
        every = np.concatenate([r.columns[column] for r in runs])
        if not np.isfinite(every).any():
            raise InputError(f"column {quoted(column)} has no samples in '{runs[0].name}'")
        noise = c.noise or max(
            float(np.median([noise_of(r.columns[column]) for r in runs])),
            LEAST_SHARE * float(np.nanstd(every)),
            float(np.finfo(float).tiny ** 0.5),
        )
        found.append(abs(c.factor) * noise)
    return np.array(found)


def windows_of(
    run: MeasuredRun, given: SystemMap, model: FmuModel, noise: np.ndarray, length: float | None
) -> list[Window]:
    """The windows of a run.

    Args:
        run: the run.
        given: the map.
        model: the FMU.
        noise: (m,), of the outputs in the units of their variables.
        length: of the windows [s]; None: the whole run is one.

    Raises:
        InputError: the run is too short.
    """
    whole = float(run.time[-1] - run.time[0])
    length = min(length or whole, whole)
    count = max(1, int(whole / length + 1e-9))
    found = []
    for k in range(count):
        begin = run.time[0] + k * length
        rows = np.flatnonzero((run.time >= begin - 1e-9) & (run.time <= begin + length + 1e-9))
        if rows.size >= FEWEST:
            found.append(_window(run, given, model, noise, rows))
    if not found:
        raise InputError(f"run '{run.name}' has no window with {FEWEST} samples")
    return found


def step_of(model: FmuModel, period: float) -> float:
    """Length of a step [s], for samples that are a period apart [s]."""
    own, stated = model.suggested_step or period, model.description.coSimulation
    if stated is not None and not stated.canHandleVariableCommunicationStepSize:
        return own * max(1.0, round(period / own))
    return period / min(MOST_STEPS, max(1, int(np.ceil(period / own - 1e-6))))


def _window(
    run: MeasuredRun, given: SystemMap, model: FmuModel, noise: np.ndarray, rows: np.ndarray
) -> Window:
    t = run.time[rows] - run.time[rows[0]]
    h = step_of(model, float(np.median(np.diff(t))))
    steps = int(np.ceil(t[-1] / h - 1e-6))
    middle = run.time[rows[0]] + (np.arange(steps) + 0.5) * h
    inputs = np.zeros((steps, len(given.inputs)))
    for k, (column, c) in enumerate(given.inputs.items()):
        values = run.columns[column]
        known = np.flatnonzero(np.isfinite(values))
        if not known.size:
            raise InputError(f"column {quoted(column)} has no samples in '{run.name}'")
        if c.linear:
            x = np.interp(middle, run.time[known], values[known])
        else:
            row = np.searchsorted(run.time[known], middle, side="right") - 1
            x = values[known[np.maximum(row, 0)]]
        inputs[:, k] = c.factor * x + c.offset
    names = [*given.outputs]
    measured = np.column_stack(
        [c.factor * run.columns[n][rows] + c.offset for n, c in given.outputs.items()]
    )
    start, std = {}, {}
    for key, c in given.start.items():
        column, rate = column_of_start(key)
        place = names.index(column)
        value, sure = _at_start(t, measured[:, place], noise[place], rate)
        # The start value is in the unit of its own line, the output in that of the output's.
        o = given.outputs[column]
        plain = (value - (0.0 if rate else o.offset)) / o.factor
        start[c.name] = c.factor * plain + (0.0 if rate else c.offset)
        std[c.name] = UNSURE * abs(c.factor / o.factor) * sure
    counts = t >= given.run_in - 1e-9
    if counts.sum() < FEWEST:
        raise InputError(f"run '{run.name}' has fewer than {FEWEST} samples after its run_in")
    begin = float(run.time[rows[0]])
    return Window(run.name, begin, PlaybackRequest(h, start, inputs), t[counts], measured[counts], std)


def _at_start(t: np.ndarray, y: np.ndarray, noise: float, rate: bool) -> tuple[float, float]:
    """A signal, or its derivative, at its first time, and the standard deviation of that.

    By a parabola through the first samples: the widest whose value lies in the intervals of all narrower
    ones (O. V. Lepski, 1991, Theory of Probability and its Applications 35, 454-466).
    """
    known = np.isfinite(y)
    t, y = t[known], y[known]
    low, high, chosen = -np.inf, np.inf, (0.0, np.inf)
    for width in WIDTHS:
        if width > y.size:
            break
        X = np.vander(t[:width] - t[0], 3, increasing=True)
        c = np.linalg.lstsq(X, y[:width], rcond=None)[0]
        value = float(c[int(rate)])
        std = float(noise * np.sqrt(np.linalg.inv(X.T @ X)[int(rate), int(rate)]))
        if not low <= value <= high:
            break
        chosen = value, std
        low, high = max(low, value - 2.0 * std), min(high, value + 2.0 * std)
    return chosen
