"""The master algorithm: who steps when, and how values travel in between.

All values stand in one table of doubles. Each FMU reads its inputs from its own stretch of the table
and writes its outputs there, so a step costs one vector get and one vector set for each FMU. A row of
the log is the table.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np

from .access import Memory, Port
from .errors import SimulationError
from .faults import EARLY, Effect, Values
from .fmu import Instance, Variable
from .isolation import TIMEOUT, IsolatedInstance
from .scenario import Event
from .system import System
from .wiring import Connection, Signal


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


# What the master drives; where an instance runs makes no difference to it.
AnyInstance = Instance | IsolatedInstance


class Table(Memory):
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
        super().__init__(len(self.signals))
        self.row = np.asarray(self.values)


class Changes:
    """Events that act on the signals of one side of one instance: override, bias, hold.

    Args:
        values: the table.
        effects: what acts on these signals; the changes join it, as the last, when the first one begins.
    """

    def __init__(self, values: memoryview[float], effects: list[Effect]) -> None:
        self._values = values
        self._effects = effects
        self._fixed: dict[int, float] = {}
        self._added: dict[int, float] = {}

    def _apply(self, values: Values, t: float) -> None:
        for slot, value in self._added.items():
            values[slot] += value
        for slot, value in self._fixed.items():
            values[slot] = value

    def begin(self, slot: int, event: Event) -> None:
        if self._apply not in self._effects:
            self._effects.append(self._apply)
        if event.action == "reset":
            self._fixed.pop(slot, None)
            self._added.pop(slot, None)
        elif event.action == "bias":
            self._added[slot] = float(event.value or 0.0)
        else:
            held = self._values[slot] if event.action == "hold" else float(event.value or 0.0)
            self._fixed[slot] = held


class Stepper:
    """One FMU in the loop: takes its inputs from the table, steps, puts its outputs there.

    Attributes:
        exchange: ``exchange(t)`` brings the newest values, which belong to time t, to the FMU's inputs.
        read: ``read(t)`` brings its outputs to the table.
        begin: ``begin(t)`` lets the step from t begin beside those of others, None if it cannot.
        advance: ``advance(t)`` steps from t, and reads.
        input_effects, output_effects: act on the values on their way, in this order.
    """

    def __init__(self, system: System, instance: AnyInstance, table: Table, settable: set[str]) -> None:
        self.instance = instance
        self.every = system.every[instance.name]
        self.step_size = self.every * system.scenario.step
        self.input_effects: list[Effect] = []
        self.output_effects: list[Effect] = []
        self.input_changes = Changes(table.values, self.input_effects)
        self.output_changes = Changes(table.values, self.output_effects)
        own = [s for s in table.signals if s.instance == instance.name]
        incoming = [c for c in system.connections if c.target.instance == instance.name]
        sourced = {c.target.name for c in incoming}
        self.got = [s for s in own if s.variable.causality != "input"]
        self._table = table
        self._inputs = [s for s in own if s.variable.causality == "input"]
        # Inputs without a source that events may change.
        self._free = [s for s in own if s.name in settable and s.name not in sourced]
        self._access = instance.bind(
            [Port(s.variable, table.slots[s.name]) for s in own if s.name in settable],
            [Port(s.variable, table.slots[s.name]) for s in self.got],
            table,
            self.step_size,
        )
        self.begin = self._access.begin
        self.exchange = self._make_exchange(incoming)
        self.read = self._make_read()
        self.advance = self._make_advance()

    def read_inputs(self) -> None:
        """Take the start values of all inputs from the FMU."""
        values, slots = self._table.values, self._table.slots
        for signal in self._inputs:
            values[slots[signal.name]] = self.instance.get_value(signal.variable)
        if self._free:
            constants = [(slots[s.name], values[slots[s.name]]) for s in self._free]
            self.input_effects.insert(0, partial(_restore, constants))

    # The three functions that run every step keep what they need in their own scope, where Python finds
    # it fastest.

    def _make_exchange(self, incoming: Sequence[Connection]) -> Callable[[float], None]:
        values, effects, put = self._table.values, self.input_effects, self._access.put
        copies, runs, conversions = _transfers(incoming, self._table)
        if conversions:
            effects.append(partial(_convert, conversions))

        def exchange(t: float) -> None:
            for target, source in copies:
                values[target] = values[source]
            for target, target_end, source, source_end in runs:
                values[target:target_end] = values[source:source_end]
            for effect in effects:
                effect(values, t)
            put()

        return exchange

    def _make_read(self) -> Callable[[float], None]:
        values, effects, get = self._table.values, self.output_effects, self._access.get

        def read(t: float) -> None:
            get()
            for effect in effects:
                effect(values, t)

        return read

    def _make_advance(self) -> Callable[[float], None]:
        values, effects, step, h = (
            self._table.values,
            self.output_effects,
            self._access.step,
            self.step_size,
        )

        def advance(t: float) -> None:
            step(t)
            for effect in effects:
                effect(values, t + h)

        return advance


def _restore(constants: Sequence[tuple[int, float]], values: Values, t: float) -> None:
    """Inputs without a source return to their start values, from which events change them."""
    for target, value in constants:
        values[target] = value


def _convert(conversions: Sequence[tuple[int, int, float, float]], values: Values, t: float) -> None:
    """Connections between different units."""
    for target, source, factor, offset in conversions:
        values[target] = factor * values[source] + offset


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
        self._instances: dict[str, AnyInstance] = {}
        self._initialised = False
        changeable = {f"{e.model}.{e.variable}" for e in system.scenario.events}
        settable = {c.target.name for c in system.connections}
        settable |= {
            n for n, s in system.signals.items() if n in changeable and s.variable.causality == "input"
        }
        self.table = Table(system.signals, system.order, settable)
        try:
            for name in system.order:
                self._instances[name] = self._instantiate(name)
            self._steppers = [
                Stepper(system, self._instances[name], self.table, settable) for name in system.order
            ]
            self._originals: dict[str, float] = {}
            self._events = sorted(system.scenario.events, key=lambda e: e.time)
            self._initialise()
        except BaseException:
            self.close()
            raise

    def _instantiate(self, name: str) -> AnyInstance:
        model, entry = self.system.models[name], self.system.scenario.fmus[name]
        if entry.isolate:
            return IsolatedInstance(name, model, self.messages.add, entry.timeout or TIMEOUT)
        return Instance(name, model, self.messages.add)

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
            (stepper.input_effects if is_input else stepper.output_effects).append(effect)

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
                stepper.exchange(0.0)
                stepper.read(0.0)
            if np.array_equal(before, self.table.row, equal_nan=True):
                break
        self._bind_faults()
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

    def _change_parameter(self, instance: AnyInstance, variable: Variable, event: Event) -> None:
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

    def run(self) -> Iterator[float]:
        """Step to the end; yields the time [s] after each base step.

        Raises:
            SimulationError: an FMU returned an error, or an output is not finite.
        """
        steppers, advance_all = self._steppers, self._one_after_the_other
        if self.system.scenario.algorithm == "jacobi":
            # Those that step beside the others are begun first and awaited last.
            steppers = sorted(steppers, key=lambda s: s.begin is not None)
            advance_all = self._all_at_once
        due = steppers
        multirate = any(s.every > 1 for s in steppers)
        events = self._events
        t = 0.0
        for k in range(1, self.system.steps + 1):
            if events and events[0].time <= t + EARLY:
                self._begin_events(t)
            t_next = self.time(k)
            if multirate:
                # An FMU steps when its own time is full, with inputs of the end of its step.
                due = [s for s in steppers if k % s.every == 0]
            advance_all(due, k, t, t_next)
            t = t_next
            yield t

    def _one_after_the_other(self, due: Sequence[Stepper], k: int, t: float, t_next: float) -> None:
        for stepper in due:
            stepper.exchange(t_next)
            stepper.advance(t if stepper.every == 1 else self.time(k - stepper.every))

    def _all_at_once(self, due: Sequence[Stepper], k: int, t: float, t_next: float) -> None:
        for stepper in due:
            stepper.exchange(t)
        for stepper in due:
            if stepper.begin is not None:
                stepper.begin(t if stepper.every == 1 else self.time(k - stepper.every))
        for stepper in due:
            stepper.advance(t if stepper.every == 1 else self.time(k - stepper.every))

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
    """No garbage collection while stepping, but where the caller asks for it.

    What exists now is not looked through again, so that asking is cheap.
    """
    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_enabled:
            gc.enable()
