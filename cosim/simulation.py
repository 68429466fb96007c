"""Run a checked scenario: step, record, look up now and then, and leave a tidy folder."""

import gc
import importlib.metadata
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from . import log as logs
from . import metrics, plots
from .errors import InputError, SimulationError
from .files import write_json
from .master import Master
from .pace import Pace
from .recorder import BLOCK, Recorder
from .scenario import Scenario
from .ssv import read_parameters
from .system import System, prepare

# Wall time between two looks at the progress bar, and two writes to the log [s].
ATTENTION = 0.2


@dataclass
class Result:
    """How a run ended and what it left.

    Attributes:
        status: ``done``, ``failed`` or ``interrupted``.
        folder: where log, metrics and pictures are.
        rows: number of logged rows.
        message: why it failed; empty otherwise.
        metrics: as in metrics.json; empty if the log lacks the columns for them.
        warnings: what was odd.
        pace: with ``realtime``: how well the wall clock was kept.
    """

    status: str
    folder: Path
    rows: int = 0
    message: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    pace: dict[str, float] = field(default_factory=dict)


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Turns Ctrl-C and a termination request into a flag that the loop reads between steps.

    An exception would surface inside whatever FMU happens to run. A second one, of any kind, acts as
    Ctrl-C usually does.
    """
    asked = False

    def ask(number: int, frame: Any) -> None:
        nonlocal asked
        asked = True
        for each in numbers:
            signal.signal(each, signal.default_int_handler)

    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    numbers = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
    previous = {number: signal.signal(number, ask) for number in numbers}
    try:
        yield lambda: asked
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


@contextmanager
def quiet_collector() -> Iterator[None]:
    """No garbage collection while stepping, but where the caller asks for it.

    What exists now is not looked through again, so that asking is cheap.
    """
    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_enabled:
            gc.enable()


def simulate(
    scenario: Scenario,
    out: str | Path | None = None,
    parameters: Sequence[str | Path] = (),
    realtime: float | None = None,
    pictures: bool = False,
    native: bool = True,
    show: Callable[[str], None] = lambda _: None,
    progress: Callable[[float], None] = lambda _: None,
) -> Result:
    """Run a scenario and write its log, metrics and pictures.

    Args:
        scenario: from :func:`cosim.load_scenario`.
        out: result folder; default ``results/<name>`` in the working directory.
        parameters: SSP parameter sets that beat the scenario's values.
        realtime: simulated seconds per second of wall time; None runs as fast as it can.
        pictures: whether to draw.
        native: whether FMUs may hold programs that were not built on this computer.
        show: receives warnings and messages, a line each.
        progress: receives the simulated time [s] now and then.

    Returns:
        How it ended. A failed or interrupted run keeps its log.

    Raises:
        InputError: the scenario cannot be run; nothing has been written.
    """
    if realtime is not None and not 0.0 < realtime < math.inf:
        raise InputError(f"realtime is a positive factor, not {realtime:g}")
    overrides = [(Path(p), read_parameters(Path(p))) for p in parameters]
    # FMUs may go to another folder, and are not followed there.
    here = os.getcwd()
    given = Path(out) if out is not None else Path("results") / scenario.name
    folder = Path(os.path.abspath(given))
    system = prepare(scenario, overrides, native)
    try:
        for note in scenario.notes:
            show(f"note: {note}")
        for warning in system.warnings:
            show(f"warning: {warning}")
        if scenario.log.format == "parquet" and find_spec("pyarrow") is None:
            raise InputError("log.format = parquet needs pyarrow: pip install 'cybership[parquet]'")
        try:
            master = Master(system, lambda text: show(f"warning: {text}"))
        except SimulationError as error:
            _clear(folder, show)
            failure = {**_describe(system), "status": "failed", "rows": 0, "message": str(error)}
            write_json(folder / logs.SIDECAR, failure)
            return Result("failed", given, message=str(error), warnings=system.warnings)
        try:
            _clear(folder, show)
            result, recorder = _record(system, master, folder, realtime, progress)
        finally:
            master.close()
    finally:
        system.close()
        os.chdir(here)
    _finish(system, result, recorder, pictures, show)
    result.folder = given
    return result


def _clear(folder: Path, show: Callable[[str], None]) -> None:
    """Make the result folder, without what an earlier run left there."""
    try:
        if (folder / logs.SIDECAR).exists():
            show(f"note: replaces the earlier run in '{folder}'")
        folder.mkdir(parents=True, exist_ok=True)
        for name in (
            logs.CSV,
            logs.PARQUET,
            logs.SIDECAR,
            logs.METRICS,
            *(f"{p}.png" for p in plots.PICTURES),
        ):
            (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to '{folder}': {error.strerror}") from None


def _record(
    system: System,
    master: Master,
    folder: Path,
    realtime: float | None,
    progress: Callable[[float], None],
) -> tuple[Result, Recorder]:
    """The run itself; returns how it ended, and what was recorded."""
    result = Result("running", folder, warnings=system.warnings)
    sidecar = _describe(system)
    try:
        write_json(folder / logs.SIDECAR, {**sidecar, "status": "running"})
        recorder = Recorder(system, master, folder)
    except OSError as error:
        raise InputError(f"cannot write to '{folder}': {error.strerror}") from None
    pace: Pace | None = None
    result.status = "failed"  # whatever may end it, until it is known better
    try:
        with interruptible() as interrupted:
            try:
                with quiet_collector():
                    # Not before: collecting what is there takes several steps' time.
                    pace = (
                        None if realtime is None else Pace(realtime, system.scenario.step, interrupted)
                    )
                    stopped = _loop(system, master, recorder, pace, interrupted, progress)
                result.status = "interrupted" if stopped else "done"
            except (SimulationError, OSError, KeyboardInterrupt) as error:
                # Whoever asks twice may hit an FMU in the middle of its step.
                result.status = "interrupted" if interrupted() else "failed"
                result.message = str(error)
    finally:
        with suppress(SimulationError, OSError):
            recorder.flush()
        recorder.close()
        result.rows = sidecar["rows"] = recorder.rows
        if pace is not None:
            result.pace = sidecar["realtime"] = pace.summary()
        sidecar["messages"] = [
            {"instance": m.instance, "status": m.status, "text": m.text} for m in master.messages.kept
        ]
        if result.message:
            sidecar["message"] = result.message
        with _disk(result):
            write_json(folder / logs.SIDECAR, {**sidecar, "status": result.status})
    return result, recorder


@contextmanager
def _disk(result: Result) -> Iterator[None]:
    """What cannot be written any more makes a run a failed one, which keeps what there is."""
    try:
        yield
    except OSError as error:
        result.status = "failed"
        result.message = result.message or f"cannot write to '{result.folder}': {error.strerror}"


def _loop(
    system: System,
    master: Master,
    recorder: Recorder,
    pace: Pace | None,
    interrupted: Callable[[], bool],
    progress: Callable[[float], None],
) -> bool:
    """Step, record, and look up now and then; returns whether the user stopped it."""
    recorder.take(0.0)
    take = recorder.take
    left = interval = 1  # steps to the next look at the clock
    glance = flushed = time.perf_counter()
    for t in master.run():
        full = take(t)
        if pace is not None:
            pace.wait(t)
        left -= 1
        if left and not full:
            continue
        now = time.perf_counter()
        if full or now - flushed > ATTENTION:
            recorder.flush()
            gc.collect()
            progress(t)
            flushed = now
        if interrupted():
            recorder.flush()
            return True
        # Quick steps need no look at the clock after each of them.
        interval = min(2 * interval, BLOCK // 8) if now - glance < 0.1 * ATTENTION else 1
        glance, left = now, interval
    recorder.flush()
    progress(system.scenario.stop)
    return False


def _describe(system: System) -> dict[str, Any]:
    """What log.json says of a run: columns, FMUs, the scenario as it was understood, versions."""
    columns: dict[str, dict[str, str]] = {"time": {"unit": "s", "description": "simulated time"}}
    for name in system.logged:
        variable = system.signals[name].variable
        columns[name] = {
            "unit": variable.unit.name if variable.unit is not None else "",
            "description": variable.description,
        }
    resolved = system.scenario.model_dump(mode="json", by_alias=True)
    resolved["connections"] = [[c.source.name, c.target.name] for c in system.connections]
    for name, values in system.parameters.items():
        resolved["fmus"][name]["parameters"] = {v.name: value for v, value in values}
        resolved["fmus"][name]["table"] = None  # its values are among the parameters
    return {
        "columns": columns,
        "fmus": {
            name: {
                "path": str(model.path),
                "model": model.name,
                "guid": model.description.guid,
                "sha256": model.sha256,
            }
            for name, model in system.models.items()
        },
        "order": system.order,
        "scenario": resolved,
        "seed": system.scenario.seed,
        "versions": {name: importlib.metadata.version(name) for name in ("cybership", "fmpy", "numpy")},
        "notes": system.scenario.notes,
        "warnings": system.warnings,
    }


def _finish(
    system: System,
    result: Result,
    recorder: Recorder,
    pictures: bool,
    show: Callable[[str], None],
) -> None:
    """Metrics, pictures and the log's final format."""
    window = system.scenario.metrics
    columns = recorder.kept()
    try:
        result.metrics = metrics.compute(columns, window.start, window.stop)
        with _disk(result):
            write_json(result.folder / logs.METRICS, result.metrics)
    except metrics.MetricsError as error:
        show(f"note: no metrics: {error}")
    if pictures and result.status != "interrupted":
        with _disk(result):
            runs = {system.scenario.name: columns}
            drawn = plots.draw(runs, result.folder, window.start, window.stop)
            missing = plots.PICTURES.keys() - {path.stem for path in drawn}
            if missing:
                show(f"note: the log lacks columns to draw {', '.join(sorted(missing))}")
    if system.scenario.log.format == "parquet" and result.status == "done":
        with _disk(result):
            logs.to_parquet(result.folder)
