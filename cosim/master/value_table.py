"""The value table: one double for each signal, through which FMUs exchange values.

Each FMU reads its inputs from its own part of the table and writes its outputs there, with one vector
get and one vector set in each step. A row of the log is the table.
"""

from collections.abc import Sequence

import numpy as np

from ..fmu.memory import DoubleMemory
from ..system.system import Signal


class ValueTable(DoubleMemory):
    """One double for each signal, in a memory that FMUs read and write.

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
