"""The FMU of any system, and the windows in which its predictions are compared with measured outputs."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.fmu import ConfinedFmu, FmuModel
from cosim.scenario import json_content
from cybership.message_text import quoted

from ..predictors import DEFAULT_EXECUTION, Execution
from ..predictors.black_box import MOTION, POSE
from ..predictors.fmu.fmu_playback import confined
from ..runs import stated_layout
from .additional_force import AdditionalForce
from .calibration_task import CalibrationTask
from .force_search import candidates
from .measured_system import MeasuredRun, Window, columns_of, noises, read_runs, windows_of
from .parameter_file import CalibratedParameter, chosen_parameters, unit_of
from .system_map import TIME, SystemMap, check_map, force_inputs, map_by_names, read_system_map

# 1, outputs that are no measured ones, of which an additional force may be a function; chosen: the more
# are tried, the more alike they are.
MOST_OUTPUTS = 6


def is_system(runs: Sequence[Path], map: Path | None) -> bool:  # noqa: A002
    """Whether runs are of a system that is not a ship: the map or the columns have no pose.

    Raises:
        InputError: map or run cannot be read.
    """
    first = runs[0]
    if first.is_file():
        layout = stated_layout(first)
        if not set(POSE) <= {*columns_of(first), *(layout.columns if layout else ())}:
            return True
    if map is None:
        return False
    content = json_content(map, "a map")
    outputs = content.get("outputs") if isinstance(content, dict) else None
    return isinstance(outputs, dict) and not set(outputs) <= set(MOTION)


class SystemTask(CalibrationTask):
    """An FMU of any system, what its map says, and measured runs.

    Args:
        model: the FMU.
        map: which column is which variable.
        parameters, notes: see :class:`.calibration_task.CalibrationTask`.
        runs: of each use.
        window: length of the windows [s]; None: as the map says.
        execution: how the FMU is run.

    Attributes:
        length: of the windows [s]; None: whole runs.
    """

    def __init__(
        self,
        model: FmuModel,
        map: SystemMap,  # noqa: A002
        parameters: list[CalibratedParameter],
        notes: list[str],
        runs: Mapping[str, Sequence[MeasuredRun]],
        window: float | None = None,
        execution: Execution = DEFAULT_EXECUTION,
    ) -> None:
        super().__init__(parameters, notes)
        self.map, self.runs, self._model, self._execution = map, runs, model, execution
        self.content = map.model_dump(exclude_none=True)
        self.use = {r.name: use for use, every in runs.items() for r in every}
        self.length = window or map.window
        self.driven = [c.name for c in map.inputs.values()]
        self.names = [c.name for c in map.outputs.values()]
        self.units = [unit_of(model.variables[n]) for n in self.names]
        self.forces_on = force_inputs(map, model)
        others = [v.name for v in model.reals("output") if v.name not in self.names]
        self.outputs = [*self.names, *(others[:MOST_OUTPUTS] if self.forces_on else [])]

    @cached_property
    def confined(self) -> ConfinedFmu:
        return confined(self._model, self._execution)

    @property
    def usual(self) -> dict[str, float]:
        """That of what drives the input, else 1."""
        found = dict.fromkeys(self.forces_on, 1.0)
        for column, c in self.map.inputs.items():
            if c.name in found:
                x = np.concatenate([c.factor * r.columns[column] + c.offset for r in self.runs["train"]])
                found[c.name] = float(np.sqrt(np.nanmean(x**2))) or 1.0
        return found

    @property
    def possible(self) -> list[AdditionalForce]:
        return candidates(self.forces_on, self.outputs, self.names)

    def windows(self) -> tuple[dict[str, list[Window]], np.ndarray]:
        noise = noises(self.runs["train"], self.map)
        return {
            use: [w for r in runs for w in windows_of(r, self.map, self._model, noise, self.length)]
            for use, runs in self.runs.items()
        }, noise


def system_task(
    fmu: Path,
    map: Path | None,  # noqa: A002
    runs: dict[str, Sequence[Path]],
    parameters: Path | None,
    window: float | None = None,
    execution: Execution = DEFAULT_EXECUTION,
) -> SystemTask:
    """Read an FMU, its map, its parameters and measured runs.

    Args:
        fmu, map, parameters: their files; without one columns are known by names, and parameters have
            priors by their kind.
        runs: use -> files; those of ``train`` say which columns there are.
        window: length of the windows [s]; None: as the map says.
        execution: how the FMU is run.

    Raises:
        InputError: one of them is not as it should be.
    """
    model = FmuModel(fmu.absolute())
    train = [*runs.get("train", ())]
    if map is not None:
        found = read_system_map(map)
    elif train:
        found = map_by_names(model, columns_of(train[0]), f"'{train[0]}'")
    else:
        outputs = {v.name: v.name for v in model.reals("output")}
        if not outputs:
            raise InputError(f"'{fmu}' has no output of type Real to compare with measurements")
        found = SystemMap.model_validate({"outputs": outputs})
    check_map(found, model, f"'{map or fmu.name}'")
    chosen, notes = chosen_parameters(parameters, model, found.variables)
    if not chosen:
        why = f" ({'; '.join(notes[:3])})" if notes else ""
        notes = [f"{quoted(fmu.name)} has no parameter that can be calibrated{why}"]
    columns = [*found.inputs, *found.outputs]
    if TIME in columns:
        raise InputError(f"'{map}': {TIME} is the time of the samples and cannot be a column of the map")
    read = {use: read_runs(paths, columns) for use, paths in runs.items()}
    return SystemTask(model, found, chosen, notes, read, window, execution)
