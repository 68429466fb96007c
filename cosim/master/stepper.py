"""The value table, and one FMU in the step loop: inputs from the table, a step, outputs to the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..conversion import SAME
from ..fmu.instance import DoubleMemory, Instance, Port
from ..scenario.faults import Effect
from ..scenario.operations import Convert, Replace
from ..system.system import Connection, Signal, System
from .changes import Changes

# Adjacent connections that are copied as one slice; chosen: for fewer, single copies are faster.
SHORTEST_SLICE = 4


class ValueTable(DoubleMemory):
    """One double for each signal, in a memory through which FMUs exchange values.

    Each FMU reads its inputs from its own part of the table and writes its outputs there, with one
    vector get and one vector set in each step. A row of the log is the table.

    Args:
        signals: all signals, by name.
        order: instances in the order of their parts.
        settable: names of the inputs that the master sets.
    """

    def __init__(self, signals: dict[str, Signal], order: Sequence[str], settable: set[str]) -> None:
        def rank(signal: Signal) -> tuple[int, int, int]:
            is_input = signal.variable.causality == "input"
            group = 0 if signal.name in settable else 1 if is_input else 2
            return order.index(signal.instance), group, int(signal.variable.type != "Real")

        # sorted() is stable: within a part the order is that of the model description.
        self.signals = sorted(signals.values(), key=rank)
        self.slots = {signal.name: k for k, signal in enumerate(self.signals)}
        super().__init__(len(self.signals))
        self.row = np.asarray(self.values)


class Stepper:
    """One FMU in the step loop.

    Attributes:
        number: position in the order of stepping, for :mod:`cosim.process.run_state`.
        exchange: ``exchange(t)`` copies the newest values, those of time t [s], to the FMU's inputs.
        read: ``read(t)`` copies its outputs to the table.
        begin: ``begin(t)`` starts a step from t that runs beside those of others; None if it cannot.
        advance: ``advance(t)`` steps from t, and reads the outputs.
        settle: ``settle(t, status, saved)`` does the rest of :attr:`advance` where another loop has
            called fmi2DoStep and stopped at what it returned; see :class:`cosim.fmu.stepping.Steps`.
        input_effects, output_effects: act on the values on their way, in this order.
        put, got: signals that the FMU gets and gives.
        copies: connections without conversion: first target, first source, how many.
        access: the calls of the FMU.
    """

    def __init__(
        self,
        system: System,
        number: int,
        instance: Instance,
        table: ValueTable,
        settable: set[str],
    ) -> None:
        self.number = number
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
        self.put = [s for s in own if s.name in settable]
        self.access = instance.bind(
            [Port(s.variable, table.slots[s.name]) for s in self.put],
            [Port(s.variable, table.slots[s.name]) for s in self.got],
            table,
            self.step_size,
        )
        self.begin = self.access.begin
        self.copies, conversions = _transfers(incoming, table)
        if conversions:
            self.input_effects.append(conversions)
        for part in system.recordings.get(instance.name, ()):
            self.input_effects.append(part.bind([table.slots[name] for name in part.names]))
        self.exchange = self._make_exchange()
        self.read = self._make_read()
        self.advance = self._make_advance()

    def read_inputs(self) -> None:
        """Take the start values of all inputs from the FMU."""
        values, slots = self._table.values, self._table.slots
        for signal in self._inputs:
            values[slots[signal.name]] = self.instance.get_value(signal.variable)
        if self._free:
            # They return to their start values, from which events change them.
            places = [slots[s.name] for s in self._free]
            self.input_effects.insert(0, Replace(places, [values[slot] for slot in places]))

    # The three functions that run every step keep what they need in their own scope, where Python finds
    # it fastest.

    def _make_exchange(self) -> Callable[[float], None]:
        values, effects, put = self._table.values, self.input_effects, self.access.put
        copies = [(target, source) for target, source, count in self.copies if count == 1]
        runs = [
            (target, target + count, source, source + count)
            for target, source, count in self.copies
            if count > 1
        ]

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
        values, effects, get = self._table.values, self.output_effects, self.access.get

        def read(t: float) -> None:
            get()
            for effect in effects:
                effect(values, t)

        return read

    def _make_advance(self) -> Callable[[float], None]:
        values, effects, step, h = (
            self._table.values,
            self.output_effects,
            self.access.step,
            self.step_size,
        )

        def advance(t: float) -> None:
            step(t)
            for effect in effects:
                effect(values, t + h)

        return advance

    def settle(self, t: float, status: int, saved: bool) -> None:
        assert self.access.direct is not None
        self.access.direct.settle(t, status, saved)
        self.access.get()
        for effect in self.output_effects:
            effect(self._table.values, t + self.step_size)


def _transfers(
    connections: Sequence[Connection], table: ValueTable
) -> tuple[list[tuple[int, int, int]], Convert | None]:
    """Connections as copies (first target, first source, how many), and those between units."""
    converted = [c for c in connections if c.conversion != SAME]
    same = (c for c in connections if c.conversion == SAME)
    plain = sorted((table.slots[c.target.name], table.slots[c.source.name]) for c in same)
    copies: list[tuple[int, int, int]] = []
    block: list[tuple[int, int]] = []

    def finish() -> None:
        if len(block) < SHORTEST_SLICE:
            copies.extend((target, source, 1) for target, source in block)
        else:
            copies.append((*block[0], len(block)))
        block.clear()

    for target, source in plain:
        if block and (target, source) != (block[-1][0] + 1, block[-1][1] + 1):
            finish()
        block.append((target, source))
    finish()
    if not converted:
        return copies, None
    return copies, Convert(
        [table.slots[c.target.name] for c in converted],
        [table.slots[c.source.name] for c in converted],
        [(c.conversion.factor, c.conversion.offset) for c in converted],
    )
