"""Operations: what the project's faults do to values, for both step loops, in Python and compiled.

An operation splits a fault in two. What depends on time and chance is a function of time: what it
applies at a call, or that it does not act. The compiled loop asks for it ahead, for a block of calls,
and what is left to it is to add, set, hold, delay. The loop in Python asks at each call, or takes what
has been asked ahead.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable, Sequence
from typing import ClassVar, Protocol

import numpy as np

from .plans import Plan, TimeSpans, Within, ask_ahead


class Values(Protocol):
    """The value table: a number at each slot."""

    def __getitem__(self, slot: int, /) -> float: ...

    def __setitem__(self, slot: int, value: float, /) -> None: ...


class Operation:
    """What happens to the values at some slots each time they have been set.

    Args:
        slots: places in the value table.
        plan: what it applies, :data:`cosim.scenario.plans.Plan`. A sequence is applied at every call.

    Attributes:
        code: what it does, for cosim/compiled/loop.c.
        width: how many numbers a call takes.
        numbers: what is applied at the calls asked ahead, one after the other; or at all.
        acts: whether it acts at each of these calls; empty: at all.
        cursor: the next of these calls.
        memory, calls: values of before, and the number of calls so far, where it has a memory.
        samples: of a delay.
        sources: further slots that it reads.
    """

    code: ClassVar[int]

    def __init__(self, slots: Sequence[int], plan: Plan | Sequence[float] = ()) -> None:
        self.slots = list(slots)
        self.width = len(self.slots)
        self.plan = plan if callable(plan) else None
        self.numbers = array("d", () if callable(plan) else plan)
        self.acts = array("B")
        self.cursor = array("q", [0])
        self.memory = array("d")
        self.calls = array("q", [0])
        self.samples = 0
        self.sources: list[int] = []

    def ask_ahead(self, times: np.ndarray) -> None:
        """Plan the next calls; all that were planned before have been made.

        Args:
            times: of the calls [s].
        """
        self.cursor[0] = 0
        if self.plan is None:
            return
        acts, numbers = ask_ahead(self.plan, times, self.width)
        self.acts, self.numbers = array("B", acts.tobytes()), array("d", numbers.tobytes())

    def __call__(self, values: Values, t: float) -> None:
        """Act on the values of time t [s]."""
        if self.plan is None:
            row: Sequence[float] | None = self.numbers
        elif (call := self.cursor[0]) < len(self.acts):
            self.cursor[0] = call + 1
            width = self.width
            row = self.numbers[call * width : (call + 1) * width] if self.acts[call] else None
        else:
            row = self.plan(t)
        self.act(values, row)

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        """Change the values; ``row`` is what the plan says, None where it does not act."""
        raise NotImplementedError


class Add(Operation):
    """Adds numbers to the values."""

    code = 0

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        if row is not None:
            for slot, number in zip(self.slots, row, strict=True):
                values[slot] += number


class Replace(Operation):
    """Puts numbers in the place of the values."""

    code = 1

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        if row is not None:
            for slot, number in zip(self.slots, row, strict=True):
                values[slot] = number


class Hold(Operation):
    """Keeps the values of the last call at which it did not act."""

    code = 2

    def __init__(self, slots: Sequence[int], active: Callable[[float], bool]) -> None:
        within = Within(active, tuple) if isinstance(active, TimeSpans) else None
        super().__init__(slots, within or (lambda t: () if active(t) else None))
        self.width = 0
        self.memory = array("d", bytes(8 * len(slots)))

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        if row is not None and self.calls[0]:
            for slot, number in zip(self.slots, self.memory, strict=True):
                values[slot] = number
        else:
            for k, slot in enumerate(self.slots):
                self.memory[k] = values[slot]
            self.calls[0] = 1


class DelayOperation(Operation):
    """Gives the values of ``samples`` calls ago; until there are as many, those of the first call."""

    code = 3

    def __init__(self, slots: Sequence[int], samples: int) -> None:
        super().__init__(slots)
        self.samples = samples

    def reserve(self, calls: int) -> None:
        """Make room for the values of some more calls; a delay may be longer than the run."""
        rows = min(self.calls[0] + calls, self.samples + 1)
        missing = rows * len(self.slots) - len(self.memory)
        if missing > 0:
            self.memory.extend(array("d", bytes(8 * missing)))

    def ask_ahead(self, times: np.ndarray) -> None:
        self.reserve(len(times))
        super().ask_ahead(times)

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        self.reserve(1)
        call, length, width = self.calls[0], self.samples + 1, len(self.slots)
        first = call % length * width
        self.memory[first : first + width] = array("d", [values[slot] for slot in self.slots])
        late = (0 if call <= self.samples else (call - self.samples) % length) * width
        for k, slot in enumerate(self.slots):
            values[slot] = self.memory[late + k]
        self.calls[0] = call + 1


class WrapOperation(Operation):
    """Takes angles to (-pi, pi]."""

    code = 4

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        for slot in self.slots:
            angle = values[slot]
            values[slot] = angle + 2.0 * math.pi * ((math.pi - angle) / (2.0 * math.pi) // 1.0)


class Convert(Operation):
    """Puts factor * source + offset at each slot.

    Args:
        slots: targets.
        sources: slots of the sources.
        terms: factor and offset of each.
    """

    code = 5

    def __init__(
        self, slots: Sequence[int], sources: Sequence[int], terms: Sequence[tuple[float, float]]
    ) -> None:
        super().__init__(slots, [number for pair in terms for number in pair])
        self.sources = list(sources)

    def act(self, values: Values, row: Sequence[float] | None) -> None:
        numbers = self.numbers
        for k, (target, source) in enumerate(zip(self.slots, self.sources, strict=True)):
            values[target] = numbers[2 * k] * values[source] + numbers[2 * k + 1]


# Those that the compiled loop knows; of a class derived from one it would not know what that changes.
OPERATIONS = (Add, Replace, Hold, DelayOperation, WrapOperation, Convert)
