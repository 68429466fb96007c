"""Many scenarios in several processes, of which an analysis keeps what it needs; logs stay in memory."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from cybership.scratch_folder import sweep

from ..errors import InputError, SimulationError
from ..master.simulation import simulate
from ..results import performance
from ..results.log import LogInMemory, read_log
from ..scenario.load import load_scenario
from ..scenario.schema import Scenario
from ..system.instance_pool import InstancePool
from .job import Job, RunRow, job_of
from .measured_run import run_in_memory
from .places import check_workers, place_for
from .travelling_files import Files


@dataclass
class FinishedRun:
    """What an analysis gets.

    Attributes:
        scenario: content of its scenario, as it was given.
        folder: where its log is kept; None where it is not.
        status: ``done`` or ``failed``.
        message: why it failed; else empty.
        metrics: as in metrics.json; empty if there are none.
        log: its columns, as :func:`cosim.read_log` reads them; of a failed run up to there.
    """

    scenario: dict[str, Any]
    folder: Path | None = None
    status: str = "done"
    message: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    log: Mapping[str, np.ndarray] = field(default_factory=dict)

    def demand(self) -> None:
        """See that the run went through.

        Raises:
            SimulationError: it did not.
        """
        if self.status != "done":
            raise SimulationError(f"'{self.scenario.get('name', '')}' {self.status}: {self.message}")


Analysis = Callable[[FinishedRun], Any]


@dataclass(frozen=True)
class Analysed:
    """Makes a run, and gives it to an analysis.

    Attributes:
        analyse: takes the run, and gives what is kept of it.
        content: of its scenario, as it was given.
        folder: keeps what ``cosim.run`` writes, but pictures; None keeps nothing.
    """

    analyse: Analysis
    content: dict[str, Any]
    folder: Path | None

    def __call__(self, pool: InstancePool, scenario: Scenario) -> RunRow:
        run = FinishedRun(self.content, self.folder)
        try:
            if self.folder is None:
                _in_memory(pool, scenario, run)
            else:
                _in_folder(pool, scenario, run, self.folder)
            return RunRow("done", "", value=self.analyse(run))
        except Exception as error:  # reported where the runs were asked for
            return RunRow("failed", str(error), value=error)


def _in_memory(pool: InstancePool, scenario: Scenario, run: FinishedRun) -> None:
    def keep(log: LogInMemory) -> None:
        run.log = log.read()

    try:
        run.metrics = run_in_memory(pool, scenario, keep)
    except performance.MetricsError:
        return
    except SimulationError as error:
        run.status, run.message = "failed", str(error)


def _in_folder(pool: InstancePool, scenario: Scenario, run: FinishedRun, folder: Path) -> None:
    result = simulate(scenario, folder, pool=pool)
    if result.status == "interrupted":
        raise KeyboardInterrupt
    run.status, run.message, run.metrics = result.status, result.message, result.metrics
    if result.rows:
        run.log = read_log(folder)


def analyse_runs(
    scenarios: Sequence[dict[str, Any]],
    analyse: Analysis,
    folders: Sequence[Path | None] | None = None,
    workers: int | None = None,
    advance: Callable[[], None] = lambda: None,
) -> list[Any]:
    """Run scenarios, and give what an analysis makes of each.

    FMUs are loaded once in a process and reset between runs where they are the project's own; logs stay
    in memory. The analysis may be called in another process: it and what it gives are pickled.

    Args:
        scenarios: contents, as if they lay in the working directory.
        analyse: takes a run, which may have failed, and returns the little that is kept.
        folders: for each run where its log is kept; None keeps none.
        workers: processes on this computer; None is one for each core, 0 runs in this process.
        advance: called after each finished run.

    Returns:
        What the analysis made of each, in the order of the scenarios.

    Raises:
        InputError: a scenario that cannot be run.
        SimulationError: the workers were lost, or one run ended each process that made it.
        Exception: whatever the analysis raises.
    """
    check_workers(workers)
    places = folders or [None] * len(scenarios)
    several = 0
    if workers != 0 and len(scenarios) > 1:  # one run needs no other process
        several = min(workers or os.cpu_count() or 1, len(scenarios))
    if several and find_spec("distributed") is None:
        raise InputError("several processes need distributed: pip install 'cybership[campaign]'")
    sweep()
    files = Files()
    try:
        loaded = [load_scenario(content) for content in scenarios]
        files.read(loaded)
        tasks = [Analysed(analyse, c, f) for c, f in zip(scenarios, places, strict=True)]
        jobs = [job_of(s, files, t) for s, t in zip(loaded, tasks, strict=True)]
        found = _make(jobs, files, several, advance)
    finally:
        files.close()
    return [found[job] for job in jobs]


def _make(
    jobs: Sequence[Job], files: Files, workers: int, advance: Callable[[], None]
) -> dict[Job, Any]:
    found: dict[Job, Any] = {}
    with closing(place_for(files, None, workers)) as place, closing(place.rows(jobs)) as rows:
        for job, row in rows:
            if row.status == "failed" and row.value is not None:
                raise row.value
            if row.status != "done":
                raise SimulationError(row.message)
            found[job] = row.value
            advance()
    return found
