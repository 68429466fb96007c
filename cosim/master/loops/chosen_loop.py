"""The step loop of a run: compiled where it can be, else in Python; and its rows into the log."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

from ...process.run_state import STATE
from ...results.pending_rows import PendingRows
from ..algorithm import Master
from ..real_time import RealTimePace
from ..recorder import Recorder
from .compiled_loop import PlainLoopError, compiled_run

# Wall time between two updates of progress and log [s]; chosen: smooth, and cheap beside the steps.
UPDATE_INTERVAL = 0.2


class ChosenLoop(NamedTuple):
    """A step loop.

    Attributes:
        steps: steps to the end, with a row after each base step; yields, after one or several of them,
            the time [s] and whether there is room for no more rows. Raises what :meth:`Master.run` does.
        loop: ``compiled`` or ``plain``.
        reason: why it is the plain one.
    """

    steps: Iterator[tuple[float, bool]]
    loop: str
    reason: str = ""


def choose_loop(master: Master, rows: PendingRows, realtime: bool = False) -> ChosenLoop:
    """The compiled loop where this run can take it.

    Args:
        master: initialised.
        rows: takes the rows.
        realtime: whether the run keeps to the wall clock.
    """
    try:
        native = master.system.scenario.native
        return ChosenLoop(compiled_run(master, rows, native, realtime, UPDATE_INTERVAL), "compiled")
    except PlainLoopError as error:
        return ChosenLoop(_plain(master, rows), "plain", str(error))


def _plain(master: Master, rows: PendingRows) -> Iterator[tuple[float, bool]]:
    take = rows.take
    for t in master.run():
        yield t, take(t)


def run_loop(
    chosen: ChosenLoop,
    recorder: Recorder,
    interrupted: Callable[[], bool],
    pace: RealTimePace | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> bool:
    """Step and record, with updates of progress and log; returns whether the user stopped it."""
    recorder.take(0.0)
    clock, t = time.perf_counter, 0.0
    due = clock() + UPDATE_INTERVAL
    for t, full in chosen.steps:
        if pace is not None:
            pace.wait(t)
        if interrupted():
            recorder.flush()
            return True
        # At every step: the next may be a slow one, and the last of its process.
        is_due = clock() > due
        if full or is_due:
            STATE.calls_nothing()
            recorder.flush()
        if is_due:
            gc.collect()
            progress(t)
            due = clock() + UPDATE_INTERVAL
    recorder.flush()
    progress(t)
    return False
