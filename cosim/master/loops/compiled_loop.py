"""The step loop in C: blocks of base steps with the values of the loop in Python, to the bit.

A block ends where Python has to act: at an event, when no more rows fit, when the log is due, and at a
call of an FMU that returns more than a warning. There Python does what remains of the step.
"""

from __future__ import annotations

import ctypes
from array import array
from bisect import bisect_left
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from ...compiled.library import NoLibraryError, asks_for_plain_loop, library
from ...process.run_state import INSTANCE, STATE
from ...results.pending_rows import PendingRows
from ...scenario.faults import Effect
from ...scenario.operations import OPERATIONS, Operation
from ...scenario.plans import TIME_TOLERANCE
from ..algorithm import Master
from ..changes import Changes
from ..stepper import Stepper
from .layout import STRUCTURES, FmuLayout, LoopLayout, address, lay_out_fmu, operations_layout
from .rounding import round_to_places

# Base steps whose times and chances are planned at once; chosen: the cost of a plan is small beside
# that of the steps, and the wait for it, some ms, not noticed.
HORIZON = 8192
# Why a block ended, as loop.c has it.
AT_END, FULL, DUE, PUT, STEP, GET = range(6)


class PlainLoopError(Exception):
    """The loop in Python has to run; the message says why."""


def compiled_run(
    master: Master, rows: PendingRows, native: bool | str, realtime: bool, patience: float
) -> Iterator[tuple[float, bool]]:
    """Steps to the end in C, with their rows.

    Args:
        master: initialised.
        rows: takes the rows.
        native: of the scenario: False asks for the loop in Python.
        realtime: whether the run keeps to the wall clock.
        patience: wall time after which the caller wants to act [s].

    Returns:
        As :meth:`Master.steps`: time [s] after some base steps, and whether there is room for no more
        rows.

    Raises:
        PlainLoopError: this run cannot.
    """
    if asks_for_plain_loop():
        raise PlainLoopError("CYBERSHIP_LOOP is plain")
    if native is False:
        raise PlainLoopError('"native" is false')
    if realtime:
        raise PlainLoopError("it runs in real time")
    for stepper in master.steppers:
        if stepper.access.direct is None:
            raise PlainLoopError(f"{stepper.instance.name} has a process of its own")
        if why := function_among(stepper):
            raise PlainLoopError(why)
    try:
        functions = library(with_zig=native is True)
    except NoLibraryError as error:
        raise PlainLoopError(str(error)) from None
    if any(functions.layout(k) != ctypes.sizeof(found) for k, found in enumerate(STRUCTURES)):
        raise PlainLoopError("the compiler's memory layout differs from that in Python")
    return _CompiledLoop(master, rows, functions, patience).run()


def function_among(stepper: Stepper) -> str:
    """Which fault of an FMU is no operation, in a sentence; empty if none is."""
    known = (*OPERATIONS, Changes)
    if all(type(effect) in known for effect in (*stepper.input_effects, *stepper.output_effects)):
        return ""
    return (
        f"a fault of {stepper.instance.name} is a Python function, not an operation "
        "(cosim.scenario.operations)"
    )


def ask_stepper_ahead(
    stepper: Stepper, times: np.ndarray, first: int, steps: range, is_jacobi: bool
) -> None:
    """Plan the calls of the operations on the inputs and outputs of an FMU.

    Args:
        stepper: the FMU.
        times: of base steps from ``first`` on [s].
        first: at most the last step of the FMU before ``steps``.
        steps: base steps; the calls are those behind the first, up to the end of the last.
        is_jacobi: whether inputs are those of the base step's beginning, else those of its end.
    """
    every = stepper.every
    due = np.arange((steps.start // every + 1) * every, steps.stop + 1, every)
    if on_inputs := operations_of(stepper.input_effects):
        inputs = times[due - first - is_jacobi]
        for operation in on_inputs:
            operation.ask_ahead(inputs)
    if on_outputs := operations_of(stepper.output_effects):
        outputs = times[due - every - first] + stepper.step_size
        for operation in on_outputs:
            operation.ask_ahead(outputs)


def operations_of(effects: list[Effect]) -> list[Operation]:
    """The operations among effects, those of events included."""
    found: list[Operation] = []
    for effect in effects:
        if isinstance(effect, Changes):
            found += effect.operations
        elif isinstance(effect, Operation):
            found.append(effect)
    return found


class _CompiledLoop:
    def __init__(
        self, master: Master, rows: PendingRows, functions: ctypes.CDLL, patience: float
    ) -> None:
        self._master, self._rows = master, rows
        self._steppers = master.steppers
        self._run_block = self._block_function(functions)
        self._kept: list[Any] = []
        self._kept_operations: list[Any] = []
        self._fmus = (FmuLayout * len(self._steppers))()
        for place, stepper in zip(self._fmus, self._steppers, strict=True):
            lay_out_fmu(place, stepper, self._kept)
        self._horizon = 0  # base steps that are planned
        self._times = array("d")
        called = np.frombuffer(STATE.numbers, dtype=np.int32)
        self._kept.append(called)
        table = master.table
        self._loop = LoopLayout(
            table=table.address,
            width=len(table.signals),
            fmus=len(self._steppers),
            jacobi=master.is_jacobi,
            fmu=self._fmus,
            instants=rows.instants.ctypes.data,
            rows=rows.taken.ctypes.data,
            finite=rows.finite.ctypes.data,
            taken=rows.count.ctypes.data,
            called=called.ctypes.data + 4 * INSTANCE,
            room=rows.room,
            patience=patience,
        )

    def _block_function(self, functions: ctypes.CDLL) -> Callable[..., int]:
        """The block, with Python's lock held if all FMUs are Python; others may have threads."""
        direct = [stepper.access.direct for stepper in self._steppers]
        holds = all(calls is not None and calls.is_python for calls in direct)
        kind = ctypes.PYFUNCTYPE if holds else ctypes.CFUNCTYPE
        place = ctypes.cast(functions.run_block, ctypes.c_void_p).value
        assert place is not None
        return kind(ctypes.c_int, ctypes.c_void_p, ctypes.c_int64)(place)

    def run(self) -> Iterator[tuple[float, bool]]:
        master, loop = self._master, self._loop
        steps = master.system.steps
        loop_address = ctypes.addressof(loop)
        while loop.step < steps:
            t = master.time(loop.step)
            master.begin_events(t)
            if loop.step == self._horizon:
                self._plan(min(steps, self._horizon + HORIZON))
            self._lay_out_operations()
            last = self._next_event()
            while loop.step < last:
                why = self._run_block(loop_address, last)
                is_full = why == FULL
                if why in (PUT, STEP, GET):
                    is_full = self._finish_step(why)
                yield self._time(loop.step), is_full

    def _time(self, step: int) -> float:
        return self._times[step - self._loop.first]

    def _plan(self, horizon: int) -> None:
        """Plan what operations do until base step ``horizon``."""
        master, loop = self._master, self._loop
        done = self._horizon
        first = max(0, done - max(stepper.every for stepper in self._steppers))
        times = round_to_places(np.arange(first, horizon + 1) * master.system.scenario.step)
        self._times = array("d", times.tobytes())
        loop.first, loop.times = first, address(self._times)
        for stepper in self._steppers:
            ask_stepper_ahead(stepper, times, first, range(done, horizon), master.is_jacobi)
        self._horizon = horizon

    def _lay_out_operations(self) -> None:
        kept: list[Any] = []
        for place, stepper in zip(self._fmus, self._steppers, strict=True):
            inputs = operations_layout(operations_of(stepper.input_effects), kept)
            outputs = operations_layout(operations_of(stepper.output_effects), kept)
            place.inputs, place.on_inputs = len(inputs), inputs
            place.outputs, place.on_outputs = len(outputs), outputs
        self._kept_operations = kept

    def _next_event(self) -> int:
        """The base step after which the next event begins; at most the last planned."""
        event = self._master.next_event
        if event is None:
            return self._horizon
        done = self._loop.step - self._loop.first
        # As Master.begin_events tells it.
        later = bisect_left(self._times, True, lo=done, key=lambda t: event.time <= t + TIME_TOLERANCE)
        return min(self._horizon, self._loop.first + later)

    def _finish_step(self, why: int) -> bool:
        """Do in Python what remains of a step whose block ended at a call of an FMU."""
        loop = self._loop
        stepper = self._steppers[loop.index]
        if why != STEP:
            self._refuse(stepper, "setting its inputs" if why == PUT else "getting its outputs")
        step = loop.step + 1
        self._master.finish_step(step, stepper, loop.status, bool(loop.saved))
        loop.step = step
        return self._rows.take(self._time(step))

    def _refuse(self, stepper: Stepper, what: str) -> None:
        """Tell why an FMU's values could not be set or got."""
        calls, status = stepper.access.direct, self._loop.status
        assert calls is not None
        if status < 0:
            stepper.access.put()  # tells which value is no 32-bit number
        calls.check(what, status)
