"""A run of which the metrics are kept, and its log on request."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

from cybership.scratch_folder import scratch_folder

from ..compiled.library import prepare_library
from ..errors import SimulationError
from ..master.algorithm import Master
from ..master.ending import metrics_of, trial_of
from ..master.loop_surroundings import interruptible, paused_collector
from ..master.loops.chosen_loop import choose_loop, run_loop
from ..master.recorder import Recorder, demand_memory
from ..master.simulation import simulate
from ..process.run_state import STATE
from ..results import performance
from ..results.log import LogInMemory
from ..scenario.schema import Scenario
from ..system.instance_pool import InstancePool
from ..system.preparation import prepare
from .job import RunRow


@dataclass(frozen=True)
class Measured:
    """Makes a run, and keeps its metrics.

    Attributes:
        keep_log: whether all files that ``cosim.run`` writes, but pictures, come back as well.
    """

    keep_log: bool = False

    def __call__(self, pool: InstancePool, scenario: Scenario) -> RunRow:
        if self.keep_log:
            return _logged(pool, scenario)
        try:
            metrics = run_in_memory(pool, scenario)
        except performance.MetricsError as error:
            return RunRow("done", f"no metrics: {error}")
        return RunRow("done", "", metrics=metrics)


def run_in_memory(
    pool: InstancePool, scenario: Scenario, keep: Callable[[LogInMemory], None] | None = None
) -> dict[str, float]:
    """Make a run without a file.

    Args:
        pool: the FMUs.
        scenario: what to run; its paths are all files.
        keep: gets the log, also that of a run that failed in its steps.

    Returns:
        The metrics.

    Raises:
        InputError: the scenario cannot be run.
        SimulationError: the run failed.
        MetricsError: there are no metrics.
        KeyboardInterrupt: the user has asked for the end.
    """
    models = pool.models(scenario)
    # The project's own FMUs see to it themselves that all their outputs are finite. Without a log
    # nothing of them is read but what other FMUs and the metrics need.
    own = {name for name, model in models.items() if model.sha256 in pool.resettable}
    system = prepare(scenario, models=models, unlogged=() if keep else own)
    log = LogInMemory(["time", *system.logged]) if keep else None
    demand_memory(system, False)
    prepare_library(scenario.native)
    # Collecting all garbage before each run would cost more than the run.
    with interruptible() as interrupted, paused_collector():
        master = Master(system, lambda _: None, interrupted, pool)
        try:
            recorder = Recorder(system, master, None, log)
            _step(master, recorder, interrupted)
        finally:
            STATE.calls_nothing()
            master.close()
            if keep is not None and log is not None:
                keep(log)
    if interrupted():  # after the last step
        raise KeyboardInterrupt
    columns = recorder.kept()
    return metrics_of(system, columns, trial_of(system, columns))


def _step(master: Master, recorder: Recorder, interrupted: Callable[[], bool]) -> None:
    """Run to the end.

    Raises:
        KeyboardInterrupt: the user has stopped it.
    """
    try:
        if run_loop(choose_loop(master, recorder.pending), recorder, interrupted):
            raise KeyboardInterrupt
    except SimulationError:
        if interrupted():  # an FMU may report the interrupt as an error of its own
            raise KeyboardInterrupt from None
        with suppress(SimulationError):  # the first error is the one that counts
            recorder.flush()
        raise


def _logged(pool: InstancePool, scenario: Scenario) -> RunRow:
    notes: list[str] = []
    with scratch_folder() as scratch:
        result = simulate(scenario, scratch, show=notes.append, pool=pool)
        if result.status == "interrupted":
            raise KeyboardInterrupt
        log = {file.name: file.read_bytes() for file in scratch.iterdir()}
    message = result.message
    if result.status == "done" and not result.metrics:
        message = next((n.removeprefix("note: ") for n in notes if "no metrics" in n), "")
    return RunRow(result.status, message, 0.0, result.metrics if result.status == "done" else {}, log)
