"""What a worker of a Dask scheduler does: it keeps files, and makes runs of them."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from multiprocessing import parent_process
from pathlib import Path
from typing import Any

from distributed import Worker, WorkerPlugin, get_worker

from ..errors import InputError, SimulationError
from ..process.call_watch import watch_from_copy
from ..process.run_state import STATE
from ..process.spawned import end_with_parent
from .job import RunRow, Task, own_version
from .travelling_files import put
from .workplace import Workplace

# Wall time that a worker waits for a file [s], of which it gets all when it starts; between two looks.
PATIENCE, LOOK = 60.0, 0.05
FOLDER = "cybership"  # below a worker's own folder


@dataclass(frozen=True)
class Request:
    """What a task of Dask gets; no tuple, in which Dask would look for results of other tasks.

    Attributes:
        runs: scenarios with files named by their contents, each with what makes it.
        files: those names.
        resettable: SHA-256 of the FMUs that may be reset.
        version: of the package, without which equal numbers are not certain.
        timeout: longest wall time of a call of an FMU [s]; None: by what a step usually takes.
        notes: file on this computer for what a call took too long; None: on another one.
    """

    runs: list[tuple[dict[str, Any], Task]]
    files: tuple[str, ...]
    resettable: frozenset[str]
    version: str
    timeout: float | None = None
    notes: str | None = None


class OneFile(WorkerPlugin):
    """A file on every worker, also on those that start later.

    Args:
        file: its name by content.
        content: of the file.
    """

    def __init__(self, file: str, content: bytes) -> None:
        self.name = f"cybership-{file}"
        self._file, self._content = file, content

    def setup(self, worker: Worker) -> None:
        put(_folder(worker), self._file, self._content)


def _folder(worker: Worker) -> Path:
    return Path(worker.local_directory) / FOLDER


# The workplace of this process, if it is that of a worker.
_workplaces: dict[Path, Workplace] = {}
_making = threading.Lock()


def run_on_worker(request: Request) -> list[RunRow]:
    """A task on a worker."""
    if request.version != (own := own_version()):
        raise InputError(f"a worker has cybership {own}, and this computer has {request.version}")
    if (nanny := parent_process()) and nanny.pid:
        end_with_parent(nanny.pid)  # which Dask sees to only where no FMU hangs
    folder = _folder(get_worker())
    STATE.timeout = request.timeout
    with _making:
        if not _workplaces and request.notes is not None:
            watch_from_copy(request.notes)
        work = _workplaces.setdefault(folder, Workplace(folder))
    work.pool.resettable |= request.resettable
    until = time.monotonic() + PATIENCE
    while missing := [name for name in request.files if not (folder / name).is_file()]:
        if time.monotonic() > until:
            raise SimulationError(f"'{missing[0]}' did not reach a worker within {PATIENCE:g} s")
        time.sleep(LOOK)
    return [work.run(content, task) for content, task in request.runs]
