"""What the commands ask of an FMU and measured runs, be it of a ship or of any other system."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cosim.fmu import ConfinedFmu

from ..predictors.fmu.fmu_playback import Processes
from .additional_force import AdditionalForce
from .measured_system import Window
from .parameter_file import CalibratedParameter
from .residuals import WindowResiduals


class CalibrationTask(ABC):
    """An FMU and measured runs, read and checked.

    Args:
        parameters: that are calibrated.
        notes: what a reader should know of the choice of these.

    Attributes:
        names, units: of the measured outputs.
        driven: inputs that the runs drive.
        forces_on: inputs on which a force may act in addition.
        outputs: variables that are predicted: the measured ones, and others that a force may be a
            function of.
        angles: numbers of the measured outputs that are angles [rad].
        lines: (2, m), gain and offset that make of an output what is measured; None: it is that.
        content: the map, as JSON has it.
        use: run -> train, validate or test.
    """

    names: Sequence[str]
    units: Sequence[str]
    driven: Sequence[str]
    forces_on: Sequence[str]
    outputs: Sequence[str]
    angles: Sequence[int] = ()
    lines: np.ndarray | None = None
    content: Mapping[str, Any]
    use: Mapping[str, str]

    def __init__(self, parameters: list[CalibratedParameter], notes: list[str]) -> None:
        self.parameters, self.notes = parameters, notes
        self._processes: Processes | None = None

    @cached_property
    @abstractmethod
    def confined(self) -> ConfinedFmu:
        """The FMU in its processes.

        Raises:
            InputError: there is no process for it.
        """

    @property
    @abstractmethod
    def usual(self) -> dict[str, float]:
        """Of each input on which a force may act a usual size of that."""

    @property
    @abstractmethod
    def possible(self) -> list[AdditionalForce]:
        """Forces that may act in addition."""

    @abstractmethod
    def windows(self) -> tuple[Mapping[str, Sequence[Window]], np.ndarray]:
        """Use -> the windows of its runs, and the noise (m,) of the measured outputs.

        Raises:
            InputError: runs are too short, or have no samples of a column.
        """

    def residuals(self) -> dict[str, WindowResiduals]:
        """Use -> the residuals of its runs, of those that there are; errors as of :meth:`windows`."""
        windows, noise = self.windows()
        variables = self.confined.model.variables
        set_once = [p.name for p in self.parameters if variables[p.name].causality == "input"]
        inputs = [*dict.fromkeys([*self.driven, *self.forces_on, *set_once])]
        self._processes = processes = Processes(self.confined, inputs, self.outputs)
        return {
            use: WindowResiduals(processes, own, noise, self.parameters, self.lines, self.angles)
            for use, own in windows.items()
            if own
        }

    def close(self) -> None:
        """End the processes in which the FMU runs."""
        if self._processes is not None:
            self._processes.close()
