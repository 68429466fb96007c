"""The rows of a run that are not in its log yet.

They lie where a supervisor finds them (:mod:`cosim.process.run_state`), which writes them if the
simulating one dies: nothing that was computed is lost.
"""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..files import write_all
from ..process.run_state import LAYOUT, STATE, STEPS, TAKEN
from .log import Rows, cut_to_rows, format_rows

# Rows that are written together: at least so many, as the cost of a call is then small beside that of
# the rows, and more of narrow ones, up to so many numbers (256 KiB); chosen: a processor keeps these at
# hand.
FEWEST, NUMBERS = 256, 2**15


def _room(width: int) -> int:
    """How many rows of so many signals are written together."""
    return max(FEWEST, NUMBERS // (1 + width))


class PendingRows:
    """The value table after each of the last steps.

    Args:
        row: the value table, shape (signals,).
        slots: places in it of the logged signals.
        every: steps from one row of the log to the next.

    Attributes:
        take: ``take(t)`` copies the table as it is at t [s]; returns whether there is room for no more.
        instants, taken: memory of their times [s], shape (rows,), and of the rows, shape (rows,
            signals).
        count: how many there are, shape (1,).
        finite: of how many, from the first on, it is known that all values are finite, shape (1,).
        room: how many there may be.
    """

    def __init__(self, row: np.ndarray, slots: np.ndarray, every: int) -> None:
        width = len(row)
        self.room = _room(width)
        memory, self._counts = STATE.pending(8 * self.room * (1 + width))
        self.instants, self.taken = _parts(memory, width)
        self.count = np.frombuffer(self._counts, np.int32)[TAKEN : TAKEN + 1]
        self.finite = np.zeros(1, np.int64)
        self._doubles = memory[: 8 * self.room].cast("d")
        self._slots, self._every = slots, every
        layout = {"width": width, "slots": slots.tolist(), "every": every}
        STATE.write(LAYOUT, json.dumps(layout))
        self.take = self._make_take(row)

    def _make_take(self, row: np.ndarray) -> Callable[[float], bool]:
        # What runs every step keeps what it needs in its own scope, where Python finds it fastest.
        times, taken, counts = self._doubles, self.taken, self._counts
        last = self.room - 1

        def take(t: float) -> bool:
            count = counts[TAKEN]
            taken[count] = row
            times[count] = t
            counts[TAKEN] = count + 1
            return count == last

        return take

    def all(self) -> tuple[np.ndarray, np.ndarray]:
        """The times [s] of the rows, and the rows, shape (rows, signals)."""
        count = self._counts[TAKEN]
        return self.instants[:count], self.taken[:count]

    def logged(self, count: int) -> Rows:
        """What belongs into the log of the first rows."""
        return _logged(
            self.instants[:count], self.taken[:count], self._slots, self._every, self._counts[STEPS]
        )

    def clear(self) -> None:
        """The rows are in the log."""
        count, self._counts[TAKEN] = self._counts[TAKEN], 0
        self._counts[STEPS] += count
        self.finite[0] = 0


def _parts(memory: memoryview, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Times, shape (room,), and rows, shape (room, width)."""
    room = _room(width)
    numbers = np.frombuffer(memory, count=room * (1 + width))
    return numbers[:room], numbers[room:].reshape(room, width)


def _logged(times: np.ndarray, taken: np.ndarray, slots: np.ndarray, every: int, before: int) -> Rows:
    """What belongs into the log.

    Args:
        times: of the rows [s].
        taken: rows, at every step.
        slots: places of the logged signals.
        every: steps from one row of the log to the next.
        before: steps before the first row.
    """
    chosen = slice(-before % every, None, every)
    return Rows(times[chosen], taken[chosen], slots)


def rescue(path: Path) -> int:
    """Write the pending rows of a process that has died to its CSV log.

    Returns:
        The number of rows of the log, all whole.

    Raises:
        OSError: they cannot be written.
    """
    rows = cut_to_rows(path)
    layout = json.loads(STATE.read(LAYOUT) or "null")
    memory, counts = STATE.pending(0)
    if layout is None or not counts[TAKEN] or not path.is_file():
        return rows
    times, taken = _parts(memory, layout["width"])
    count, before, every = counts[TAKEN], counts[STEPS], layout["every"]
    logged = _logged(times[:count], taken[:count], np.array(layout["slots"], np.intp), every, before)
    # It may have died while it wrote them.
    block = logged.block()[rows + before // -every :]
    try:
        with open(path, "ab", buffering=0) as file:
            write_all(file, format_rows(block))
    finally:
        rows = cut_to_rows(path)
    return rows
