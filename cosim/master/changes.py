"""Events that act on signals: override, bias, hold."""

from __future__ import annotations

from ..scenario.faults import Effect, Values
from ..scenario.operations import Add, Operation, Replace
from ..scenario.schema import Event


class Changes:
    """The events that act on the inputs, or on the outputs, of one instance.

    Args:
        values: the table.
        effects: act on these signals in this order; the changes are appended when the first one begins.

    Attributes:
        operations: what they do until the next event.
    """

    def __init__(self, values: memoryview[float], effects: list[Effect]) -> None:
        self._values = values
        self._effects = effects
        self._fixed: dict[int, float] = {}
        self._added: dict[int, float] = {}
        self.operations: list[Operation] = []

    def __call__(self, values: Values, t: float) -> None:
        """Act on the values of time t [s]."""
        for operation in self.operations:
            operation(values, t)

    def begin(self, slot: int, event: Event) -> None:
        """An event begins."""
        if self not in self._effects:
            self._effects.append(self)
        if event.action == "reset":
            self._fixed.pop(slot, None)
            self._added.pop(slot, None)
        elif event.action == "bias":
            self._added[slot] = float(event.value or 0.0)
        else:
            held = self._values[slot] if event.action == "hold" else float(event.value or 0.0)
            self._fixed[slot] = held
        self.operations = [
            Add([*self._added], [*self._added.values()]),
            Replace([*self._fixed], [*self._fixed.values()]),
        ]
