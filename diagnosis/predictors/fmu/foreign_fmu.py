"""FMUs for co-simulation as predictors of measured runs."""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from weakref import finalize

import numpy as np
from scipy.interpolate import CubicSpline

import cosim
from cosim.export import export_fmu
from cosim.fmu import ConfinedFmu
from cosim.fmu import FmuModel as FmuModel
from cosim.system import prepare
from cybership.scratch_folder import Scratch
from fmus.ship import Ship, ship

from ...execution.progress import Advance, silent
from ...execution.result_folder import sha256
from ...runs import OF_UNIT, QUANTITY, Fingerprint, Run, Smoothed, body_acceleration, body_velocity
from ...runs.cleaning import BRIEF
from ...runs.run_constants import WIDTH
from ..black_box import (
    MOTION,
    POSE,
    SMALL,
    TAU,
    VELOCITY,
    BlackBox,
    Signals,
    at_samples,
    commands_at,
    planes,
)
from ..described_ship import nominal
from ..predictor import (
    DEFAULT_EXECUTION,
    FOUND,
    MAP,
    Execution,
    PredictorDescription,
    UnmatchedError,
)
from ..ship_model import Model
from ..thrust import LONGEST_STEP
from ..weak_form import WeakWindows
from ..windows import Windows, step_of
from .fmu_playback import PlaybackRequest, Processes, ShortSteps, confined
from .lineage import SYSTEMS, learned_from, parts_of, remember
from .variable_map import VariableMap, completed, propose, read_map, signal_lines, unmatched, write_map
from .wrapper import Wrapped, write_wrapper


class Fmu:
    """An FMI 2.0 FMU for co-simulation that moves as a ship does.

    Args:
        path: of the file; a system, as an SSP archive or a scenario, is made one FMU, with what no
            connection feeds as its inputs, and variables called ``instance.variable``.
        map: file that maps its variables to signals; None: from names and units.
        ship: that it is a model of; None: that of the runs.
        execution: how it is run.

    Raises:
        InputError: no such FMU, or none for co-simulation by FMI 2.0; a system that one FMU cannot hold.
    """

    parametric = False

    def __init__(
        self,
        path: str | Path,
        map: str | Path | None = None,  # noqa: A002 - as the option of the commands
        ship: Ship | None = None,
        execution: Execution = DEFAULT_EXECUTION,
    ) -> None:
        self.execution = execution
        self._given = self.path = Path(path).absolute()
        self.inner: Sequence[tuple[str, Path]] = ()
        if self.path.suffix in SYSTEMS:
            self._made = Scratch()
            finalize(self, self._made.remove)
            self.path, inner = _as_one(self._given, self._made.path)
            # Of an archive the parts are unpacked for a while, and hashed with it.
            self.inner = inner if self._given.suffix == ".json" else ()
        self.map = None if map is None else Path(map)
        self.stated = None if self.map is None else read_map(self.map)
        self.model = FmuModel(self.path)
        self.start = None if ship is None else Model(ship=ship)

    @property
    def name(self) -> str:
        """Of the file."""
        return self._given.name

    @property
    def sha256(self) -> str:
        """Of the file."""
        return hashlib.sha256(self._given.read_bytes()).hexdigest()

    @cached_property
    def learned_from(self) -> tuple[Fingerprint, ...]:
        """Runs of which it was learned, as far as it tells.

        Raises:
            InputError: it tells what is broken.
        """
        fmus = [self.path, *(path for _, path in self.inner if path.suffix == ".fmu")]
        return learned_from(fmus)

    @property
    def files(self) -> list[tuple[str, Path]]:
        """The files that decide its predictions, each after its role."""
        return [("model", self._given), *self.inner, *([("map", self.map)] if self.map else [])]

    @property
    def step(self) -> float | None:
        """The step that is asked for, or that it suggests [s]; None: neither."""
        return self.execution.step or self.model.suggested_step

    @property
    def fixed_step(self) -> float | None:
        """The only step that it takes, or that is asked for [s]; None: it takes steps of any length."""
        stated = self.model.description.coSimulation
        varies = stated is not None and stated.canHandleVariableCommunicationStepSize
        return self.step if self.execution.step or not varies else None

    @property
    def needs_tool(self) -> bool:
        """Whether it needs the tool that it was made with (``needsExecutionTool``)."""
        return self.model.needs_tool

    def given(self, runs: Sequence[Run]) -> VariableMap:
        """The map of the file, else the one from names and units, for some runs."""
        return self.stated or propose(self.model, commands_of(runs))

    def variables(self, runs: Sequence[Run]) -> VariableMap:
        """The map by which the FMU predicts some runs, with the units of its variables.

        Raises:
            InputError: the map does not fit the FMU.
            UnmatchedError: pose and velocity are incomplete, or all commands are missing.
        """
        where = f"'{self.map or self.name}'"
        given = self.given(runs)
        found = completed(given, self.model, commands_of(runs), where)
        lacking = unmatched(found, self.model)
        if lacking:
            raise UnmatchedError(f"{where}: {'; '.join(lacking)}", given.content())
        return found

    def on(self, runs: Sequence[WeakWindows], advance: Advance = silent) -> "FmuPredictor":
        """The predictor of some runs, see :meth:`..predictor.ModelSource.on`.

        Raises:
            InputError: as :meth:`variables`; the FMU refuses to be set to a measured state, or fails.
        """
        predictor = self.begun_on(runs)
        advance(f"response of {self.name} in measured states")
        assert predictor.model  # which takes a while
        return predictor

    def begun_on(self, runs: Sequence[WeakWindows]) -> "FmuPredictor":
        """The predictor of some runs, of which nothing is computed yet.

        Raises:
            InputError: as :meth:`variables`; its step is too long; there is no process for it.
        """
        longest = WIDTH * runs[0].scale.time
        if (step := self.fixed_step) and step > longest:
            raise cosim.InputError(
                f"'{self.name}' has a step of {step:g} s; allowed is at most {longest:.3g} s, the time "
                "over which its error is averaged; --step sets another step"
            )
        measured = [w.run for w in runs]
        maps = self.given(measured), self.variables(measured)  # before a process is started
        process = confined(self.model, self.execution)
        predictor = FmuPredictor(self, process, maps, runs)
        finalize(predictor, process.close)
        return predictor


class FmuPredictor(BlackBox):
    """How an FMU predicts some runs.

    Attributes:
        given: which of its variables is which signal, as it was stated or proposed.
        map: the same with the units that the FMU declares.
        lines: see :func:`.variable_map.signal_lines`.
        confinement: what confines its processes, in words; "unconfined" where nothing does.
        processes: that predict.
    """

    kind = "FMU"

    def __init__(
        self,
        fmu: Fmu,
        process: ConfinedFmu,
        maps: tuple[VariableMap, VariableMap],
        runs: Sequence[WeakWindows],
    ) -> None:
        super().__init__(fmu.name, runs, fmu.start or nominal(runs))
        self.fmu, self.confined, self.confinement = fmu, process, process.confinement
        self.given, self.map = maps
        inputs, outputs = (
            tuple(dict.fromkeys(c.name for c in self.map.stated(g).values()))
            for g in ("inputs", "outputs")
        )
        self.processes = Processes(process, inputs, outputs, fresh=True)
        self.learned_from = fmu.learned_from
        self.files = [(role, path, sha256(path)) for role, path in fmu.files]
        self.lines = signal_lines(self.map, commands_of([w.run for w in runs]))
        self.starts = frozenset(self.map.stated("start")) & set(MOTION)
        self.inputs = frozenset(self.map.stated("inputs"))
        self.sha256, self.given_map, self.own_run_in = fmu.sha256, self.given.content(), self.map.run_in

    @property
    def whole(self) -> bool:
        return not set(VELOCITY) <= {*self.starts, *self.map.fixed}

    @property
    def placed(self) -> bool:
        return not set(POSE) <= self.map.stated("outputs").keys() & self.starts

    @cached_property
    def late(self) -> list[str]:
        """The outputs that are zero until the first step, against their start values."""
        w = self.runs[0]
        sizes = dict(zip(MOTION, (w.scale.length, w.scale.length, 1.0, *w.scale.speeds), strict=True))
        started = [s for s in MOTION if s in self.starts & self.map.stated("outputs").keys()]
        if not started:
            return []
        state = np.where(w.known[:, None], np.hstack([w.smoothed.eta, w.smoothed.nu]), 0.0)
        size = np.array([sizes[s] for s in MOTION])
        row = int(np.abs(state / size)[:, [MOTION.index(s) for s in started]].min(axis=1).argmax())
        h = self.fmu.fixed_step or step_of(w.smoothed)
        first = {s: x[0, 0] for s, x in self._told(w.smoothed, np.array([row]), h, 1).items()}
        values = dict(zip(MOTION, state[row], strict=True))
        return [s for s in started if first[s] == 0.0 and abs(values[s]) > SMALL * sizes[s]]

    @cached_property
    def _along_runs(self) -> Model:
        inputs, outputs, time = self.processes.inputs, self.processes.outputs, self.runs[0].scale.time
        h = self.fmu.fixed_step or min(self.fmu.step or LONGEST_STEP * time, BRIEF * time)
        late = bool(self.late)
        with closing(ShortSteps(self.confined, inputs, outputs, h, late)) as self._steps:
            return super()._along_runs

    def windows(self, runs: Sequence[Smoothed], length: float) -> Windows | None:
        found = super().windows(runs, length)
        if found is None or not self.late:
            return found
        return found.after(self.fmu.fixed_step or 0.5 * step_of(runs[0]))

    def motion(self, smoothed: Smoothed, rows: np.ndarray, h: float, steps: int) -> np.ndarray:
        own = self.fmu.fixed_step or h
        count = steps if own == h else int(np.ceil(steps * h / own - 1e-9))
        motion = np.full((steps + 1, len(MOTION), rows.size), np.nan)
        for signal, stated in self._told(smoothed, rows, own, max(count, 3 if self.late else 1)).items():
            x = np.unwrap(stated, axis=0) if signal == "psi" else stated
            if self.late:
                x[0] = 3.0 * (x[1] - x[2]) + x[3]
            if own != h:
                x = CubicSpline(own * np.arange(len(x)), x)(h * np.arange(steps + 1))
            motion[:, MOTION.index(signal)] = x[: steps + 1]
        return motion

    def _told(self, smoothed: Smoothed, rows: np.ndarray, h: float, steps: int) -> dict[str, np.ndarray]:
        """Signal -> its values (steps + 1, w) [SI], in steps of h [s] from some rows on."""
        found = self.processes.run([*self.requests(smoothed, rows, h, steps)])
        if fault := next((p.fault for p in found if p.fault), ""):
            where = f"'{self.name}' failed on run '{smoothed.track.run.name}'"
            raise cosim.InputError(f"{where}: {fault}")
        stated = np.stack([p.outputs for p in found], axis=2)
        return self._outputs(dict(zip(self.processes.outputs, stated.transpose(1, 0, 2), strict=True)))

    def requests(
        self, smoothed: Smoothed, rows: np.ndarray, h: float, steps: int
    ) -> Iterator[PlaybackRequest]:
        """What the FMU gets from the states in some rows of a run on, in steps of h [s]."""
        at, middle = self.of_variables("start", at_samples(smoothed)), (np.arange(steps) + 0.5) * h
        for row in rows:
            commands = commands_at(smoothed.track.run, smoothed.time[row] + middle)
            inputs = self.of_variables("inputs", commands)
            driven = np.column_stack([inputs[name] for name in self.processes.inputs])
            yield PlaybackRequest(h, _row(at, row), driven)

    def accelerations(self, signals: Signals) -> np.ndarray:
        start, inputs = (self.of_variables(group, signals) for group in ("start", "inputs"))
        motion = self._outputs(self._steps.run(start, inputs))
        slopes = self._steps.derivatives  # by differences of a few short steps
        if set(VELOCITY) <= motion.keys():
            return np.column_stack([slopes(motion[s])[0] for s in VELOCITY])
        x, y, psi = (motion[s] for s in POSE)
        derivatives = zip(*map(slopes, (x, y, np.unwrap(psi, axis=0))), strict=True)
        eta_dot, eta_ddot = map(np.column_stack, derivatives)
        return body_acceleration(psi[0], body_velocity(psi[0], eta_dot), eta_ddot)

    @property
    def _started_by(self) -> str:
        return f", by {', '.join(c.name for c in self.map.stated('start').values())}"

    def description(self) -> PredictorDescription:
        outside = tuple(self.confined.outside)
        return replace(super().description(), confinement=self.confinement, outside=outside)

    def _sentences(self, wait: float) -> Iterator[str]:
        yield from super()._sentences(wait)
        description = self.ship.ship.description
        yield (
            f"Windows, filters and effects are those of a ship of {description.length:.4g} m "
            f"({description.title}); --ship NAME|FILE.toml selects another."
        )
        if (step := self.fmu.fixed_step) is not None:
            yield f"It is stepped every {step:.6g} s, with a cubic spline through its outputs."
        if self.late:
            yield (
                f"Its outputs {', '.join(self.late)} are zero until the first step, contrary to "
                "their start values: samples of the first step of each window are left out."
            )
        yield from self.confined.sentences()

    def write(
        self, folder: Path, learned: Model | None = None, runs: Sequence[WeakWindows] = ()
    ) -> list[str]:
        """Its map; with additions, one FMU of both, and the map of that."""
        if learned is None:
            write_map(folder / MAP, self.given.content())
            return []
        wrapped = Wrapped(self.name, self.confined.model, self.map, self.lines)
        stated, of_both = write_wrapper(folder / FOUND, wrapped, self.model, learned, runs)
        if of_both is not None:
            remember(folder / FOUND, self.learned_from, runs)
        write_map(folder / MAP, (of_both or self.given).content())
        return [stated]

    def of_variables(self, group: str, signals: Signals) -> dict[str, np.ndarray]:
        """Variable -> its values, for those of some signals [SI] that a group of the map has."""
        lines, stated = self.lines[group], self.map.stated(group)
        known = ((signals[s], lines[s], c.name) for s, c in stated.items() if s in signals)
        return {name: (x - line.offset) / line.gain for x, line, name in known}

    def _outputs(self, values: Signals) -> dict[str, np.ndarray]:
        """Signal -> its values [SI], by variables' values; also of those that stay the same."""
        lines, columns = self.lines["outputs"], self.map.stated("outputs")
        found = {s: lines[s].gain * values[c.name] + lines[s].offset for s, c in columns.items()}
        like = next(iter(values.values()))
        return found | {s: np.full(like.shape, x) for s, x in self.map.fixed.items()}


def _row(values: Mapping[str, np.ndarray], k: int) -> dict[str, float]:
    return {name: float(x[k]) for name, x in values.items()}


def commands_of(runs: Sequence[Run]) -> dict[str, str]:
    """Signal -> quantity of the forces and commands that all of some runs of a ship have.

    A force in the plane is there by its components, and as ``NAME.force`` and ``NAME.angle``, the angle
    from ahead to starboard.
    """
    units = ship(description=runs[0].ship).commands
    every = [{*TAU, *run.commanded} for run in runs]
    common = [s for s in dict.fromkeys([*TAU, *runs[0].commanded]) if all(s in e for e in every)]
    found = {s: QUANTITY[s] if s in QUANTITY else OF_UNIT[units[s]] for s in common}
    polar = {f"{name}.{of}": of for name in planes(found) for of in ("force", "angle")}
    return found | polar


def _as_one(path: Path, folder: Path) -> tuple[Path, list[tuple[str, Path]]]:
    """A system as one FMU, whose parameters are all that the system leaves open, and its files."""
    made, scenario = folder / f"{path.stem}.fmu", cosim.load_scenario(path)
    with closing(prepare(scenario)) as system:
        given = {f"{name}.{v.name}" for name, values in system.parameters.items() for v, _ in values}
        models = system.models.items()
        every = {f"{name}.{v.name}" for name, model in models for v in model.reals("parameter")}
        export_fmu(system, made, expose=every - given)
        return made, parts_of(scenario, system)
