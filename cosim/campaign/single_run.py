"""Runs one after the other in one process, on FMUs that stay loaded."""

import os
import threading
import time
from collections.abc import Generator, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Protocol

from ..errors import InputError, SimulationError
from ..scenario.load import load_scenario
from ..system.instance_pool import InstancePool
from .job import Job, Row, Task
from .travelling_files import Files, copy_all


class Workplace:
    """The FMUs of one process, and where their files are.

    Args:
        folder: of files named by their contents.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.pool = InstancePool()
        # FMUs of one process share its working directory, modules and signals.
        self._alone = threading.Lock()

    def run(self, content: dict[str, Any], task: Task) -> Row:
        """Run a scenario whose FMUs and tables are in the folder.

        Raises:
            KeyboardInterrupt: the user has asked for the end.
        """
        with self._alone:
            started, here = time.perf_counter(), os.getcwd()
            scenario = load_scenario(content)
            scenario.set_origin(self.folder)
            try:
                row = task(self.pool, scenario)
            except (InputError, SimulationError) as error:
                row = Row("failed", str(error), 0.0, {}, {}, error)
            except Exception as error:  # of this computer, as a full disk, or of this program
                row = Row("lost", repr(error), 0.0, {}, {}, error)
            finally:
                os.chdir(here)
            return row._replace(wall_s=time.perf_counter() - started)

    def close(self) -> None:
        """Free the FMUs."""
        with self._alone:
            self.pool.close()


class Place(Protocol):
    """Where runs are made."""

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, Row], None, None]:
        """Make runs; gives each as it ends, in any order. Closing the iterator abandons the others."""
        ...

    def close(self) -> None:
        """Free all that was taken."""
        ...


class ThisProcess:
    """Runs one after the other in this process."""

    def __init__(self, files: Files) -> None:
        self._files = files
        self._scratch = TemporaryDirectory(prefix="campaign_")
        self._work = Workplace(Path(self._scratch.name))

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, Row], None, None]:
        for job in jobs:
            copy_all(self._work.folder, [(name, self._files.paths[name]) for name in job.files])
            self._work.pool.resettable |= self._files.resettable
            yield job, self._work.run(job.content, job.task)

    def close(self) -> None:
        self._work.close()
        self._scratch.cleanup()


def place_for(files: Files, scheduler: str | None, workers: int | None) -> Place:
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
    from .dispatch import DaskWorkers  # Dask takes a second to import

    return DaskWorkers(files, scheduler, workers)
