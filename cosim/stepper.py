"""One FMU in the loop, and the table through which it exchanges values with the others.

All values stand in one table of doubles. Each FMU reads its inputs from its own stretch of the table
and writes its outputs there, so a step costs one vector get and one vector set for each FMU. A row of
the log is the table.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np

from .access import Memory, Port
from .faults import Effect, Values
from .instance import Instance
from .isolation import IsolatedInstance
from .scenario import Event
from .system import System
from .wiring import Connection, Signal

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
