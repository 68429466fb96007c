"""Inverse use of an FMU: its acceleration in a state that is set, by a few short steps from there.

The FMU is begun anew for each state. It is reset in between, if a reset is seen to leave it as its
instantiation does; else each state has an instance of its own.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import DoubleMemory, FmuModel, LocalInstance, Port

STEPS = 3  # Chosen: of a motion at 1 rad/s in steps of 0.02 s differences are then right to 1e-6.

Values = Mapping[str, float]


class ShortSteps:
    """What an FMU does within a few short steps from its start.

    Args:
        model: the FMU.
        inputs, outputs: names of what is set in each step, and of what is told.
        h: length of a step [s].
    """

    def __init__(self, model: FmuModel, inputs: Sequence[str], outputs: Sequence[str], h: float) -> None:
        self._model, self.h = model, h
        self._inputs = [Port(model.variables[name], k) for k, name in enumerate(inputs)]
        told = dict.fromkeys(outputs)
        self._outputs = [Port(model.variables[name], len(inputs) + k) for k, name in enumerate(told)]
        self._memory = DoubleMemory(len(inputs) + len(told))
        self._resets: bool | None = None
        self._instance: LocalInstance | None = None

    def run(self, start: Values, inputs: Values) -> dict[str, np.ndarray]:
        """Each output (STEPS + 1,) from a start on.

        Raises:
            InputError: the FMU refuses it, or fails.
        """
        try:
            if self._resets is None:
                self._resets = self._tried(start, inputs)
            return self._run(start, inputs)
        except SimulationError as error:
            self.close()
            raise InputError(
                f"'{self._model.path.name}' cannot be set to a measured state: {error}"
            ) from None

    def derivatives(self, x: np.ndarray) -> tuple[float, float]:
        """First and second derivative at the start of an output (STEPS + 1,), of a polynomial."""
        powers = np.vander(self.h * np.arange(len(x)), increasing=True)
        _, first, half, *_ = np.linalg.solve(powers, x).tolist()
        return first, 2.0 * half

    def close(self) -> None:
        """Free the FMU."""
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.free()

    def _tried(self, start: Values, inputs: Values) -> bool:
        """Whether a reset leaves the FMU as its instantiation does, as far as can be seen."""
        new = self._run(start, inputs)
        with suppress(SimulationError):
            again = self._run(start, inputs)
            return all(np.array_equal(new[name], again[name]) for name in new)
        self.close()
        return False

    def _run(self, start: Values, inputs: Values) -> dict[str, np.ndarray]:
        if self._instance is not None and self._resets is not False:
            self._instance.reset(lambda *_: None)
        else:
            self.close()
            self._instance = LocalInstance("model", self._model, lambda *_: None)
            self._access = self._instance.bind(self._inputs, self._outputs, self._memory, self.h)
        instance, values = self._instance, self._memory.values
        instance.set_up(STEPS * self.h)
        for name, value in start.items():
            instance.set_value(self._model.variables[name], value)
        for port in self._inputs:
            values[port.slot] = inputs[port.variable.name]
        instance.enter_initialization()
        self._access.put()
        instance.exit_initialization()
        self._access.get()
        told = [[values[port.slot] for port in self._outputs]]
        for k in range(STEPS):
            self._access.step(k * self.h)
            told.append([values[port.slot] for port in self._outputs])
        instance.terminate()
        return {
            port.variable.name: np.array(v)
            for port, v in zip(self._outputs, zip(*told, strict=True), strict=True)
        }
