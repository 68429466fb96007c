"""The run of a scenario: prepare, step, record, and write metrics and pictures."""

import json
import math
import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cybership.scratch_folder import sweep

from ..compiled.library import prepare_library
from ..errors import InputError, SimulationError, not_written
from ..files import update_json, write_json, write_roomy_json
from ..process.run_state import LOGGING, STATE, Owner
from ..results import log as logs
from ..results.result_files import default_folder, others_file
from ..scenario.load import with_settings
from ..scenario.schema import Scenario
from ..scenario.shipped import find_parameters
from ..system.instance_pool import InstancePool
from ..system.preparation import prepare
from ..system.system import System
from .algorithm import Master
from .ending import Result, finish, interrupted_late, writing
from .folder_of_run import ResultFolder
from .loop_surroundings import interruptible, quiet_collector
from .loops.chosen_loop import choose_loop, run_loop
from .real_time import RealTimePace
from .recorder import Recorder, demand_memory
from .run_record import describe


def simulate(
    scenario: Scenario,
    out: str | Path | None = None,
    parameters: Sequence[str | Path] = (),
    realtime: float | None = None,
    pictures: bool = False,
    only_own: bool = False,
    show: Callable[[str], None] = lambda _: None,
    progress: Callable[[float], None] = lambda _: None,
    pool: InstancePool | None = None,
    native: bool | str | None = None,
    controller_model: Sequence[str | Path] = (),
    overwrite: bool = False,
    measured: Callable[[dict[str, float]], None] = lambda _: None,
) -> Result:
    """Run a scenario and write its log, metrics and pictures.

    Args:
        scenario: from :func:`cosim.load_scenario`.
        out: result folder; None: see :func:`~cosim.results.result_files.default_folder`.
        parameters: SSP parameter sets whose values override the scenario's.
        realtime: simulated seconds per second of wall time; None runs as fast as it can.
        pictures: whether to draw.
        only_own: whether to refuse FMUs with programs that were not built on this computer.
        show: receives warnings and messages, a line each.
        progress: receives the simulated time [s] several times a second.
        pool: FMUs that serve several runs, for a scenario whose paths are all files.
        native: in place of the scenario's: True compiles the project's own FMUs and the step loop, False
            nothing, "auto" where the system has a C compiler; None leaves it to the scenario.
        controller_model: SSP parameter sets for the controller models in controllers and observers.
        overwrite: whether the default folder is ``results/<name>``, whatever is there, and whether files
            of no run may be replaced.
        measured: receives the metrics as soon as they are known, before anything is drawn.

    Returns:
        How it ended. A failed or interrupted run keeps its log.

    Raises:
        InputError: the scenario cannot be run; nothing has been written.
    """
    if out is not None and not str(out).strip():
        raise InputError("out must be the name of a folder; got an empty text")
    if realtime is not None and not 0.0 < realtime < math.inf:
        raise InputError(f"realtime must be a positive factor; got {realtime:g}")
    overrides, controllers = (list(find_parameters(p)) for p in (parameters, controller_model))
    if native is not None:
        scenario = with_settings(scenario, [("native", native)], Path.cwd())
    # FMUs may change the working directory.
    here = os.getcwd()
    owner = Owner()
    sweep()
    result: Result | None = None
    at_end = ExitStack()
    at_end.callback(STATE.finish)
    try:
        models = None if pool is None else pool.models(scenario)
        system = prepare(scenario, overrides, only_own, models, controllers)
        try:
            description = describe(system)
            usual = default_folder(scenario.name, description, overwrite)
            given = usual if out is None else Path(out)
            folder = Path(os.path.abspath(given))
            if (theirs := others_file(folder)) and not overwrite:
                raise InputError(
                    f"'{theirs}' does not belong to a run (there is no {logs.SIDECAR}); "
                    "--overwrite replaces it"
                )
            moved = ""
            if out is None and given.name != scenario.name:
                first = given.with_name(scenario.name)
                moved = f"note: another run is in '{first}'; this one is written to '{given}'"
            results = ResultFolder(folder, moved)
            at_end.enter_context(results)
            result, recorder = _run(
                system, results, description, realtime, show, progress, pool, pictures
            )
        finally:
            owner.leave_copies()
            if pool is None:
                system.close()
            os.chdir(here)
        if recorder is not None:
            finish(system, result, recorder, pictures, show, measured)
    except KeyboardInterrupt:
        if result is not None:
            interrupted_late(result)
        raise
    finally:
        at_end.close()
    result.folder = given
    return result


def _run(
    system: System,
    results: ResultFolder,
    description: dict[str, Any],
    realtime: float | None,
    show: Callable[[str], None],
    progress: Callable[[float], None],
    pool: InstancePool | None,
    pictures: bool,
) -> tuple[Result, Recorder | None]:
    """Instantiate, initialise and run; returns how it ended, and the recorder if there is a log.

    The folder of the results is made as soon as nothing can refuse the run any more.
    """
    scenario, owner, folder = system.scenario, Owner(), results.path
    for note in scenario.notes:
        show(f"note: {note}")
    for warning in system.warnings:
        show(f"warning: {warning}")
    if scenario.log.format == "parquet" and find_spec("pyarrow") is None:
        raise InputError("log.format = parquet needs pyarrow: pip install 'cybership[tables]'")
    demand_memory(system, pictures)
    if note := prepare_library(scenario.native):
        show(f"note: {note}")
    STATE.begin(str(folder), json.dumps(description))
    with interruptible() as interrupted:
        try:
            master = Master(system, lambda text: show(f"warning: {text}"), interrupted, pool)
        except (SimulationError, InputError) as error:
            if interrupted():  # an FMU may report the interrupt as an error of its own
                raise KeyboardInterrupt from None
            if isinstance(error, InputError):
                raise
            results.make(show)
            stated = {"status": "failed", "rows": 0, "message": str(error)}
            write_json(folder / logs.SIDECAR, {**description, **stated})
            return Result("failed", folder, message=str(error), warnings=system.warnings), None
        try:
            owner.leave_copies()
            results.make(show)
            result, recorder = _record(
                system, master, folder, realtime, progress, description, interrupted, pictures
            )
        finally:
            master.close()
        if interrupted():  # while an FMU terminated
            interrupted_late(result)
        return result, recorder


def _record(
    system: System,
    master: Master,
    folder: Path,
    realtime: float | None,
    progress: Callable[[float], None],
    sidecar: dict[str, Any],
    interrupted: Callable[[], bool],
    pictures: bool,
) -> tuple[Result, Recorder]:
    """Run to the end; returns how it ended, and the recorder."""
    result = Result("running", folder, warnings=system.warnings, native=system.native)
    try:
        write_roomy_json(folder / logs.SIDECAR, {**sidecar, "status": "running"})
        recorder = Recorder(system, master, folder, pictures=pictures)
    except OSError as error:
        raise InputError(not_written(folder, error)) from None
    STATE.numbers[LOGGING] = 1
    steps = choose_loop(master, recorder.pending, realtime is not None)
    result.loop, result.loop_reason = steps.loop, steps.reason
    pace: RealTimePace | None = None
    result.status = "failed"  # until the loop has ended otherwise
    try:
        try:
            with quiet_collector():
                # Starts here: the collection before takes the time of several steps.
                pace = (
                    None
                    if realtime is None
                    else RealTimePace(realtime, system.scenario.step, interrupted)
                )
                stopped = run_loop(steps, recorder, interrupted, pace, progress)
            result.status = "interrupted" if stopped else "done"
        except (SimulationError, OSError, KeyboardInterrupt) as error:
            # A second request may interrupt an FMU in the middle of its step.
            result.status = "interrupted" if interrupted() else "failed"
            result.message = str(error)
    finally:
        STATE.calls_nothing()
        try:
            recorder.flush()
        except SimulationError as error:
            result.message = result.message or str(error)
        except OSError as error:
            result.status = "failed"
            result.message = not_written(folder, error)
        recorder.close()
        result.rows = recorder.rows
        stated: dict[str, Any] = {"rows": result.rows, "loop": result.loop}
        if result.loop_reason:
            stated["loop_reason"] = result.loop_reason
        if pace is not None:
            result.pace = stated["realtime"] = pace.summary()
        stated["messages"] = master.messages.kept
        if result.message:
            stated["message"] = result.message
        stated["status"] = result.status
        with writing(result):
            update_json(folder / logs.SIDECAR, sidecar, stated)
    return result, recorder
