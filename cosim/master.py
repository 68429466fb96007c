"""The master algorithm: who steps when, and how values travel in between.

All values stand in one table of doubles. Each FMU reads its inputs from its own stretch of the table
and writes its outputs there, so a step costs one vector get and one vector set for each FMU. A row of
the log is the table.
"""

from __future__ import annotations

import ctypes
import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from .errors import SimulationError
from .faults import EARLY, Effect
from .fmu import DISCARD, Instance, Variable
from .scenario import Event
from .system import INT_LIMIT, Connection, Signal, System

_SETTERS = {
    "Integer": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Enumeration": ("fmi2SetInteger", "fmi2GetInteger", ctypes.c_int),
    "Boolean": ("fmi2SetBoolean", "fmi2GetBoolean", ctypes.c_int),
}
_ACCESS = (ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
_STEP = (ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int)


@dataclass
class Message:
    """What an FMU told through its logger."""

    instance: str
    status: int
    text: str


class Messages:
    """Collects the first warnings and errors that FMUs log."""

    KEEP = 200

    def __init__(self, show: Callable[[str], None]) -> None:
        self.count = 0
        self.kept: list[Message] = []
        self._show = show

    def add(self, instance: str, status: int, text: str) -> None:
        if status == 0:  # mere information
            return
        self.count += 1
        if self.count <= self.KEEP:
            self.kept.append(Message(instance, status, text))
            self._show(f"{instance}: {text}")
        elif self.count == self.KEEP + 1:
            self._show(f"FMUs logged more than {self.KEEP} messages; the rest is not shown")


class Table:
    """One double for each signal, in a memory that FMUs read and write.

    Args:
        signals: all signals, by name.
        order: instances in the order of their stretches.
        settable: names of the inputs that the master sets.
    """

    def __init__(self, signals: dict[str, Signal], order: Sequence[str], settable: set[str]) -> None:
        def rank(signal: Signal) -> tuple[int, int, int]:
            is_input = signal.variable.causality == "input"
            group = 0 if signal.name in settable else 1 if is_input else 2
            return order.index(signal.instance), group, int(signal.variable.type != "Real")

        # sorted() is stable: within a stretch the order is that of the model description.
        self.signals = sorted(signals.values(), key=rank)
        self.slots = {signal.name: k for k, signal in enumerate(self.signals)}
        self._memory = (ctypes.c_double * max(1, len(self.signals)))()
        self.address = ctypes.addressof(self._memory)
        self.values = memoryview(self._memory).cast("B").cast("d")
        self.row = np.asarray(self.values)


class Access:
    """Get or set of some variables of one FMU, laid out once.

    Reals pass directly between the FMU and the table; other types through a buffer of their own.
    """

    def __init__(
        self, instance: Instance, signals: Sequence[Signal], table: Table, setting: bool
    ) -> None:
        self._instance = instance
        self._setting = setting
        reals = [s for s in signals if s.variable.type == "Real"]
        self._what = "fmi2SetReal" if setting else "fmi2GetReal"
        self.real: Callable[..., int] | None = None
        if reals:
            self._references = (ctypes.c_uint * len(reals))(*[s.variable.reference for s in reals])
            self.real = instance.function(self._what, *_ACCESS)
            self.arguments = (
                instance.component,
                ctypes.addressof(self._references),
                len(reals),
                table.address + 8 * table.slots[reals[0].name],
            )
        self._others = [
            _Buffered(instance, kind, [s for s in signals if s.variable.type == kind], table, setting)
            for kind in _SETTERS
            if any(s.variable.type == kind for s in signals)
        ]

    def __call__(self) -> None:
        if self.real is not None:
            self._instance.check(self._what, self.real(*self.arguments))
        for other in self._others:
            other()

    def __bool__(self) -> bool:
        return self.real is not None or bool(self._others)

    @property
    def only_reals(self) -> bool:
        return self.real is not None and not self._others


class _Buffered:
    """Access to variables that are not Real: whole numbers, converted on the way."""

    def __init__(
        self, instance: Instance, kind: str, signals: Sequence[Signal], table: Table, setting: bool
    ) -> None:
        setter, getter, c_type = _SETTERS[kind]
        self._instance = instance
        self._what = setter if setting else getter
        self._setting = setting
        self._references = (ctypes.c_uint * len(signals))(*[s.variable.reference for s in signals])
        self._buffer = (c_type * len(signals))()
        self._slots = [table.slots[s.name] for s in signals]
        self._values = table.values
        self._function = instance.function(self._what, *_ACCESS)
        self._arguments = (
            instance.component,
            ctypes.addressof(self._references),
            len(signals),
            ctypes.addressof(self._buffer),
        )

    def __call__(self) -> None:
        if self._setting:
            for k, slot in enumerate(self._slots):
                value = self._values[slot]
                if not abs(value) < INT_LIMIT:
                    raise SimulationError(f"{self._instance.name}: {value} is not a 32-bit number")
                self._buffer[k] = round(value)
        self._instance.check(self._what, self._function(*self._arguments))
        if not self._setting:
            for k, slot in enumerate(self._slots):
                self._values[slot] = float(self._buffer[k])


class Changes:
    """Events that act on the signals of one side of one instance: override, bias, hold."""

    def __init__(self, values: memoryview[float]) -> None:
        self._values = values
        self._fixed: dict[int, float] = {}
        self._added: dict[int, float] = {}

    def apply(self) -> None:
        for slot, value in self._added.items():
            self._values[slot] += value
        for slot, value in self._fixed.items():
            self._values[slot] = value

    def begin(self, slot: int, event: Event) -> None:
        if event.action == "reset":
            self._fixed.pop(slot, None)
            self._added.pop(slot, None)
        elif event.action == "bias":
            self._added[slot] = float(event.value or 0.0)
        else:
            held = self._values[slot] if event.action == "hold" else float(event.value or 0.0)
            self._fixed[slot] = held

    def __bool__(self) -> bool:
        return bool(self._fixed or self._added)


class Stepper:
    """One FMU in the loop: takes its inputs from the table, steps, puts its outputs there."""

    def __init__(
        self,
        system: System,
        instance: Instance,
        table: Table,
        settable: set[str],
    ) -> None:
        self.instance = instance
        self.every = system.every[instance.name]
        self.step_size = self.every * system.scenario.step
        self._table = table
        own = [s for s in table.signals if s.instance == instance.name]
        self.set = Access(instance, [s for s in own if s.name in settable], table, setting=True)
        self._inputs = [s for s in own if s.variable.causality == "input"]
        self.got = [s for s in own if s.variable.causality != "input"]
        self.get = Access(instance, self.got, table, setting=False)
        self._do_step = instance.function("fmi2DoStep", *_STEP)
        incoming = [c for c in system.connections if c.target.instance == instance.name]
        self._copies, self._runs, self._conversions = _transfers(incoming, table)
        # Inputs without a source that events may change, and the values to return to.
        sourced = {c.target.name for c in incoming}
        free = [s for s in own if s.name in settable and s.name not in sourced]
        self._free: list[tuple[int, Signal]] = [(table.slots[s.name], s) for s in free]
        self._constants: list[tuple[int, float]] = []
        self._special = bool(self._free or self._conversions)
        self.input_faults: list[Effect] = []
        self.output_faults: list[Effect] = []
        self.input_changes = Changes(table.values)
        self.output_changes = Changes(table.values)

    def read_inputs(self) -> None:
        """Take the start values of all inputs from the FMU."""
        for signal in self._inputs:
            self._table.values[self._table.slots[signal.name]] = self.instance.get_value(signal.variable)
        self._constants = [(slot, self._table.values[slot]) for slot, _ in self._free]

    def exchange(self, t: float, faulty: bool = True) -> None:
        """Bring the newest values to the FMU's inputs; t is the time that they belong to."""
        values = self._table.values
        for target, source in self._copies:
            values[target] = values[source]
        for target, target_end, source, source_end in self._runs:
            values[target:target_end] = values[source:source_end]
        if self._special or self.input_faults or self.input_changes:
            self._exchange_special(t, faulty)
        access = self.set
        if access.only_reals:
            status = access.real(*access.arguments)  # pyright: ignore[reportOptionalCall]
            if status >= DISCARD:
                self.instance.check("fmi2SetReal", status)
        elif access:
            access()

    def _exchange_special(self, t: float, faulty: bool) -> None:
        """What few FMUs need: constants, conversions, faults, events."""
        values = self._table.values
        for target, value in self._constants:
            values[target] = value
        for target, source, factor, offset in self._conversions:
            values[target] = factor * values[source] + offset
        if faulty:
            for fault in self.input_faults:
                fault(values, t)
        self.input_changes.apply()

    def advance(self, t: float) -> None:
        """Step from t and bring the outputs to the table."""
        status = self._do_step(self.instance.component, t, self.step_size, 1)
        if status >= DISCARD:
            self.instance.check(f"the step from t = {t} s", status)
        self.read(t + self.step_size)

    def read(self, t: float, faulty: bool = True) -> None:
        """Bring the FMU's outputs to the table."""
        access = self.get
        if access.only_reals:
            status = access.real(*access.arguments)  # pyright: ignore[reportOptionalCall]
            if status >= DISCARD:
                self.instance.check("fmi2GetReal", status)
        elif access:
            access()
        if faulty:
            for fault in self.output_faults:
                fault(self._table.values, t)
        if self.output_changes:
            self.output_changes.apply()


def _transfers(
    connections: Sequence[Connection], table: Table
) -> tuple[list[tuple[int, int]], list[tuple[int, int, int, int]], list[tuple[int, int, float, float]]]:
    """Connections as single copies, copies of whole stretches, and conversions."""
    conversions: list[tuple[int, int, float, float]] = []
    plain: list[tuple[int, int]] = []
    for c in connections:
        pair = (table.slots[c.target.name], table.slots[c.source.name])
        if (c.conversion.factor, c.conversion.offset) == (1.0, 0.0):
            plain.append(pair)
        else:
            conversions.append((*pair, c.conversion.factor, c.conversion.offset))
    copies: list[tuple[int, int]] = []
    runs: list[tuple[int, int, int, int]] = []
    stretch: list[tuple[int, int]] = []

    def finish() -> None:
        if len(stretch) < 4:
            copies.extend(stretch)
        else:
            (target, source), n = stretch[0], len(stretch)
            runs.append((target, target + n, source, source + n))
        stretch.clear()

    for target, source in sorted(plain):
        if stretch and (target, source) != (stretch[-1][0] + 1, stretch[-1][1] + 1):
            finish()
        stretch.append((target, source))
    finish()
    return copies, runs, conversions


class Master:
    """A system with its FMUs instantiated and initialised: the table holds the values at t = 0.

    Args:
        system: checked system.
        show: receives lines for the user while it runs.
    """

    def __init__(self, system: System, show: Callable[[str], None]) -> None:
        self.system = system
        self.messages = Messages(show)
        self._instances: dict[str, Instance] = {}
        self._initialised = False
        changeable = {f"{e.model}.{e.variable}" for e in system.scenario.events}
        settable = {c.target.name for c in system.connections}
        settable |= {
            n for n, s in system.signals.items() if n in changeable and s.variable.causality == "input"
        }
        self.table = Table(system.signals, system.order, settable)
        try:
            for name in system.order:
                self._instances[name] = Instance(name, system.models[name], self.messages.add)
            self._steppers = [
                Stepper(system, self._instances[name], self.table, settable) for name in system.order
            ]
            self._bind_faults()
            self._originals: dict[str, float] = {}
            self._events = sorted(system.scenario.events, key=lambda e: e.time)
            self._initialise()
        except BaseException:
            self.close()
            raise

    def _stepper(self, name: str) -> Stepper:
        return self._steppers[self.system.order.index(name)]

    def _bind_faults(self) -> None:
        """Attach each fault to the inputs or outputs it acts on, with random numbers of its own."""
        declared = self.system.scenario.faults
        seeds = np.random.SeedSequence(self.system.scenario.seed).spawn(len(declared))
        for fault, seed in sorted(zip(declared, seeds, strict=True), key=lambda pair: pair[0].stage):
            signals = [self.system.signals[name] for name in fault.signals]
            stepper = self._stepper(signals[0].instance)
            slots = [self.table.slots[s.name] for s in signals]
            effect = fault.bind(slots, stepper.step_size, np.random.default_rng(seed))
            is_input = signals[0].variable.causality == "input"
            (stepper.input_faults if is_input else stepper.output_faults).append(effect)

    def _initialise(self) -> None:
        system = self.system
        for stepper in self._steppers:
            instance = stepper.instance
            instance.set_up(system.scenario.stop)
            for variable, value in system.parameters[instance.name]:
                instance.set_value(variable, value)
            instance.enter_initialization()
            stepper.read_inputs()
        # Values settle in as many sweeps as there are FMUs in a chain; only then may faults act.
        for _ in self._steppers:
            before = self.table.row.copy()
            for stepper in self._steppers:
                stepper.exchange(0.0, faulty=False)
                stepper.read(0.0, faulty=False)
            if np.array_equal(before, self.table.row, equal_nan=True):
                break
        self._begin_events(0.0)
        for stepper in self._steppers:
            stepper.exchange(0.0)
            stepper.read(0.0)
        for stepper in self._steppers:
            stepper.instance.exit_initialization()
            stepper.read(0.0)
        self._initialised = True

    def _begin_events(self, t: float) -> None:
        while self._events and self._events[0].time <= t + EARLY:
            event = self._events.pop(0)
            signal = self.system.find(f"{event.model}.{event.variable}", "events")
            stepper = self._stepper(signal.instance)
            if signal.variable.causality == "input":
                stepper.input_changes.begin(self.table.slots[signal.name], event)
            elif signal.variable.causality == "output":
                slot = self.table.slots[signal.name]
                stepper.output_changes.begin(slot, event)
            else:
                self._change_parameter(stepper.instance, signal.variable, event)

    def _change_parameter(self, instance: Instance, variable: Variable, event: Event) -> None:
        name = f"{instance.name}.{variable.name}"
        original = self._originals.setdefault(name, instance.get_value(variable))
        if event.action == "reset":
            value = original
        elif event.action == "bias":
            value = original + float(event.value or 0.0)
        else:
            value = float(event.value or 0.0)
        whole_number = variable.type in ("Integer", "Enumeration")
        instance.set_value(variable, round(value) if whole_number else value)

    def time(self, k: int) -> float:
        """Time of base step k [s]: counted, never accumulated."""
        return round(k * self.system.scenario.step, 12)

    def run(self) -> Iterator[int]:
        """Step to the end; yields the number of base steps done, after each.

        Raises:
            SimulationError: an FMU returned an error, or an output is not finite.
        """
        one_by_one = self.system.scenario.algorithm == "gauss_seidel"
        steppers = due = self._steppers
        multirate = any(s.every > 1 for s in steppers)
        time = self.time
        events = self._events
        t = 0.0
        for k in range(1, self.system.steps + 1):
            if events and events[0].time <= t + EARLY:
                self._begin_events(t)
            t_next = time(k)
            if multirate:
                # An FMU steps when its own time is full, with inputs of the end of its step.
                due = [s for s in steppers if k % s.every == 0]
            if one_by_one:
                for stepper in due:
                    stepper.exchange(t_next)
                    stepper.advance(t if stepper.every == 1 else time(k - stepper.every))
            else:
                for stepper in due:
                    stepper.exchange(t)
                for stepper in due:
                    stepper.advance(t if stepper.every == 1 else time(k - stepper.every))
            t = t_next
            yield k

    @property
    def outputs(self) -> list[str]:
        """Names of the signals that come from FMUs: values that must stay finite."""
        return [s.name for stepper in self._steppers for s in stepper.got if s.variable.type == "Real"]

    def close(self) -> None:
        """Terminate and free what was instantiated."""
        for instance in self._instances.values():
            if self._initialised:
                try:
                    instance.terminate()
                except SimulationError as error:
                    self.messages.add(instance.name, 1, str(error))
            instance.free()
        self._instances.clear()


@contextmanager
def quiet_collector() -> Iterator[None]:
    """What exists now is not looked through again by the garbage collector while stepping."""
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
