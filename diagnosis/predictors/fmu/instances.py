"""Predictions of an FMU, one confined instance for each."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import MEANS, ConfinedFmu, DoubleMemory, FmuModel, Port

from ..predictor import Execution

TOGETHER = 8  # instances that step at the same time; chosen: as processes that a computer has cores for


def confined(model: FmuModel, execution: Execution) -> ConfinedFmu:
    """An FMU, and the process that makes those of its instances.

    Raises:
        InputError: there is no process for it.
    """
    try:
        return ConfinedFmu(model, MEANS if execution.confined else (), execution.timeout)
    except SimulationError as error:
        raise InputError(str(error)) from None


class Begun(NamedTuple):
    """A prediction to be made: start value -> number, and input -> value (steps,) in each step."""

    start: Mapping[str, float]
    inputs: Mapping[str, np.ndarray]


class FmuRun:
    """A run of an FMU in a process of its own; the first input acts when it is initialised.

    Args:
        fmu: of which it is one.
        inputs: names of inputs.
        outputs: names of outputs.
        h: length of a step [s].

    Attributes:
        instance: of the FMU.
    """

    def __init__(
        self, fmu: ConfinedFmu, inputs: Sequence[str], outputs: Sequence[str], h: float
    ) -> None:
        self._variables, self.instance, self._h = fmu.model.variables, fmu.instance(), h
        names, count = [*inputs, *outputs], len(inputs)
        self._memory, self._count, self.outputs = DoubleMemory(len(names)), count, tuple(outputs)
        ports = [Port(self._variables[name], k) for k, name in enumerate(names)]
        self._access = self.instance.bind(ports[:count], ports[count:], self._memory, h)

    def initialise(self, start: Mapping[str, float], inputs: Sequence[float], stop: float) -> np.ndarray:
        """Begin with some values, up to a time [s]; returns the outputs."""
        self.instance.set_up(stop)
        for name, value in start.items():
            self.instance.set_value(self._variables[name], value)
        self.instance.enter_initialization()
        self.put(inputs)
        self.instance.exit_initialization()
        self._access.get()
        return self._told(0)

    def put(self, inputs: Sequence[float]) -> None:
        """Set the inputs."""
        for k, value in enumerate(inputs):
            self._memory.values[k] = value
        self._access.put()

    def begin(self, k: int) -> None:
        """Begin the step of a number; others may step meanwhile."""
        assert self._access.begin is not None
        self._access.begin(k * self._h)

    def end(self, k: int) -> np.ndarray:
        """The outputs after the step of a number.

        Raises:
            SimulationError: the FMU fails, or an output is not finite.
        """
        self._access.step(k * self._h)
        return self._told(k + 1)

    def whole_run(self, start: Mapping[str, float], inputs: Sequence[float], steps: int) -> np.ndarray:
        """Outputs (steps + 1, m) of a whole run with inputs that stay the same."""
        held = np.tile(np.array(inputs, float), steps).tobytes()
        told = self.instance.whole_run(start, held, steps, self._h)
        rows = np.frombuffer(told).reshape(-1, len(self.outputs))
        return np.array([self._finite(row, k) for k, row in enumerate(rows)])

    def slopes(self, unknown: Sequence[str], known: Sequence[str]) -> np.ndarray:
        """(u, k), partial derivatives after :meth:`initialise`.

        Raises:
            SimulationError: the FMU refuses.
        """
        of = [self._variables[n] for n in unknown]
        columns = [self.instance.directional_derivative(of, self._variables[n]) for n in known]
        return np.array(columns).reshape(len(known), len(unknown)).T

    def _told(self, k: int) -> np.ndarray:
        told = np.array(self._memory.values[self._count : self._count + len(self.outputs)])
        return self._finite(told, k)

    def _finite(self, told: np.ndarray, k: int) -> np.ndarray:
        if not np.isfinite(told).all():
            name = self.outputs[int(np.flatnonzero(~np.isfinite(told))[0])]
            raise SimulationError(f"{name} is not finite at t = {k * self._h:.6g} s after its start")
        return told


def simulate(
    fmu: ConfinedFmu, begun: Sequence[Begun], outputs: Sequence[str], h: float, steps: int
) -> dict[str, np.ndarray]:
    """Each output (steps + 1, w) of w predictions in steps of h [s].

    Args:
        fmu: what predicts.
        begun: what is predicted.
        outputs: names of variables.
        h, steps: length of a step [s], and how many.

    Raises:
        InputError: the FMU fails.
    """
    names = tuple(dict.fromkeys(outputs))
    try:
        groups = [begun[k : k + TOGETHER] for k in range(0, len(begun), TOGETHER)]
        told = np.concatenate([_together(fmu, group, names, h, steps) for group in groups], axis=1)
    except (InputError, SimulationError) as error:
        raise InputError(fmu.told(error)) from None
    return {name: told[:, :, k] for k, name in enumerate(names)}


def _together(
    fmu: ConfinedFmu, begun: Sequence[Begun], outputs: Sequence[str], h: float, steps: int
) -> np.ndarray:
    """Outputs (steps + 1, w, m) of predictions side by side."""
    told, running = np.empty((steps + 1, len(begun), len(outputs))), list[FmuRun]()
    try:
        for one in begun:
            running.append(FmuRun(fmu, tuple(one.inputs), outputs, h))
        inputs = [np.column_stack([*one.inputs.values()]).tolist() for one in begun]
        for w, (one, each) in enumerate(zip(running, begun, strict=True)):
            told[0, w] = one.initialise(each.start, inputs[w][0], steps * h)
        for k in range(steps):
            for w, one in enumerate(running):
                one.put(inputs[w][k])
                one.begin(k)
            for w, one in enumerate(running):
                told[k + 1, w] = one.end(k)
        for one in running:
            one.instance.terminate()
    finally:
        for one in running:
            one.instance.free()
    return told
