"""An FMU that is to be held against measured runs, and which of its variables are what."""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import cosim
from cosim.export import export_fmu
from cosim.fmu import Model
from cosim.system import prepare
from fmus.ship import ship

from ...runs import OF_UNIT, QUANTITY, Run
from .variable_map import VariableMap, completed, propose, read_map, unmatched

SYSTEMS = (".ssp", ".json")
SUFFIXES = (".fmu", *SYSTEMS)
TAU = ("tau_X", "tau_Y", "tau_N")


class Fmu:
    """An FMI 2.0 FMU for co-simulation that moves as a ship does.

    Args:
        path: of the file; a system, as an SSP archive or a scenario, is made one FMU, with what no
            connection feeds as its inputs, and variables called ``instance.variable``.
        map: which of its variables is which signal, a file; None: as names and units tell.

    Raises:
        InputError: no such FMU, or none for co-simulation by FMI 2.0; a system that one FMU cannot hold.
    """

    def __init__(self, path: str | Path, map: str | Path | None = None) -> None:  # noqa: A002
        self._given = self.path = Path(path).absolute()
        if self.path.suffix in SYSTEMS:
            self._made = TemporaryDirectory(prefix="cosim_")
            self.path = _as_one(self._given, Path(self._made.name))
        self.map = None if map is None else Path(map)
        self.told = None if self.map is None else read_map(self.map)
        self.model = Model(self.path)

    @property
    def name(self) -> str:
        """Of the file."""
        return self._given.name

    @property
    def sha256(self) -> str:
        """Of the file."""
        return hashlib.sha256(self._given.read_bytes()).hexdigest()

    @property
    def step(self) -> float | None:
        """The step that it suggests [s]; None: it suggests none."""
        suggested = self.model.description.defaultExperiment
        return float(suggested.stepSize) if suggested is not None and suggested.stepSize else None

    @property
    def isolated(self) -> bool:
        """Whether each instance needs a process of its own: where one process may hold only one."""
        told = self.model.description.coSimulation
        return bool(told is not None and told.canBeInstantiatedOnlyOncePerProcess)

    def given(self, runs: Sequence[Run]) -> VariableMap:
        """The map of the file, else the one that names and units tell, for some runs."""
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


def _as_one(path: Path, folder: Path) -> Path:
    """A system as one FMU, whose parameters are all that the system leaves open."""
    system = prepare(cosim.load_scenario(path))
    try:
        given = {f"{name}.{v.name}" for name, values in system.parameters.items() for v, _ in values}
        every = {
            f"{name}.{v.name}"
            for name, model in system.models.items()
            for v in model.variables.values()
            if v.causality == "parameter" and v.type == "Real"
        }
        made = folder / f"{path.stem}.fmu"
        export_fmu(system, made, expose=every - given)
        return made
    finally:
        system.close()


class UnmatchedError(cosim.InputError):
    """Variables that are needed are not known by their names, or not in the map.

    Attributes:
        proposal: the content of a map with those that are known.
    """

    def __init__(self, message: str, proposal: Mapping[str, Any]) -> None:
        super().__init__(message)
        self.proposal = proposal


def commands_of(runs: Sequence[Run]) -> dict[str, str]:
    """Signal -> quantity of the forces and commands that all of some runs of a ship have."""
    units = ship(description=runs[0].ship).commands or {}
    every = [{*TAU, *run.commanded} for run in runs]
    common = [s for s in dict.fromkeys([*TAU, *runs[0].commanded]) if all(s in e for e in every)]
    return {s: QUANTITY[s] if s in QUANTITY else OF_UNIT[units[s]] for s in common}
