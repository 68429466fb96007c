"""Where runs are made: in this process, or on the workers of a Dask scheduler."""

import re
from collections.abc import Generator, Iterable
from typing import Protocol

from cybership.scratch_folder import Scratch

from ..errors import InputError
from .job import Job, RunRow
from .travelling_files import Files, put
from .workplace import Workplace

ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://(\[[0-9a-fA-F:.]+\]|[\w.-]+):\d{1,5}")


class RunPlace(Protocol):
    """Where runs are made."""

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, RunRow], None, None]:
        """Make runs; gives each as it ends, in any order; :meth:`close` abandons the others."""
        ...

    def close(self) -> None:
        """Free all that was taken."""
        ...


class ThisProcess:
    """Runs one after the other in this process."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self._scratch = Scratch()
        self._work = Workplace(self._scratch.path)

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, RunRow], None, None]:
        for job in jobs:
            for name in job.files:
                put(self._work.folder, name, self._files.paths[name].read_bytes())
                if name in self._files.fmus:
                    self._work.pool.know(self._work.folder / name, self._files.fmus[name])
            self._work.pool.resettable |= self._files.resettable
            yield job, self._work.run(job.content, job.task)

    def close(self) -> None:
        self._work.close()
        self._scratch.remove()


def check_address(scheduler: str | None) -> None:
    """Refuse what is no address of a scheduler.

    Raises:
        InputError: it is none.
    """
    if scheduler is not None and not ADDRESS.fullmatch(scheduler):
        raise InputError(
            f"'{scheduler}' is not an address of a scheduler: it takes the form tcp://HOST:PORT"
        )


def check_workers(workers: int | None) -> None:
    """Refuse what is no number of processes.

    Raises:
        InputError: it is none.
    """
    if workers is not None and workers < 0:
        raise InputError(f"workers = {workers}: needs a whole number from zero on")


def place_for(files: Files, scheduler: str | None, workers: int | None) -> RunPlace:
    """Where the runs of a campaign are made.

    Args:
        files: what they need.
        scheduler: address of a Dask scheduler; None is this computer.
        workers: processes on this computer; None is one for each core, 0 is this process.

    Raises:
        InputError: no scheduler answers at the address.
    """
    if workers == 0 and scheduler is None:
        return ThisProcess(files)
    from .dask_workers import DaskWorkers  # Dask takes a second to import

    return DaskWorkers(files, scheduler, workers)
