"""Recording of the value table after every step."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, SimulationError
from ..results.log import CSV, LogInMemory, LogWriter
from ..results.pending_rows import PendingRows
from ..results.performance import read_columns
from ..system.system import System
from .algorithm import Master
from .stepper import ValueTable


def demand_memory(system: System, pictures: bool) -> None:
    """See that there is room for the columns that metrics and pictures need until the end.

    Raises:
        InputError: this computer has less memory.
    """
    names = _kept_names(system, list(system.signals), pictures)
    octets = 8 * (1 + len(names)) * (1 + system.steps)
    if hasattr(os, "sysconf") and octets > os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"):
        raise InputError(
            f"{system.steps} steps are too many: metrics and pictures need {octets / 2**30:.3g} "
            "GiB of memory; use a longer step or an earlier stop"
        )


def _kept_names(system: System, names: Sequence[str], pictures: bool) -> list[str]:
    """Those of some columns that are kept until the end."""
    roles = system.scenario.roles
    known = {*(roles.columns if pictures else read_columns(names, roles))}
    known |= set() if system.trial is None else {system.trial.order}
    known |= {*system.commands} if pictures else set()
    return [name for name in names if name in known]


class Recorder:
    """Writes the logged columns in blocks, and keeps those of metrics and pictures, logged or not.

    Args:
        system: what runs.
        master: its master.
        folder: for the log; None writes none.
        memory: gets the log in place of a folder.
        pictures: whether pictures will be drawn.

    Attributes:
        pending: the rows that are not written yet.
        take: ``take(t)`` takes the table as it is at t [s]; returns whether :meth:`flush` is due.
    """

    def __init__(
        self,
        system: System,
        master: Master,
        folder: Path | None,
        memory: LogInMemory | None = None,
        pictures: bool = False,
    ) -> None:
        self.columns = ["time", *system.logged]
        table = master.table
        self._writer = memory if folder is None else LogWriter(folder / CSV, self.columns)
        self._names = [s.name for s in table.signals]
        self._outputs = self._slots(table, master.outputs)
        self._kept_names = _kept_names(system, self._names, pictures)
        self._kept_slots = self._slots(table, self._kept_names)
        self._kept = np.empty((1 + len(self._kept_names), 1 + system.steps))
        self._count = 0  # rows in it
        logged = self._slots(table, system.logged)
        self.pending = PendingRows(table.row, logged, system.scenario.log.every)
        self.take = self.pending.take

    @staticmethod
    def _slots(table: ValueTable, names: Sequence[str]) -> np.ndarray:
        return np.array([table.slots[name] for name in names], dtype=np.intp)

    @property
    def rows(self) -> int:
        """Number of rows in the log."""
        return 0 if self._writer is None else self._writer.rows

    def flush(self) -> None:
        """Write the rows taken so far.

        Raises:
            SimulationError: an output is not finite; the rows up to there are written.
            OSError: not all could be written; then none can follow.
        """
        times, taken = self.pending.all()
        message = ""
        # Inputs may be lost, and NaN; all of the table is quicker to look at than a part of it.
        known = int(self.pending.finite[0])
        if (
            not np.isfinite(taken[known:]).all()
            and (wrong := ~np.isfinite(taken[:, self._outputs])).any()
        ):
            k = int(np.argmax(wrong.any(axis=1)))
            name = self._names[self._outputs[int(np.argmax(wrong[k]))]]
            message = f"{name} is not finite at t = {times[k]:g} s"
            times, taken = times[: k + 1], taken[: k + 1]
        if self._writer is not None:
            self._writer.write(self.pending.logged(len(times)))
        first, self._count = self._count, self._count + len(times)
        self._kept[0, first : self._count] = times
        self._kept[1:, first : self._count] = taken[:, self._kept_slots].T
        self.pending.clear()
        if message:
            raise SimulationError(message)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()

    def kept(self) -> dict[str, np.ndarray]:
        """The columns for metrics, and for pictures if there will be some, at every step."""
        return dict(zip(["time", *self._kept_names], self._kept[:, : self._count], strict=True))
