"""How a run ended, and what is written once its steps are done."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, nearest, not_written
from ..files import update_json, write_json
from ..results import log as logs
from ..results import performance
from ..results.picture_files import Drawn
from ..results.run_options import RunOptions, read_options
from ..system.system import System
from ..trials.trial_outcome import TrialOutcome, outcome_of_log
from .loop_surroundings import paused_collector
from .recorder import Recorder

if TYPE_CHECKING:
    import pandas

TRIAL = "trial"  # name of a trial's picture


@dataclass(repr=False)
class Result:
    """How a run ended, and its results.

    Attributes:
        status: ``done``, ``failed`` or ``interrupted``.
        folder: where log, metrics and pictures are.
        rows: number of logged rows.
        message: why it failed; empty otherwise.
        metrics: as in metrics.json; empty if the system lacks the signals for them.
        warnings: doubts that did not stop the run.
        pace: with ``realtime``: lateness and missed deadlines.
        loop: which step loop ran, ``compiled`` or ``plain``; empty if none did.
        loop_reason: why it was the plain one.
        native: whether the project's own FMUs were compiled; None where there are none.
        trial: measures and limits where it is a manoeuvring trial; None: it is none.
    """

    status: str
    folder: Path
    rows: int = 0
    message: str = ""
    metrics: dict[str, float] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    pace: dict[str, float] = field(default_factory=dict)
    loop: str = ""
    loop_reason: str = ""
    native: bool | None = None
    trial: TrialOutcome | None = None

    def __repr__(self) -> str:
        stated = [f"{self.status}: {self.rows} rows in '{self.folder}'", self.message]
        stated += [f"{name} = {value:.4g}" for name, value in self.metrics.items()]
        return f"<run {', '.join(text for text in stated if text)}>"

    @cached_property
    def log(self) -> pandas.DataFrame:
        """The log as a table, read when it is first asked for; see :func:`cosim.log_frame`."""
        return logs.log_frame(self.folder)

    def plot(self, name: str = "trajectory") -> Drawn:
        """Draw one of the pictures of a run.

        Args:
            name: ``trajectory``, ``errors``, ``metrics``, ``forces``, ``model_error`` or
                ``commands``; ``trial`` of a manoeuvring trial.

        Returns:
            The picture, which shows itself in a notebook.

        Raises:
            InputError: no such picture, or the log lacks what it needs.
        """
        from ..results import drawing

        if name == TRIAL and self.trial is not None:
            from ..trials.trial_picture import draw_trial

            return draw_trial(self.trial)
        if name not in drawing.PICTURES:
            raise InputError(f"no picture '{name}'{nearest(name, drawing.PICTURES)}")
        label = self.folder.name
        runs = {label: logs.read_log(self.folder)}
        drawn = drawing.figures(runs, {label: read_options(self.folder)}, [name])
        for _, figure in drawn:
            return Drawn(figure)
        raise InputError(f"the log in '{self.folder}' lacks columns to draw {name}")


@contextmanager
def writing(result: Result) -> Iterator[None]:
    """A file that cannot be written makes the run a failed one; what was written is kept."""
    try:
        yield
    except OSError as error:
        result.status = "failed"
        result.message = result.message or not_written(result.folder, error)


def interrupted_late(result: Result) -> None:
    """A run whose log is whole becomes an interrupted one: the request came behind its last step."""
    if result.status == "done":
        result.status = "interrupted"
        with writing(result):
            path = result.folder / logs.SIDECAR
            update_json(path, json.loads(path.read_text("utf-8")), {"status": result.status})


def trial_of(system: System, columns: logs.Log) -> TrialOutcome | None:
    """The manoeuvring trial that a run is, measured; None: it is none.

    Raises:
        MetricsError: the order under trial never changes, or a column is missing.
    """
    if system.trial is None:
        return None
    window, roles = system.scenario.metrics, system.scenario.roles
    length = 0.0 if system.outline is None else system.outline.length
    return outcome_of_log(columns, system.trial, roles, length, window.start, window.stop)


def metrics_of(system: System, columns: logs.Log, trial: TrialOutcome | None) -> dict[str, float]:
    """What metrics.json holds: the measures of a trial, or the performance.

    Raises:
        MetricsError: it cannot be computed.
    """
    if trial is not None:
        return dict(trial.measures)
    window = system.scenario.metrics
    return performance.compute(columns, window.start, window.stop, system.scenario.roles)


def finish(
    system: System,
    result: Result,
    recorder: Recorder,
    draw: bool,
    show: Callable[[str], None],
    measured: Callable[[dict[str, float]], None],
) -> None:
    """Write metrics, tell them by ``measured``, and write pictures and the log's final format."""
    window, roles = system.scenario.metrics, system.scenario.roles
    columns = recorder.kept()
    try:
        result.trial = trial_of(system, columns)
        result.metrics = metrics_of(system, columns, result.trial)
        with writing(result):
            write_json(result.folder / logs.METRICS, result.metrics)
            if result.trial is not None:
                result.trial.write(result.folder)
    except performance.MetricsError as error:
        show(f"note: no metrics: {error}")
    else:
        measured(result.metrics)
    if draw and result.status != "interrupted":
        from ..results import drawing

        with paused_collector(), writing(result):  # figures are many small objects, and short-lived
            runs = {system.scenario.name: columns}
            stated = RunOptions(
                window.start, window.stop, roles, system.outline, commands=system.commands
            )
            drawn = drawing.draw(runs, result.folder, {system.scenario.name: stated})
            missing = drawing.PICTURES.keys() - {path.stem for path in drawn} - {drawing.COMMANDS}
            if result.trial is not None:
                from ..trials.trial_picture import write_picture

                write_picture(result.trial, result.folder)
            elif missing:
                show(f"note: the log lacks columns to draw {', '.join(sorted(missing))}")
    if system.scenario.log.format == "parquet" and result.status == "done":
        with writing(result):
            logs.to_parquet(result.folder)
