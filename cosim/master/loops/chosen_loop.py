"""The step loop of a run: compiled where it can be, else in Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ...results.pending_rows import PendingRows
from ..algorithm import Master
from .compiled_loop import PlainLoopError, compiled_run


@dataclass(frozen=True)
class ChosenLoop:
    """A step loop.

    Attributes:
        run: steps to the end, with a row after each base step; yields, after one or several of them, the
            time [s] and whether there is room for no more rows. Raises what :meth:`Master.run` does.
        loop: ``compiled`` or ``plain``.
        reason: why it is the plain one.
    """

    run: Callable[[], Iterator[tuple[float, bool]]]
    loop: str
    reason: str = ""


def choose_loop(master: Master, rows: PendingRows, realtime: bool, patience: float) -> ChosenLoop:
    """The compiled loop where this run can take it.

    Args:
        master: initialised.
        rows: takes the rows.
        realtime: whether the run keeps to the wall clock.
        patience: wall time after which the caller wants to act [s].
    """
    try:
        steps = compiled_run(master, rows, master.system.scenario.native, realtime, patience)
        return ChosenLoop(lambda: steps, "compiled")
    except PlainLoopError as error:
        return ChosenLoop(lambda: _plain(master, rows), "plain", str(error))


def _plain(master: Master, rows: PendingRows) -> Iterator[tuple[float, bool]]:
    take = rows.take
    for t in master.run():
        yield t, take(t)
