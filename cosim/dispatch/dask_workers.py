"""Runs on the workers of a Dask scheduler, on this computer or elsewhere."""

from __future__ import annotations

import atexit
import logging
import os
import statistics
import time
from collections import deque
from collections.abc import Generator, Iterable
from contextlib import ExitStack, suppress
from itertools import islice
from queue import Empty, Queue
from threading import Thread
from typing import Any

from dask.config import set as settings
from distributed import (
    Client,
    Future,
    KilledWorker,
    LocalCluster,
)
from distributed.deploy.spec import close_clusters

from cybership.scratch_folder import Scratch

from ..errors import InputError, SimulationError
from ..interrupts import uninterrupted_processes
from ..process.run_state import STATE
from ..process.spawned import without_program
from .dask_task import OneFile, Request, run_on_worker
from .job import Job, RunRow, own_version
from .travelling_files import Files

# Wall time that one task of Dask should last [s], so that what Dask does for it, a few ms, is one or two
# percent of it; chosen: little is lost with a worker, and none waits long for another at the end.
TASK_TIME = 0.3
# Runs in one task; chosen: the request stays small.
MOST_IN_TASK = 64
# Tasks that wait or run for each thread of the workers: one runs while the next one is on its way.
AHEAD = 2
# Wall time until a scheduler has to answer [s]; chosen.
ANSWER = 10.0
# Wall time for which there may be no worker [s]: one that died here is back within seconds, elsewhere
# somebody may still start some. Between two looks.
WITHOUT_WORKERS, GLANCE = 120.0, 1.0
# How often the workers of a task may die here before it is suspected; chosen: once by chance.
DEATHS = 1
# What Dask watches beside the tasks took 9 % of a core with two workers that did nothing, and takes 1 %.
LIGHT = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
}
LOST, KEPT = "the workers were lost", "finished runs are kept"


def _rows_of(future: Future) -> list[RunRow] | None:
    """What a task has made; None if its workers died.

    Raises:
        InputError: it cannot be run.
        SimulationError: what ran it is gone.
    """
    try:
        return future.result()
    except KilledWorker:
        return None
    except InputError:
        raise
    except Exception as error:
        raise SimulationError(f"{LOST}: {error!r}; {KEPT}") from error


class DaskWorkers:
    """Runs on the workers of a Dask scheduler.

    Args:
        files: what the runs need; each is sent once to each worker.
        address: of a scheduler; None starts one with workers on this computer.
        workers: how many, without an address; None is one for each core.

    Raises:
        InputError: no scheduler answers at the address.
    """

    def __init__(self, files: Files, address: str | None, workers: int | None) -> None:
        self._files = files
        self._cluster: LocalCluster | None = None
        self._scratch = Scratch()
        self._notes = self._scratch.path / "late"
        self._program = ExitStack()
        for logger in ("distributed", "distributed.client"):  # the latter has a level of its own
            logging.getLogger(logger).setLevel(logging.CRITICAL)
        # That of one which was interrupted while it started raises; multiprocessing ends its workers.
        atexit.unregister(close_clusters)
        try:
            if address is None:
                self._program.enter_context(without_program())  # also for workers that start again
                folder = str(self._scratch.path)
                # A Ctrl-C is for this process alone; the workers end with it.
                with uninterrupted_processes(), settings({**LIGHT, "temporary-directory": folder}):
                    self._cluster = LocalCluster(
                        n_workers=workers or os.cpu_count() or 1,
                        threads_per_worker=1,  # FMUs of one process cannot run side by side
                        processes=True,
                        host="127.0.0.1",
                        dashboard_address="127.0.0.1:0",  # where Dask tells of its health
                        memory_limit=0,  # what FMUs allocate is not Dask's to manage
                        local_directory=folder,
                        silence_logs=logging.CRITICAL,
                        scheduler_kwargs={"allowed_failures": DEATHS, "dashboard": False},
                    )
                    self._client = Client(self._cluster, set_as_default=False)
            else:
                self._client = Client(address, timeout=ANSWER, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            self._close_cluster()
            where = "with processes on this computer" if address is None else f"at '{address}'"
            raise InputError(f"no Dask scheduler answers {where}: {error}") from None
        except RuntimeError as error:  # of Dask's nannies
            self._close_cluster()
            raise SimulationError(f"{LOST} while they started: {error}; {KEPT}") from None
        except BaseException:
            self._close_cluster()
            raise
        self._running: dict[Any, tuple[Future, list[Job], bool]] = {}
        self._walls: deque[float] = deque(maxlen=20)
        self._sent: set[str] = set()

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, RunRow], None, None]:
        waiting = iter(jobs)
        # Dask counts a worker's death against every task that it had. Those that it gives up go again at
        # the end, each alone, to find the one that ends its process.
        suspects: deque[Job] = deque()
        running = self._running
        ended: Queue[Future] = Queue()

        def start(batch: list[Job], alone: bool) -> None:
            future = self._submit(batch)
            running[future.key] = future, batch, alone
            future.add_done_callback(ended.put)

        def fill() -> None:
            while len(running) < AHEAD * max(1, self._threads()):
                if not (batch := list(islice(waiting, self._in_task()))):
                    break
                start(batch, False)
            if suspects and not running:
                start([suspects.popleft()], True)

        try:
            fill()
            while running:
                future = self._next(ended)
                _, batch, alone = running.pop(future.key)
                found = _rows_of(future)
                if found is None and not alone:
                    suspects.extend(batch)
                    found = []
                elif found is None:
                    found = [RunRow("lost", self._why_lost())]
                self._walls.extend(row.wall_s for row in found)
                yield from zip(batch, found, strict=False)
                fill()
        except OSError as error:
            raise SimulationError(f"{LOST}: {error}; {KEPT}") from None

    def _why_lost(self) -> str:
        """Why the last run that was lost ended its process."""
        with suppress(OSError, IndexError):
            return self._notes.read_text(encoding="utf-8").splitlines()[-1]
        return "it ended every process that ran it"

    def _next(self, ended: Queue[Future]) -> Future:
        """The next task that ends.

        Raises:
            SimulationError: there is no worker, and none comes.
        """
        seen = time.monotonic()
        while True:
            try:
                return ended.get(timeout=GLANCE)
            except Empty:
                now = time.monotonic()
            if self._threads():
                seen = now
            elif now - seen > WITHOUT_WORKERS:
                raise SimulationError(f"there was no worker for {WITHOUT_WORKERS:g} s; {KEPT}")

    def _threads(self) -> int:
        """Threads of all workers."""
        threads: Any = self._client.nthreads()
        return sum(threads.values())

    def _in_task(self) -> int:
        """How many runs make a task of about ``TASK_TIME``."""
        if not self._walls:
            return 1
        return max(1, min(MOST_IN_TASK, int(TASK_TIME / max(statistics.median(self._walls), 1e-3))))

    def _submit(self, batch: list[Job]) -> Future:
        names = dict.fromkeys(name for job in batch for name in job.files)
        for name in names:
            self._send(name)
        request = Request(
            [(job.content, job.task) for job in batch],
            tuple(names),
            frozenset(self._files.resettable),
            own_version(),
            STATE.timeout,
            str(self._notes) if self._cluster is not None else None,
        )
        return self._client.submit(run_on_worker, request, pure=False)

    def _send(self, name: str) -> None:
        """Have a file on all workers, unless it was sent before.

        Beside the rest, and without waiting: for a worker that has just died the scheduler tries half a
        minute, in which the others have the file and work.
        """
        if name not in self._sent:
            self._sent.add(name)
            Thread(target=self._deliver, args=(name,), daemon=True).start()

    def _deliver(self, name: str) -> None:
        key = ["cybership", name]
        # Where this fails, the scheduler is gone, or keeps what workers get that start later.
        with suppress(OSError, RuntimeError):
            if not self._client.get_metadata(key, False):
                self._client.register_plugin(OneFile(name, self._files.paths[name].read_bytes()))
                self._client.set_metadata(key, True)

    def close(self) -> None:
        # Not where an interrupt leaves the iterator: a busy scheduler takes its time, and the table is
        # to be written first.
        with suppress(OSError):
            self._client.cancel([future for future, *_ in self._running.values()])
        with suppress(OSError):  # on a computer that is busy Dask gives up waiting; all has ended then
            self._client.close()
        self._close_cluster()

    def _close_cluster(self) -> None:
        if self._cluster is not None:
            with suppress(OSError):
                self._cluster.close()
        self._program.close()
        self._scratch.remove()
