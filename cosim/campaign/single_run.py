"""Runs of a campaign in one process: in memory, or with a log, on FMUs that stay loaded."""

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple, Protocol

from ..errors import InputError, SimulationError
from ..master.algorithm import Master
from ..master.loop_surroundings import interruptible, quiet_collector
from ..master.recorder import Recorder
from ..master.simulation import simulate
from ..process.run_state import STATE
from ..results import performance
from ..scenario.load import load_scenario
from ..scenario.schema import Scenario
from ..system.instance_pool import InstancePool
from ..system.preparation import prepare
from .case_scenarios import Job
from .travelling_files import Files, copy_all


class Row(NamedTuple):
    """What the table keeps of a run.

    Attributes:
        status: ``done``, ``failed``, or ``lost`` where it is not the run that failed, but what ran it.
        message: why it failed, or why there are no metrics; else empty.
        wall_s: how long it took [s].
        metrics: as in metrics.json; empty if there are none.
        log: name -> content of the files of its result folder, where those are kept.
    """

    status: str
    message: str
    wall_s: float
    metrics: dict[str, float]
    log: dict[str, bytes]


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

    def run(self, content: dict[str, Any], keep_log: bool) -> Row:
        """Run a scenario whose FMUs and tables are in the folder.

        Raises:
            KeyboardInterrupt: the user has asked for the end.
        """
        with self._alone:
            started, here = time.perf_counter(), os.getcwd()
            scenario = load_scenario(content)
            scenario.set_origin(self.folder)
            try:
                row = self._logged(scenario) if keep_log else self._measured(scenario)
            except (InputError, SimulationError) as error:
                row = Row("failed", str(error), 0.0, {}, {})
            except Exception as error:  # of this computer, as a full disk, or of this program
                row = Row("lost", repr(error), 0.0, {}, {})
            finally:
                os.chdir(here)
            return row._replace(wall_s=time.perf_counter() - started)

    def _measured(self, scenario: Scenario) -> Row:
        """A run of which nothing is kept but its metrics."""
        system = prepare(scenario, models=self.pool.models(scenario))
        with interruptible() as interrupted, quiet_collector():
            master = Master(system, lambda _: None, interrupted, self.pool)
            try:
                recorder = Recorder(system, master, None)
                _step(master, recorder, interrupted)
            except SimulationError:
                _leave_if(interrupted)
                raise
            finally:
                STATE.calls_nothing()
                master.close()
        window = scenario.metrics
        try:
            found = performance.compute(recorder.kept(), window.start, window.stop, scenario.roles)
        except performance.MetricsError as error:
            return Row("done", f"no metrics: {error}", 0.0, {}, {})
        return Row("done", "", 0.0, found, {})

    def _logged(self, scenario: Scenario) -> Row:
        """A run with all files that ``cosim.run`` writes but pictures."""
        notes: list[str] = []
        with TemporaryDirectory(prefix="campaign_") as scratch:
            result = simulate(scenario, scratch, show=notes.append, pool=self.pool)
            if result.status == "interrupted":
                raise KeyboardInterrupt
            log = {file.name: file.read_bytes() for file in Path(scratch).iterdir()}
        message = result.message
        if result.status == "done" and not result.metrics:
            message = next((n.removeprefix("note: ") for n in notes if "no metrics" in n), "")
        return Row(result.status, message, 0.0, result.metrics if result.status == "done" else {}, log)

    def close(self) -> None:
        """Free the FMUs."""
        with self._alone:
            self.pool.close()


def _step(master: Master, recorder: Recorder, interrupted: Callable[[], bool]) -> None:
    """Run to the end, looking for an interrupt after each step."""
    take = recorder.take
    take(0.0)
    for t in master.run():
        if take(t):
            recorder.flush()
        if interrupted():
            raise KeyboardInterrupt
    recorder.flush()


def _leave_if(interrupted: Callable[[], bool]) -> None:
    """An FMU may report the interrupt as an error of its own."""
    if interrupted():
        raise KeyboardInterrupt


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

    def __init__(self, files: Files, keep_log: bool) -> None:
        self._files, self._keep_log = files, keep_log
        self._scratch = TemporaryDirectory(prefix="campaign_")
        self._work = Workplace(Path(self._scratch.name))

    def rows(self, jobs: Iterable[Job]) -> Generator[tuple[Job, Row], None, None]:
        for job in jobs:
            copy_all(self._work.folder, [(name, self._files.paths[name]) for name in job.files])
            self._work.pool.resettable |= self._files.resettable
            yield job, self._work.run(job.content, self._keep_log)

    def close(self) -> None:
        self._work.close()
        self._scratch.cleanup()
