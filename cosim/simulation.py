"""Run a checked scenario: step, record, look up now and then, and leave a tidy folder."""

import importlib.metadata
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from . import log as logs
from . import metrics, plots
from .errors import InputError, SimulationError
from .master import Master, quiet_collector
from .scenario import Scenario
from .ssv import read_parameters
from .system import System, prepare

BLOCK = 256
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


@dataclass
class Pace:
    """Keeps simulated time at a multiple of wall time, and counts how often it could not."""

    factor: float
    step: float
    started: float = field(default_factory=time.perf_counter)
    lateness: list[float] = field(default_factory=list)

    def wait(self, t: float) -> None:
        due = self.started + t / self.factor
        while (left := due - time.perf_counter()) > 0.0:
            time.sleep(min(left, 0.05))
        self.lateness.append(time.perf_counter() - due)

    def summary(self) -> dict[str, float]:
        late = np.array(self.lateness or [0.0])
        deadline = self.step / self.factor
        return {
            "factor": self.factor,
            "deadline_misses": int((late > deadline).sum()),
            "lateness_max": float(late.max()),
            "jitter_rms": float(late.std()),
        }


class Recorder:
    """Collects rows in blocks and writes them out; keeps the columns that metrics and pictures use."""

    def __init__(self, system: System, master: Master, folder: Path) -> None:
        self.columns = ["time", *system.logged]
        self._writer = logs.LogWriter(folder / logs.CSV, self.columns)
        self._slots = np.array([master.table.slots[name] for name in system.logged], dtype=np.intp)
        self._whole = np.array_equal(self._slots, np.arange(len(master.table.row)))
        self._row = master.table.row
        self._outputs = np.array(master.output_slots, dtype=np.intp)
        self._names = [s.name for s in master.table.signals]
        self._block = np.empty((BLOCK, len(self.columns)))
        self._check = np.empty((BLOCK, len(self._outputs)))
        self._times = np.empty(BLOCK)
        self._logged = 0
        self._checked = 0
        self._kept_columns = [self.columns.index(name) for name in metrics.needed(self.columns)]
        self._kept: list[np.ndarray] = []
        self.rows = 0

    def check(self, t: float) -> None:
        """Remember the outputs of this step for the check that they are finite."""
        self._row.take(self._outputs, out=self._check[self._checked])
        self._times[self._checked] = t
        self._checked += 1

    def record(self, t: float) -> None:
        """Take the present row of the table into the log."""
        row = self._block[self._logged]
        row[0] = t
        if self._whole:
            row[1:] = self._row
        else:
            self._row.take(self._slots, out=row[1:])
        self._logged += 1

    @property
    def full(self) -> bool:
        return self._checked == BLOCK

    def flush(self) -> None:
        """Write what has been collected.

        Raises:
            SimulationError: an output is not finite; the rows up to there are written.
        """
        block = self._block[: self._logged]
        wrong = ~np.isfinite(self._check[: self._checked])
        message = ""
        if wrong.any():
            k = int(np.argmax(wrong.any(axis=1)))
            t = self._times[k]
            name = self._names[self._outputs[int(np.argmax(wrong[k]))]]
            message = f"{name} is not finite at t = {t:g} s"
            block = block[block[:, 0] <= t]
        self._writer.write(np.ascontiguousarray(block))
        self._kept.append(block[:, self._kept_columns].copy())
        self.rows += len(block)
        self._logged = self._checked = 0
        if message:
            raise SimulationError(message)

    def close(self) -> None:
        self._writer.close()

    def kept(self) -> dict[str, np.ndarray]:
        """The columns that metrics and pictures use."""
        table = np.concatenate(self._kept) if self._kept else np.empty((0, len(self._kept_columns)))
        return {self.columns[c]: table[:, k] for k, c in enumerate(self._kept_columns)}


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Turns Ctrl-C and a termination request into a flag that the loop reads between steps.

    An exception would surface inside whatever FMU happens to run. A second Ctrl-C acts as usual.
    """
    asked = False

    def ask(number: int, frame: Any) -> None:
        nonlocal asked
        asked = True
        signal.signal(number, signal.default_int_handler)

    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    previous = {n: signal.signal(n, ask) for n in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: asked
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def simulate(
    scenario: Scenario,
    out: str | Path | None = None,
    parameters: Sequence[str | Path] = (),
    realtime: float | None = None,
    pictures: bool = False,
    show: Callable[[str], None] = lambda text: None,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Run a scenario and write its log, metrics and pictures.

    Args:
        scenario: from :func:`cosim.load_scenario`.
        out: result folder; default ``results/<name>`` in the working directory.
        parameters: SSP parameter sets that beat the scenario's values.
        realtime: simulated seconds per second of wall time; None runs as fast as it can.
        pictures: whether to draw.
        show: receives warnings and messages, a line each.
        progress: receives the simulated time [s] now and then.

    Returns:
        How it ended. A failed or interrupted run keeps its log.

    Raises:
        InputError: the scenario cannot be run; nothing has been written.
    """
    overrides = [(Path(p), read_parameters(Path(p))) for p in parameters]
    system = prepare(scenario, overrides)
    try:
        for warning in system.warnings:
            show(f"warning: {warning}")
        if scenario.log.format == "parquet" and find_spec("pyarrow") is None:
            raise InputError("log.format = parquet needs pyarrow: pip install 'cybership[parquet]'")
        try:
            master = Master(system, lambda text: show(f"warning: {text}"))
        except SimulationError as error:
            return Result("failed", Path(), message=str(error), warnings=system.warnings)
        try:
            folder = _fresh_folder(Path(out) if out is not None else Path("results") / scenario.name)
            result, columns = _record(system, master, folder, realtime, progress)
        finally:
            master.close()
    finally:
        system.close()
    _finish(system, result, columns, pictures, show)
    return result


def _fresh_folder(folder: Path) -> Path:
    """The result folder, without what an earlier run left there."""
    try:
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
    return folder


def _record(
    system: System,
    master: Master,
    folder: Path,
    realtime: float | None,
    progress: Callable[[float], None] | None,
) -> tuple[Result, dict[str, np.ndarray]]:
    """The run itself; returns how it ended and the columns kept for metrics and pictures."""
    result = Result("running", folder, warnings=system.warnings)
    sidecar = _describe(system)
    logs.write_json(folder / logs.SIDECAR, {**sidecar, "status": "running"})
    recorder = Recorder(system, master, folder)
    pace = Pace(realtime, system.scenario.step) if realtime else None
    try:
        with interruptible() as interrupted, quiet_collector():
            stopped = _loop(system, master, recorder, pace, interrupted, progress)
        result.status = "interrupted" if stopped else "done"
    except (SimulationError, OSError) as error:
        with suppress(SimulationError, OSError):
            recorder.flush()
        result.status, result.message = "failed", str(error)
    finally:
        recorder.close()
        result.rows = recorder.rows
        if pace is not None:
            result.pace = pace.summary()
            sidecar["realtime"] = result.pace
        sidecar["rows"] = result.rows
        sidecar["messages"] = [
            {"instance": m.instance, "status": m.status, "text": m.text} for m in master.messages.kept
        ]
        if result.message:
            sidecar["message"] = result.message
        logs.write_json(folder / logs.SIDECAR, {**sidecar, "status": result.status})
    return result, recorder.kept()


def _loop(
    system: System,
    master: Master,
    recorder: Recorder,
    pace: Pace | None,
    interrupted: Callable[[], bool],
    progress: Callable[[float], None] | None,
) -> bool:
    """Step, record, and look up now and then; returns whether the user stopped it."""
    every = system.scenario.log.every
    recorder.check(0.0)
    recorder.record(0.0)
    look = 1
    glance = time.perf_counter()
    for k in master.run():
        t = master.time(k)
        recorder.check(t)
        if k % every == 0:
            recorder.record(t)
        if pace is not None:
            pace.wait(t)
        if k >= look or recorder.full:
            now = time.perf_counter()
            # The next look comes after about a fifth of a second, at most one block later.
            per_step = max(now - glance, 1e-6) / max(1, k - look + 1)
            if now - glance > ATTENTION or recorder.full:
                recorder.flush()
                glance = now
                if progress is not None:
                    progress(t)
            if interrupted():
                recorder.flush()
                return True
            look = k + max(1, min(BLOCK // 8, int(0.02 / per_step)))
    recorder.flush()
    if progress is not None:
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
        "warnings": system.warnings,
    }


def _finish(
    system: System,
    result: Result,
    columns: dict[str, np.ndarray],
    pictures: bool,
    show: Callable[[str], None],
) -> None:
    """Metrics, pictures and the log's final format."""
    options = system.scenario.metrics
    try:
        result.metrics = metrics.compute(columns, options.start, options.stop)
        logs.write_json(result.folder / logs.METRICS, result.metrics)
    except metrics.MetricsError as error:
        show(f"note: no metrics: {error}")
    if pictures and result.status != "interrupted":
        plots.draw({system.scenario.name: columns}, result.folder)
    if system.scenario.log.format == "parquet" and result.status == "done":
        logs.to_parquet(result.folder)
