"""Takes down what the master's table holds after every step."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from . import metrics
from .errors import SimulationError
from .log import CSV, LogWriter
from .master import Master
from .stepper import Table
from .system import System

BLOCK = 256  # rows that are written together


class Recorder:
    """Takes the table after every step: writes the logged part of it in blocks, and keeps what metrics
    and pictures are made from, whether logged or not."""

    def __init__(self, system: System, master: Master, folder: Path) -> None:
        self.columns = ["time", *system.logged]
        self.rows = 0
        table = master.table
        self._every = system.scenario.log.every
        self._writer = LogWriter(folder / CSV, self.columns)
        self._row = table.row
        self._taken = np.empty((BLOCK, len(table.row)))
        self._times: list[float] = []
        self._steps = 0
        self._names = [s.name for s in table.signals]
        self._logged = self._slots(table, system.logged)
        self._outputs = self._slots(table, master.outputs)
        self._kept_names = metrics.needed(self._names)
        self._kept_slots = self._slots(table, self._kept_names)
        self._kept: list[np.ndarray] = []

    @staticmethod
    def _slots(table: Table, names: Sequence[str]) -> np.ndarray:
        return np.array([table.slots[name] for name in names], dtype=np.intp)

    def take(self, t: float) -> bool:
        """Remember the table as it is at t; returns whether it is time to flush."""
        count = len(self._times)
        self._taken[count] = self._row
        self._times.append(t)
        return count == BLOCK - 1

    def flush(self) -> None:
        """Write what has been taken.

        Raises:
            SimulationError: an output is not finite; the rows up to there are written.
        """
        count = len(self._times)
        wrong = ~np.isfinite(self._taken[:count, self._outputs])
        message = ""
        if wrong.any():
            k = int(np.argmax(wrong.any(axis=1)))
            name = self._names[self._outputs[int(np.argmax(wrong[k]))]]
            message = f"{name} is not finite at t = {self._times[k]:g} s"
            count = k + 1
        times, taken = np.array(self._times[:count]), self._taken[:count]
        first = -self._steps % self._every
        block = np.empty((len(times[first :: self._every]), len(self.columns)))
        block[:, 0] = times[first :: self._every]
        block[:, 1:] = taken[first :: self._every, self._logged]
        self._writer.write(block)
        self._kept.append(np.column_stack([times, taken[:, self._kept_slots]]))
        self.rows += len(block)
        self._steps += count
        self._times.clear()
        if message:
            raise SimulationError(message)

    def close(self) -> None:
        self._writer.close()

    def kept(self) -> dict[str, np.ndarray]:
        """The columns that metrics and pictures are made from, at every step."""
        table = np.concatenate(self._kept) if self._kept else np.empty((0, 1 + len(self._kept_names)))
        return {name: table[:, k] for k, name in enumerate(["time", *self._kept_names])}
