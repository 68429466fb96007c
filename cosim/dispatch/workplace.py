"""Runs one after the other in one process, on FMUs that stay loaded."""

import ctypes
import os
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from ..errors import InputError, SimulationError
from ..scenario.load import load_scenario
from ..system.instance_pool import InstancePool
from .job import RunRow, Task

# Of glibc's mallopt: how much free memory at the end of the heap goes back to the system, and from
# which size on a block is not of the heap.
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
# Memory [bytes] that stays with the process; chosen: above what a run of some hours keeps of its log.
KEPT = 64 * 2**20
# The largest block that glibc lets be of the heap [bytes].
BLOCK = 32 * 2**20


def keep_freed_memory() -> None:
    """Have memory that a run frees wait in this process for the next run.

    Else the C library gives it back to the system after each run and gets it again page by page, which
    takes a tenth of the time of a short run. Nothing happens where the C library is not glibc.
    """
    with suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(TRIM_THRESHOLD, KEPT)
        mallopt(MMAP_THRESHOLD, BLOCK)


class Workplace:
    """The FMUs of one process, and where their files are.

    Args:
        folder: of files named by their contents.
    """

    def __init__(self, folder: Path) -> None:
        keep_freed_memory()
        self.folder = folder
        self.pool = InstancePool()
        # FMUs of one process share its working directory, modules and signals.
        self._alone = threading.Lock()

    def run(self, content: dict[str, Any], task: Task) -> RunRow:
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
                row = RunRow("failed", str(error))
            except Exception as error:  # of this computer, as a full disk, or of this program
                row = RunRow("lost", repr(error))
            finally:
                os.chdir(here)
            return row._replace(wall_s=time.perf_counter() - started)

    def close(self) -> None:
        """Free the FMUs."""
        with self._alone:
            self.pool.close()
