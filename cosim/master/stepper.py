"""One FMU in the step loop: its inputs from the value table, its step, its outputs to the table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from ..fmu.instance import Instance
from ..fmu.memory import Port
from ..scenario.faults import Effect, Values
from ..system.recordings import Recorded
from ..system.system import Connection, System
from .changes import Changes
from .value_table import ValueTable

# Adjacent connections that are copied as one slice; chosen: for fewer, single copies are faster.
SHORTEST_SLICE = 4


class Stepper:
    """One FMU in the step loop.

    Attributes:
        number: position in the order of stepping, for :mod:`cosim.process.run_state`.
        exchange: ``exchange(t)`` copies the newest values, those of time t [s], to the FMU's inputs.
        read: ``read(t)`` copies its outputs to the table.
        begin: ``begin(t)`` starts a step from t that runs beside those of others; None if it cannot.
        advance: ``advance(t)`` steps from t, and reads the outputs.
        input_effects, output_effects: act on the values on their way, in this order.
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
        self._access = instance.bind(
            [Port(s.variable, table.slots[s.name]) for s in own if s.name in settable],
            [Port(s.variable, table.slots[s.name]) for s in self.got],
            table,
            self.step_size,
        )
        self.begin = self._access.begin
        self.exchange = self._make_exchange(incoming, system.recordings.get(instance.name, ()))
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

    def _make_exchange(
        self, incoming: Sequence[Connection], recordings: Sequence[Recorded]
    ) -> Callable[[float], None]:
        values, effects, put = self._table.values, self.input_effects, self._access.put
        copies, runs, conversions = _transfers(incoming, self._table)
        if conversions:
            effects.append(partial(_convert, conversions))
        slots = self._table.slots
        for part in recordings:
            effects.append(part.bind([slots[name] for name in part.names]))

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
    connections: Sequence[Connection], table: ValueTable
) -> tuple[list[tuple[int, int]], list[tuple[int, int, int, int]], list[tuple[int, int, float, float]]]:
    """Connections as single copies, copies of slices, and conversions."""
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
    block: list[tuple[int, int]] = []

    def finish() -> None:
        if len(block) < SHORTEST_SLICE:
            copies.extend(block)
        else:
            (target, source), n = block[0], len(block)
            runs.append((target, target + n, source, source + n))
        block.clear()

    for target, source in sorted(plain):
        if block and (target, source) != (block[-1][0] + 1, block[-1][1] + 1):
            finish()
        block.append((target, source))
    finish()
    return copies, runs, conversions
