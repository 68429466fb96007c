"""Measured runs as an FMU predicts them: by cosim, one instance for each window.

Where its velocity can be set, an FMU starts in each window from the smoothed state, as the models of
this project do. Else it runs through the whole run from its own start; of a ship that is under way when
the run begins, the first part, the run-in, does not count. Where its pose cannot be set, the track that
it gives is laid onto the measured pose where the comparison begins, in place and heading.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

import cosim
from cosim.process import scratch_folder
from fmus.frames import rotate_to_body, rotate_to_earth
from fmus.ops import wrap

from ...runs import UNITS, Column, Run, Smoothed, to_si
from ..evaluation import Evaluation, PredictionError
from ..prediction import at_rest
from ..ship_model import Model
from ..thrust import STEP
from ..weak_form import WeakWindows, omega
from ..windows import Windows, between_steps
from .foreign_fmu import TAU, Fmu, commands_of
from .variable_map import MOTION, POSE, VELOCITY, VariableMap, quantities

# s, times the scale of the ship; after that a surge speed has forgotten most of its start. Chosen.
RUN_IN = 60.0
TOGETHER = 16  # instances in one simulation; chosen: each may have a process of its own


@dataclass(frozen=True, eq=False)
class Use:
    """How an FMU predicts some runs.

    Attributes:
        fmu: the FMU.
        given: which of its variables is which signal, as it was told or proposed.
        map: the same with the units that the FMU declares.
        quantity: of each signal.
    """

    fmu: Fmu
    given: VariableMap
    map: VariableMap
    quantity: dict[str, str]

    @property
    def whole(self) -> bool:
        """Whether runs are predicted as a whole, for a velocity cannot be set."""
        return not set(VELOCITY) <= {*self.map.told("start"), *self.map.fixed}

    @property
    def placed(self) -> bool:
        """Whether predictions are laid onto the measured pose, for that cannot be set."""
        return not set(POSE) <= self.map.told("outputs").keys() & self.map.told("start").keys()

    def run_in(self, smoothed: Smoothed) -> float:
        """The first part of a run that does not count [s]."""
        if not self.whole or (self.map.run_in is None and at_rest(smoothed)):
            return 0.0
        return RUN_IN * smoothed.scale.time if self.map.run_in is None else self.map.run_in

    def in_variable(self, signal: str, column: Column, values: Any) -> Any:
        """Values of a signal in SI as its variable has them."""
        factor = -column.factor if column.flip else column.factor
        unit = UNITS[self.quantity[signal]].get(column.unit or "", 1.0)
        return (values / unit - column.offset) / factor

    def in_si(self, signal: str, values: Any) -> Any:
        """Values of an output's variable as the signal in SI."""
        return to_si(values, signal, self.map.told("outputs")[signal], self.quantity[signal])

    def told(self, smoothed: Sequence[Smoothed]) -> Iterator[str]:
        """How it predicts, a sentence each."""
        start = ", ".join(c.name for c in self.map.told("start").values())
        if self.whole:
            waits = [self.run_in(s) for s in smoothed]
            began = "from rest" if not any(waits) else f"after a run-in of {max(waits):.3g} s"
            yield (
                f"Its velocity cannot be set ({', '.join(VELOCITY)} of the map's start): runs are "
                f"predicted as a whole, {began}. The force that it lacks is that along its prediction."
            )
        else:
            yield f"Each window starts from the measured state, by {start}."
        if self.placed:
            yield "Its pose is laid onto the measured one where a prediction begins."


def use_of(fmu: Fmu, runs: Sequence[Run]) -> Use:
    """How an FMU predicts some runs.

    Raises:
        InputError: as :meth:`Fmu.variables`.
    """
    known = quantities(commands_of(runs))
    return Use(fmu, fmu.given(runs), fmu.variables(runs), {**known["outputs"], **known["inputs"]})


def evaluate_fmu(w: WeakWindows, use: Use, model: Model) -> Evaluation:
    """Hold an FMU against a run.

    Args:
        w: windows of the run.
        use: how the FMU predicts it.
        model: that moves as the FMU does, from :func:`.inverse.as_model`.

    Raises:
        InputError: the FMU fails, or the run is too short for its run-in.
    """
    windows, lacking = predicted_windows(w, use), omega(w, model)
    if windows is None:
        error = PredictionError(lacking, np.zeros((0, 3)), None)
    else:
        residuals = window_residuals(w.smoothed, use, windows)
        error = PredictionError(lacking, residuals, windows.summary(residuals))
    return Evaluation(
        model, w, windows, False, error, error, foreign=lambda begin: free_run(w.smoothed, use, begin)
    )


def by_fmu(evaluations: Sequence[Evaluation], use: Use) -> list[Evaluation]:
    """Evaluations of a model that moves as an FMU does, with the FMU's own predictions before.

    After that what was learned changes them by as much as it changes those of the model. Those of an FMU
    whose velocity cannot be set are left as they are, as it has none in windows.
    """
    found = []
    for e in evaluations:
        if e.windows is not None and not use.whole:
            own = window_residuals(e.smoothed, use, e.windows)
            learned = own + e.after.residuals - e.before.residuals
            learned[:, 2] = wrap(learned[:, 2])
            before = replace(e.before, residuals=own, errors=e.windows.summary(own))
            after = replace(e.after, residuals=learned, errors=e.windows.summary(learned))
            e = replace(e, before=before, after=before if e.after is e.before else after)
        found.append(e)
    return found


def window_residuals(smoothed: Smoothed, use: Use, windows: Windows, parts: int = 1) -> np.ndarray:
    """Measured minus predicted pose (samples, 3) [m, m, rad], heading wrapped; steps in parts."""
    begins = np.searchsorted(smoothed.time, windows.start)
    h = step_of(smoothed) / parts
    groups = [begins[k : k + TOGETHER] for k in range(0, begins.size, TOGETHER)]
    steps = int(np.ceil(windows.length / h - 1e-6))
    pose = np.concatenate([_poses(smoothed, use, group, h, steps) for group in groups], axis=-1)
    if use.placed:
        first = round(use.run_in(smoothed) / h)
        rows = np.searchsorted(smoothed.time, windows.start + first * h - 1e-9)
        pose = _laid(pose, first, smoothed.eta[rows].T)
    predicted = between_steps(pose[:, :, None], windows.sample_window, windows.since / h)[0]
    residuals = windows.measured - predicted
    residuals[:, 2] = wrap(residuals[:, 2])
    return residuals


def free_run(smoothed: Smoothed, use: Use, begin: float) -> tuple[np.ndarray, np.ndarray]:
    """A run as an FMU predicts it from one state; or, where that cannot be set, from its own start.

    Args:
        smoothed: the run.
        use: how the FMU predicts it.
        begin: the state is that of the last sample before [s], else of the first there is.

    Returns:
        (n,), times at equal distances [s], and (n, 3), pose [m, m, rad].
    """
    usable = np.flatnonzero(smoothed.used)
    row = int(usable[max(np.searchsorted(smoothed.time[usable], begin, side="right") - 1, 0)])
    start = 0 if use.whole else row
    h = step_of(smoothed)
    steps = int((smoothed.time[-1] - smoothed.time[start]) / h)
    pose = _poses(smoothed, use, np.array([start]), h, steps)
    first = round((smoothed.time[row] - smoothed.time[start]) / h)
    if use.placed:
        pose = _laid(pose, first, smoothed.eta[row][:, None])
    return smoothed.time[start] + h * np.arange(first, steps + 1), pose[first:, :, 0]


def whole_run(smoothed: Smoothed, use: Use) -> tuple[np.ndarray, np.ndarray]:
    """Pose and velocity, each (n, 3) in SI, of an FMU along a run from its own start."""
    h = step_of(smoothed)
    steps = int(np.ceil((smoothed.time[-1] - smoothed.time[0]) / h)) + 1
    motion = _simulated(smoothed, use, np.array([0]), h, steps)
    pose = _laid(_pose(motion, h), 0, smoothed.eta[:1].T)[:, :, 0]
    nu = motion[:, 3:, 0]
    if np.isnan(nu).any():
        rate = np.gradient(np.column_stack([pose[:, :2], np.unwrap(pose[:, 2])]), h, axis=0)
        nu = np.column_stack([*rotate_to_body(pose[:, 2], rate[:, 0], rate[:, 1]), rate[:, 2]])
    time = smoothed.time[0] + h * np.arange(steps + 1)
    columns = np.column_stack([pose[:, :2], np.unwrap(pose[:, 2]), nu]).T
    found = np.column_stack([np.interp(smoothed.time, time, x) for x in columns])
    return found[:, :3], found[:, 3:]


def step_of(smoothed: Smoothed) -> float:
    """Step of predictions [s], which divides the sample period."""
    row = round(float(np.median(np.diff(smoothed.time))), 9)
    return row / float(np.ceil(row / (STEP * smoothed.scale.time) - 1e-6))


def _poses(smoothed: Smoothed, use: Use, begins: np.ndarray, h: float, steps: int) -> np.ndarray:
    """Pose (steps + 1, 3, w) from each of some rows on."""
    return _pose(_simulated(smoothed, use, begins, h, steps), h)


def _pose(motion: np.ndarray, h: float) -> np.ndarray:
    """Pose of a motion (steps + 1, 6, w); where it has none, by its velocity from the origin on."""
    return _track(motion, h) if np.isnan(motion[0, :3]).any() else motion[:, :3]


def predicted_windows(w: WeakWindows, use: Use) -> Windows | None:
    """The windows that are predicted: as of any model, or one that is the run as a whole."""
    smoothed = w.smoothed
    try:
        if not use.whole:
            return Windows([smoothed], w.horizon)
        seconds = float(smoothed.time[-1] - smoothed.time[0]) + 0.75 * smoothed.track.period
        return Windows([smoothed], seconds).after(use.run_in(smoothed))
    except cosim.InputError as error:
        if use.whole:
            raise cosim.InputError(f"run '{w.run.name}': {error}") from None
        return None


def _simulated(smoothed: Smoothed, use: Use, begins: np.ndarray, h: float, steps: int) -> np.ndarray:
    """Motion (steps + 1, 6, w) from each of some rows on; NaN where there is no such output."""
    fmu, run, outputs = use.fmu, smoothed.track.run, use.map.told("outputs")
    names = [f"window{k}" for k in range(begins.size)]
    with scratch_folder() as folder:
        recording = folder / "commands.csv"
        # A row acts in the step that ends at its time, the first one before that, too.
        time = np.round((np.arange(steps) + 1) * h, 12)
        columns = {}
        for name, row in zip(names, begins, strict=True):
            given = _commands(run, use, smoothed.time[row] + (np.arange(steps) + 0.5) * h)
            columns |= {f"{name}.{variable}": values for variable, values in given.items()}
        _write(recording, time, columns)
        scenario = {
            "name": "prediction",
            "step": h,
            "stop": round(steps * h, 9),
            "fmus": {
                name: {
                    "path": str(fmu.path),
                    "parameters": _start(smoothed, use, row),
                    "isolate": fmu.isolated,
                }
                for name, row in zip(names, begins, strict=True)
            },
            "recordings": [{"path": str(recording), "inputs": {name: name for name in columns}}],
            "log": {"signals": [f"{name}.{c.name}" for name in names for c in outputs.values()]},
        }
        result = cosim.simulate(cosim.load_scenario(scenario), folder / "out", pictures=False)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        if result.status != "done":
            raise cosim.InputError(f"'{fmu.name}' failed on run '{run.name}': {result.message}")
        log = cosim.read_log(result.folder)
    motion = np.full((steps + 1, len(MOTION), begins.size), np.nan)
    for signal, column in outputs.items():
        for k, name in enumerate(names):
            values = log[f"{name}.{column.name}"]
            motion[:, MOTION.index(signal), k] = use.in_si(signal, values)
    for signal, value in use.map.fixed.items():
        motion[:, MOTION.index(signal)] = value
    return motion


def _commands(run: Run, use: Use, time: np.ndarray) -> dict[str, np.ndarray]:
    """Input -> its values at some times [s]; a command acts from its time to the next."""
    row = np.maximum(np.searchsorted(run.time, time, side="right") - 1, 0)
    given = _commanded(run)
    inputs = use.map.told("inputs")
    return {c.name: use.in_variable(s, c, given[s][row]) for s, c in inputs.items()}


def _commanded(run: Run) -> dict[str, np.ndarray]:
    """Force or command -> its values (n,) in a run [SI]."""
    return dict(zip(TAU, run.tau_cmd.T, strict=True)) | run.commanded


def at_samples(smoothed: Smoothed) -> dict[str, np.ndarray]:
    """Signal -> its values (n,) at the samples of a run [SI]: commands, and the smoothed motion."""
    motion = np.concatenate([smoothed.eta, smoothed.nu], axis=1).T
    return _commanded(smoothed.track.run) | dict(zip(MOTION, motion, strict=True))


def _start(smoothed: Smoothed, use: Use, row: int) -> dict[str, float]:
    """Start value -> its value for a prediction from a row of a run on."""
    given = at_samples(smoothed)
    start = use.map.told("start")
    return {c.name: float(use.in_variable(s, c, given[s][row])) for s, c in start.items()}


def _write(path: Path, time: np.ndarray, columns: dict[str, np.ndarray]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *columns])
        writer.writerows(zip(*(c.tolist() for c in (time, *columns.values())), strict=True))


def _track(motion: np.ndarray, h: float) -> np.ndarray:
    """Pose (steps + 1, 3, w) from the origin on, by the velocities (steps + 1, 6, w) of the body."""
    sums = partial(cumulative_trapezoid, dx=h, axis=0, initial=0.0)
    u, v, r = motion[:, 3:].transpose(1, 0, 2)
    psi = sums(r)
    north, east = rotate_to_earth(psi, u, v)
    return np.stack([sums(north), sums(east), psi], axis=1)


def _laid(pose: np.ndarray, first: int, onto: np.ndarray) -> np.ndarray:
    """Tracks (steps + 1, 3, w), moved and turned so that at a step they are where others (3, w) are."""
    x, y, psi = (pose - pose[first]).transpose(1, 0, 2)
    north, east = rotate_to_earth(onto[2] - pose[first, 2], x, y)
    return np.stack([onto[0] + north, onto[1] + east, onto[2] + psi], axis=1)
