"""Runs one after the other in one process, on FMUs that stay loaded."""

import os
import threading
import time
from pathlib import Path
from typing import Any

from ..errors import InputError, SimulationError
from ..scenario.load import load_scenario
from ..system.instance_pool import InstancePool
from .freed_memory import keep_freed_memory
from .job import RunRow, Task


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
