"""An FMU along given inputs from a given start, many times, in processes of their own.

A request that fails says why; the others go on. A process that an FMU ends is replaced.
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent import futures
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosim import InputError, SimulationError
from cosim.fmu import DoubleMemory, FmuModel, LocalInstance, Port
from cosim.interrupts import ignore_interrupts
from cosim.process import end_with_parent, without_program

from .additional_force import AdditionalForce

PROCESSES = 2  # chosen: as everywhere in the diagnosis
LONGEST = 120.0  # s that one prediction may take; chosen: a window is some thousand steps


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


@dataclass
class Playback:
    """An FMU in this process.

    Args:
        path: of the FMU.
        inputs, outputs: variables that are put and got in each step.
        courses: what is asked for.
    """

    path: Path
    inputs: Sequence[str]
    outputs: Sequence[str]
    courses: Sequence[InputCourse]
    _instance: LocalInstance | None = None
    _h: float = 0.0  # of its steps

    def __post_init__(self) -> None:
        self._model = FmuModel(self.path)
        ports = [Port(self._model.variables[n], k) for k, n in enumerate((*self.inputs, *self.outputs))]
        self._puts, self._gets = ports[: len(self.inputs)], ports[len(self.inputs) :]
        self._memory = DoubleMemory(len(ports))
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
            return PlayedBack(self._nothing(request), str(error))

    def _nothing(self, request: PlaybackRequest) -> np.ndarray:
        return np.full((len(self.courses[request.course].inputs) + 1, len(self.outputs)), np.nan)

    def _returns_by_reset(self, request: PlaybackRequest) -> bool:
        """Whether a reset leaves the FMU as its instantiation does, as far as can be seen."""
        new = self._run(request)
        with suppress(SimulationError):
            again = self._run(request)
            return np.array_equal(new.outputs, again.outputs, equal_nan=True)
        self.close()
        return False

    def _ready(self, h: float) -> LocalInstance:
        if self._instance is not None and self._resets is not False and h == self._h:
            self._instance.reset(lambda *_: None)
            return self._instance
        self.close()
        self._instance, self._h = LocalInstance("model", self._model, lambda *_: None), h
        self._instance.component.can_redo &= self._redoes
        self._access = self._instance.bind(self._puts, self._gets, self._memory, h)
        return self._instance

    def close(self) -> None:
        """Free the FMU."""
        instance, self._instance = self._instance, None
        if instance is not None:
            instance.free()

    def _run(self, request: PlaybackRequest) -> PlayedBack:
        course = self.courses[request.course]
        h, n, steps = course.h, len(self.inputs), len(course.inputs)
        instance, values = self._ready(h), self._memory.values
        instance.set_up(steps * h)
        for name, value in {**course.start, **request.values}.items():
            if name not in self.inputs:
                instance.set_value(self._model.variables[name], value)
        instance.enter_initialization()
        rows = np.ascontiguousarray(course.inputs, float)
        # An input that is calibrated keeps its value.
        for k, name in enumerate(self.inputs):
            if name in request.values:
                rows[:, k] = request.values[name]
        flat = memoryview(rows.data).cast("B").cast("d")
        outputs = self._nothing(request)
        values[:n] = flat[:n]
        self._access.put()
        instance.exit_initialization()
        self._access.get()
        outputs[0] = values[n:]
        acting = [f.acting(self.inputs, self.outputs, h) for f in request.forces]
        for k in range(steps):
            values[:n] = flat[k * n : (k + 1) * n]
            for act in acting:
                act(values, outputs, k)
            self._access.put()
            self._access.step(k * h)
            outputs[k + 1] = values[n:]
            if not np.isfinite(outputs[k + 1]).all():
                name = self.outputs[int(np.flatnonzero(~np.isfinite(outputs[k + 1]))[0])]
                self.close()  # a reset may not cure it
                return PlayedBack(outputs, f"{name} is not finite at t = {(k + 1) * h:.6g} s")
        instance.terminate()
        return PlayedBack(outputs)


_playback: Playback  # of a worker process


def _begin(make: partial[Playback], parent: int) -> None:
    global _playback
    ignore_interrupts()
    end_with_parent(parent)
    _playback = make()


def _run(request: PlaybackRequest) -> PlayedBack:
    return _playback.run(request)


class Processes:
    """An FMU in processes of its own, in which it may fail.

    Args:
        path, inputs, outputs, courses: see :class:`Playback`.
    """

    def __init__(
        self, path: Path, inputs: Sequence[str], outputs: Sequence[str], courses: Sequence[InputCourse]
    ) -> None:
        self.path, self.inputs, self.outputs, self.courses = path, inputs, outputs, courses
        self._pool: ProcessPoolExecutor | None = None

    def _begun(self) -> ProcessPoolExecutor:
        if self._pool is None:
            make = partial(Playback, self.path, self.inputs, self.outputs, self.courses)
            # An FMU does not outlive a fork, nor do the files and threads of this process.
            self._pool = ProcessPoolExecutor(
                PROCESSES, get_context("spawn"), _begin, (make, os.getpid())
            )
        return self._pool

    def run(self, requests: Sequence[PlaybackRequest]) -> list[PlayedBack]:
        """Some predictions, in their order."""
        with without_program():
            return [*self._all(requests)]

    def _all(self, requests: Sequence[PlaybackRequest]) -> Iterator[PlayedBack]:
        waiting: list[Future[PlayedBack]] = []
        with suppress(BrokenProcessPool):
            waiting = [self._begun().submit(_run, request) for request in requests]
        for k, request in enumerate(requests):
            try:
                yield waiting[k].result(LONGEST)
            except (BrokenProcessPool, futures.TimeoutError, IndexError) as error:
                # All that waited is lost with the process; each is asked again, alone.
                self.close()
                yield self._alone(request, error)
                waiting = waiting[: k + 1]
                with suppress(BrokenProcessPool):
                    waiting += [self._begun().submit(_run, r) for r in requests[k + 1 :]]

    def _alone(self, request: PlaybackRequest, error: Exception) -> PlayedBack:
        """One prediction after a process has ended; the same again is its own fault."""
        late = isinstance(error, futures.TimeoutError)
        if not late:
            try:
                return self._begun().submit(_run, request).result(LONGEST)
            except (BrokenProcessPool, futures.TimeoutError) as again:
                late = isinstance(again, futures.TimeoutError)
                self.close()
        rows = len(self.courses[request.course].inputs) + 1
        fault = f"it takes longer than {LONGEST:g} s" if late else "it ends the process that runs it"
        return PlayedBack(np.full((rows, len(self.outputs)), np.nan), fault)

    def close(self) -> None:
        """End the processes."""
        pool, self._pool = self._pool, None
        if pool is not None:
            for process in [*(pool._processes or {}).values()]:
                process.kill()
            pool.shutdown(wait=True, cancel_futures=True)

    def __enter__(self) -> "Processes":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
