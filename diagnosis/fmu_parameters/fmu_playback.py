"""An FMU along given inputs from a given start, many times, in confined processes.

A request that fails says why; the others go on. A process that an FMU ends is replaced.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from threading import Lock
from typing import NamedTuple

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import ConfinedFmu, DoubleMemory, IsolatedInstance, Port

from ..predictors import Execution
from ..predictors.fmu.short_steps import returns_by_reset
from .additional_force import AdditionalForce

PROCESSES = 2  # chosen: as everywhere in the diagnosis
LONGEST = 120.0  # s that one prediction may take; chosen: a window is some thousand steps


def of_predictions(execution: Execution) -> Execution:
    """How an FMU is run whose calls are whole predictions."""
    return execution._replace(timeout=execution.timeout or LONGEST)


class InputCourse(NamedTuple):
    """What an FMU gets in one prediction.

    Attributes:
        h: length of a step [s].
        start: variable -> value that it begins with.
        inputs: (steps, n), values of the inputs in each step.
    """

    h: float
    start: Mapping[str, float]
    inputs: np.ndarray


@dataclass(frozen=True)
class PlaybackRequest:
    """One prediction.

    Attributes:
        course: its number.
        values: variable -> value in place of that of the course, or in addition.
        forces: what acts in addition, on inputs.
    """

    course: int
    values: Mapping[str, float]
    forces: Sequence[AdditionalForce] = ()


@dataclass(frozen=True)
class PlayedBack:
    """A prediction.

    Attributes:
        outputs: (steps + 1, m); NaN from where the FMU failed.
        fault: why it failed; empty: it did not.
    """

    outputs: np.ndarray
    fault: str = ""


class Playback:
    """An FMU in one process.

    Args:
        fmu: the FMU.
        inputs, outputs: variables that are put and got in each step.
        courses: what is asked for.
    """

    _begins = Lock()  # processes are begun one after the other

    def __init__(
        self,
        fmu: ConfinedFmu,
        inputs: Sequence[str],
        outputs: Sequence[str],
        courses: Sequence[InputCourse],
    ) -> None:
        self._fmu, self.inputs, self.outputs, self.courses = fmu, inputs, outputs, courses
        ports = [Port(fmu.model.variables[n], k) for k, n in enumerate((*inputs, *outputs))]
        self._ports = ports[: len(inputs)], ports[len(inputs) :]
        self._instance: IsolatedInstance | None = None
        self._h = 0.0  # of its steps
        self._resets: bool | None = None
        # To save the state before each step, for one that is discarded, takes a multiple of the time.
        self._redoes = False

    def run(self, request: PlaybackRequest) -> PlayedBack:
        """One prediction."""
        try:
            if self._resets is None:
                self._resets = self._returns_by_reset(request)
            return self._run(request)
        except (SimulationError, InputError) as error:
            self.close()
            if not self._redoes:
                self._redoes = True
                return self.run(request)
            return PlayedBack(self._nothing(request), self._fmu.told(error))

    def _nothing(self, request: PlaybackRequest) -> np.ndarray:
        return np.full((len(self.courses[request.course].inputs) + 1, len(self.outputs)), np.nan)

    def _returns_by_reset(self, request: PlaybackRequest) -> bool:
        return returns_by_reset(
            lambda: self._run(request),
            lambda new, again: np.array_equal(new.outputs, again.outputs, equal_nan=True),
            self.close,
        )

    def _ready(self, h: float) -> IsolatedInstance:
        if self._instance is not None and self._resets is not False and h == self._h:
            self._instance.reset()
            return self._instance
        self.close()
        with self._begins:
            self._instance, self._h = self._fmu.instance(), h
        count = sum(map(len, self._ports))
        self._instance.bind(*self._ports, DoubleMemory(count), h, self._redoes)
        return self._instance

    def close(self) -> None:
        """End its process."""
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.free()

    def _run(self, request: PlaybackRequest) -> PlayedBack:
        course = self.courses[request.course]
        start, rows = {**course.start, **request.values}, np.array(course.inputs, float)
        # An input that is calibrated keeps its value.
        for k, name in enumerate(self.inputs):
            rows[:, k] = start.pop(name, rows[:, k])
        terms = [t for f in request.forces for t in f.terms(self.inputs, self.outputs)]
        outputs, instance = self._nothing(request), self._ready(course.h)
        told = np.frombuffer(instance.whole_run(start, rows.tobytes(), len(rows), course.h, terms))
        known = told.reshape(-1, len(self.outputs))
        outputs[: len(known)] = known
        if np.isfinite(outputs).all():
            return PlayedBack(outputs)
        self.close()  # a reset may not cure it
        k = len(known) - 1
        place = int(np.argmax(np.nan_to_num(np.abs(outputs[k]), nan=np.inf)))
        how = "diverges" if np.isfinite(outputs[k, place]) else "is not finite"
        return PlayedBack(outputs, f"{self.outputs[place]} {how} at t = {k * course.h:.6g} s")


class Processes:
    """An FMU in processes of its own, in which it may fail; arguments as of :class:`Playback`."""

    def __init__(
        self,
        fmu: ConfinedFmu,
        inputs: Sequence[str],
        outputs: Sequence[str],
        courses: Sequence[InputCourse],
    ) -> None:
        self._fmu, self.name, self.outputs = fmu, fmu.model.path.name, outputs
        self._playbacks = [Playback(fmu, inputs, outputs, courses) for _ in range(PROCESSES)]
        self._free = SimpleQueue[Playback]()
        for playback in self._playbacks:
            self._free.put(playback)
        self._threads = ThreadPoolExecutor(PROCESSES, "playback")

    def run(self, requests: Sequence[PlaybackRequest]) -> list[PlayedBack]:
        """Some predictions, in their order."""
        return [*self._threads.map(self._one, requests)]

    def _one(self, request: PlaybackRequest) -> PlayedBack:
        playback = self._free.get()
        try:
            return playback.run(request)
        finally:
            self._free.put(playback)

    def close(self) -> None:
        """End the processes."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        self._fmu.close()  # and with it predictions that are under way
        self._threads.shutdown()
        for playback in self._playbacks:
            playback.close()

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
