"""What the commands ask of an FMU and measured runs: read, checked, and ready to be predicted."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Protocol

import numpy as np

from cosim import InputError
from cosim.fmu import ConfinedFmu, FmuModel
from cybership.message_text import quoted

from ..execution.user_files import json_content
from ..predictors import DEFAULT_EXECUTION, Execution
from ..predictors.black_box import MOTION, POSE
from ..predictors.fmu.instances import confined
from ..runs import stated_layout
from .additional_force import AdditionalForce
from .fmu_playback import InputCourse, Processes, of_predictions
from .force_search import candidates
from .measured_system import MeasuredRun, Window, columns_of, noises, read_runs, windows_of
from .parameter_file import CalibratedParameter, proposed, read_parameters
from .residuals import WindowResiduals
from .system_map import TIME, SystemMap, check_map, force_inputs, map_by_names, read_system_map

# Outputs that are no measured ones, of which an additional force may be a function; chosen: the more
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


@dataclass
class SystemTask:
    """An FMU, what its map says, and its parameters.

    Attributes:
        model: the FMU.
        map: which column is which variable.
        parameters: that are calibrated.
        notes: what a reader should know of the choice of these.
        runs: of each use.
        window: length of the windows [s]; None: as the map says.
        execution: how the FMU is run.
    """

    model: FmuModel
    map: SystemMap
    parameters: list[CalibratedParameter]
    notes: list[str]
    runs: dict[str, list[MeasuredRun]]
    window: float | None = None
    execution: Execution = DEFAULT_EXECUTION
    _open: ExitStack = field(default_factory=ExitStack)

    @cached_property
    def confined(self) -> ConfinedFmu:
        """The FMU in its processes.

        Raises:
            InputError: there is no process for it.
        """
        return confined(self.model, of_predictions(self.execution))

    @property
    def names(self) -> list[str]:
        """Variables of the measured outputs."""
        return [c.name for c in self.map.outputs.values()]

    @property
    def units(self) -> list[str]:
        """Their units."""
        return [self.unit(n) for n in self.names]

    def unit(self, name: str) -> str:
        """Of a variable; 1 where the FMU states none."""
        unit = self.model.variables[name].unit
        return "1" if unit is None else unit.name

    @property
    def forces_on(self) -> list[str]:
        """Inputs on which a force may act in addition."""
        return force_inputs(self.map, self.model)

    @property
    def outputs(self) -> list[str]:
        """Measured outputs, and a few others that a force may be a function of."""
        others = [
            v.name
            for v in self.model.variables.values()
            if v.causality == "output" and v.type == "Real" and v.name not in self.names
        ]
        return [*self.names, *(others[:MOST_OUTPUTS] if self.forces_on else [])]

    @property
    def usual(self) -> dict[str, float]:
        """Of each force input a usual size: of what drives it, else 1."""
        found = dict.fromkeys(self.forces_on, 1.0)
        for column, c in self.map.inputs.items():
            if c.name in found:
                x = np.concatenate([c.factor * r.columns[column] + c.offset for r in self.runs["train"]])
                found[c.name] = float(np.sqrt(np.nanmean(x**2))) or 1.0
        return found

    @property
    def possible(self) -> list[AdditionalForce]:
        """Forces that may act in addition."""
        return candidates(self.forces_on, self.outputs, self.names)

    def residuals(self) -> dict[str, WindowResiduals]:
        """Use -> the residuals of its runs, of those that there are.

        Raises:
            InputError: a run is too short, or has no samples of a column.
        """
        noise = noises(self.runs["train"], self.map)
        length = self.window or self.map.window
        windows = {
            use: [w for r in runs for w in windows_of(r, self.map, self.model, noise, length)]
            for use, runs in self.runs.items()
        }
        driven = [c.name for c in self.map.inputs.values()]
        processes = processes_of(self, [*chain(*windows.values())], self.confined, driven)
        self._open.enter_context(processes)
        return {
            use: WindowResiduals(processes, own, first, noise, self.parameters)
            for use, own, first in numbered(windows)
        }

    def close(self) -> None:
        """End the processes in which the FMU runs."""
        self._open.close()


class _Task(Protocol):
    """What is common to the tasks of systems and ships."""

    parameters: list[CalibratedParameter]

    @property
    def forces_on(self) -> list[str]: ...
    @property
    def outputs(self) -> list[str]: ...


def processes_of(
    task: _Task, windows: Sequence[Window], fmu: ConfinedFmu, driven: Sequence[str]
) -> Processes:
    """Processes that run an FMU along windows.

    Inputs that nothing drives but a force keep their start value, as do parameters that are inputs.

    Args:
        task: of a system or a ship.
        windows: whose courses have the inputs in ``driven``.
        fmu: the FMU.
        driven: inputs that the runs drive.
    """
    every = fmu.model.variables
    set_once = [p.name for p in task.parameters if every[p.name].causality == "input"]
    extra = [n for n in dict.fromkeys([*task.forces_on, *set_once]) if n not in driven]
    starts = np.array([float(every[n].start or 0.0) for n in extra])

    def whole(course: InputCourse) -> InputCourse:
        still = np.broadcast_to(starts, (len(course.inputs), starts.size))
        return course._replace(inputs=np.column_stack([course.inputs, still]))

    return Processes(fmu, [*driven, *extra], task.outputs, [whole(w.course) for w in windows])


def numbered(
    windows: Mapping[str, Sequence[Window]],
) -> Iterator[tuple[str, Sequence[Window], int]]:
    """Use, its windows, and the number of the first among all; only of uses that have any."""
    first = 0
    for use, own in windows.items():
        if own:
            yield use, own, first
        first += len(own)


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
        outputs = {
            v.name: v.name
            for v in model.variables.values()
            if v.causality == "output" and v.type == "Real"
        }
        if not outputs:
            raise InputError(f"'{fmu}' has no output of type Real to compare with measurements")
        found = SystemMap.model_validate({"outputs": outputs})
    check_map(found, model, f"'{map or fmu.name}'")
    notes: list[str] = []
    if parameters is not None:
        chosen = read_parameters(parameters, model, found.variables)
    else:
        chosen, notes = proposed(model, found.variables)
    if not chosen:
        why = f" ({'; '.join(notes[:3])})" if notes else ""
        notes = [f"{quoted(fmu.name)} has no parameter that can be calibrated{why}"]
    columns = [*found.inputs, *found.outputs]
    if TIME in columns:
        raise InputError(f"'{map}': {TIME} is the time of the samples and cannot be a column of the map")
    read = {use: read_runs(paths, columns) for use, paths in runs.items()}
    return SystemTask(model, found, chosen, notes, read, window, execution)
