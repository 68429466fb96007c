"""FMUs for co-simulation as predictors of measured runs."""

import hashlib
from collections.abc import Sequence
from contextlib import closing
from functools import cached_property
from pathlib import Path
from weakref import finalize

from typing_extensions import deprecated

import cosim
from cosim.export import export_fmu
from cosim.fmu import FmuModel as FmuModel
from cosim.system import prepare
from cybership.scratch_folder import Scratch
from fmus.ship import Ship

from ...execution.progress import Advance, silent
from ...runs import Fingerprint, Run
from ..predictor import (
    DEFAULT_EXECUTION,
    Execution,
    UnmatchedError,
)
from ..ship_model import Model
from ..weak_form import WeakWindows
from .fmu_predictor import FmuPredictor, commands_of
from .instances import confined
from .lineage import learned_from, parts_of
from .ship_of_fmu import SYSTEMS
from .variable_map import VariableMap, completed, propose, read_map, unmatched


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
        self.told = None if self.map is None else read_map(self.map)
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
        suggested = self.model.description.defaultExperiment
        told = float(suggested.stepSize) if suggested is not None and suggested.stepSize else None
        return self.execution.step or told

    @property
    @deprecated("Each instance has a process of its own.")
    def isolated(self) -> bool:
        """Whether each instance has a process of its own."""
        return True

    @property
    def fixed_step(self) -> float | None:
        """The only step that it takes, or that is asked for [s]; None: it takes steps of any length."""
        told = self.model.description.coSimulation
        varies = told is not None and told.canHandleVariableCommunicationStepSize
        return self.step if self.execution.step or not varies else None

    @property
    def needs_tool(self) -> bool:
        """Whether it needs the tool that it was made with (``needsExecutionTool``)."""
        return self.model.needs_tool

    def given(self, runs: Sequence[Run]) -> VariableMap:
        """The map of the file, else the one from names and units, for some runs."""
        return self.told or propose(self.model, commands_of(runs))

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

    def on(self, runs: Sequence[WeakWindows], advance: Advance = silent) -> FmuPredictor:
        """The predictor of some runs, see :meth:`..predictor.ModelSource.on`.

        Raises:
            InputError: as :meth:`variables`; the FMU refuses to be set to a measured state, or fails.
        """
        predictor = self.begun_on(runs)
        advance(f"response of {self.name} in measured states")
        assert predictor.model  # which takes a while
        return predictor

    def begun_on(self, runs: Sequence[WeakWindows]) -> FmuPredictor:
        """The predictor of some runs, of which nothing is computed yet.

        Raises:
            InputError: as :meth:`variables`; there is no process for it.
        """
        measured = [w.run for w in runs]
        maps = self.given(measured), self.variables(measured)  # before a process is started
        process = confined(self.model, self.execution)
        predictor = FmuPredictor(self, process, maps, runs)
        finalize(predictor, process.close)
        return predictor


def _as_one(path: Path, folder: Path) -> tuple[Path, list[tuple[str, Path]]]:
    """A system as one FMU, whose parameters are all that the system leaves open, and its files."""
    made, scenario = folder / f"{path.stem}.fmu", cosim.load_scenario(path)
    with closing(prepare(scenario)) as system:
        given = {f"{name}.{v.name}" for name, values in system.parameters.items() for v, _ in values}
        every = {
            f"{name}.{v.name}"
            for name, model in system.models.items()
            for v in model.variables.values()
            if v.causality == "parameter" and v.type == "Real"
        }
        export_fmu(system, made, expose=every - given)
        return made, parts_of(scenario, system)
