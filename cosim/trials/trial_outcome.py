"""What a manoeuvring trial came to: its measures, and what the resolution allows of them."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table

from ..errors import InputError
from ..files import write_json
from ..formats.outline import AnnotatedTrial
from ..results.log import TRIAL, Log, read_log
from ..results.performance import MetricsError
from ..results.run_options import read_options
from ..scenario.roles import Roles
from .measures import MEASURES, limits, measure
from .ship_passage import Passage, executes, passage

APPROACH = {"approach_speed"}  # what is measured before the order does anything
NOTHING = (
    "no further measures: the run is too short, or the order does not make the manoeuvre of this trial"
)
LIMITS = "IMO limit: resolution MSC.137(76), for ships of 100 m or more"
DEGREES = {"rad": "°", "rad/s": "°/s"}  # how angles are shown


class TrialOutcome(NamedTuple):
    """A trial, measured.

    Attributes:
        kind: of the trial, such as ``zigzag``.
        passage: of the ship.
        length: of the ship [m]; 0: not known.
        measures: by name, in SI; see :data:`~cosim.trials.measures.MEASURES`.
        limits: of some of them, by name; see :func:`~cosim.trials.measures.limits`.
    """

    kind: str
    passage: Passage
    length: float
    measures: Mapping[str, float]
    limits: Mapping[str, float]

    def content(self) -> dict[str, Any]:
        """What ``trial.json`` holds."""
        return {
            "trial": self.kind,
            "length": self.length or None,
            "executes": executes(self.passage),
            "measures": dict(self.measures),
            "limits": dict(self.limits),
            "units": {m.name: m.unit for m in MEASURES if m.name in self.measures},
        }

    @property
    def without_limit(self) -> list[str]:
        """A sentence on a check angle for which the resolution has no limits; else none."""
        check = self.measures.get("check_angle")
        if check is None or not self.length or any(name.startswith("overshoot") for name in self.limits):
            return []
        angle = f"{math.degrees(check):.3g}°"
        return [f"no IMO limit at a check angle of {angle}, but at 10° and 20°"]

    @property
    def short_approach(self) -> list[str]:
        """A sentence on an approach in which its speed and heading are not known; else none."""
        way = self.passage.along(self.passage.time[0], executes(self.passage)[0])
        if way >= self.length:
            return []
        return [
            f"only {way:.3g} m before the first execute: initial heading and speed need one ship "
            f"length, {self.length:.3g} m; begin the trial earlier"
        ]

    def write(self, folder: Path) -> None:
        """Write ``trial.json``."""
        write_json(folder / TRIAL, self.content())


def outcome(kind: str, p: Passage, length: float) -> TrialOutcome:
    """Measure a trial.

    Args:
        kind: of the trial.
        p: the ship under trial.
        length: of the ship [m]; 0: not known.

    Raises:
        InputError: no such trial, or no order.
    """
    found = measure(kind, p, length)
    return TrialOutcome(kind, p, length, found, limits(found, length) if length > 0.0 else {})


def outcome_of_log(
    log: Log, trial: AnnotatedTrial, roles: Roles, length: float, start: float | None, stop: float | None
) -> TrialOutcome:
    """Measure a trial in a log.

    Args:
        log: at least time, pose and order.
        trial: its kind, and the column of its order.
        roles: columns of the pose.
        length: of the ship [m]; 0: not known.
        start, stop: first and last time used [s]; None: all.

    Raises:
        MetricsError: a column is missing, or it is no trial.
    """
    missing = [name for name in (*roles.pose, trial.order) if name not in log]
    if missing:
        raise MetricsError(f"the log lacks {', '.join(missing)}")
    low, high = (-math.inf if start is None else start), (math.inf if stop is None else stop)
    chosen = (log["time"] >= low) & (log["time"] <= high)
    try:
        columns = [log[name][chosen] for name in ("time", *roles.pose, trial.order)]
        return outcome(trial.kind, passage(*columns), length)
    except InputError as error:
        raise MetricsError(str(error)) from None


def simulated_trial(folder: Path, start: float | None, stop: float | None) -> TrialOutcome:
    """The trial that a finished run is.

    Args:
        folder: of the run.
        start, stop: first and last time used [s]; None: as its scenario says.

    Raises:
        InputError: it is none, or its log cannot be read or lacks a column.
    """
    run = read_options(folder)
    if run.trial is None:
        raise InputError(f"'{folder}' is not a run of a manoeuvring trial")
    start, stop = (run.start if start is None else start), (run.stop if stop is None else stop)
    log = read_log(folder, [*run.roles.pose, run.trial.order])
    length = 0.0 if run.outline is None else run.outline.length
    try:
        return outcome_of_log(log, run.trial, run.roles, length, start, stop)
    except MetricsError as error:
        raise InputError(str(error)) from None


def sheet(found: TrialOutcome, title: str = "") -> Table:
    """A trial for the terminal, as in a trial report: angles in degrees, distances also in lengths."""
    shown = Table(title=title or f"Trial: {found.kind}", title_justify="left", box=None, pad_edge=False)
    notes = [NOTHING] if found.measures.keys() <= APPROACH else [LIMITS] if found.limits else []
    notes += [*found.without_limit, *found.short_approach]
    shown.caption, shown.caption_justify = "\n".join(notes) or None, "left"
    shown.add_column("measure", style="bold", no_wrap=True)
    for name in ("value", "unit", "in L", "IMO limit"):
        shown.add_column(name, justify="left" if name == "unit" else "right", no_wrap=True)
    shown.add_column("meaning")
    for name, unit, meaning in MEASURES:
        if name not in found.measures:
            continue
        value, limit = found.measures[name], found.limits.get(name)
        in_lengths = f"{value / found.length:.2f}" if unit == "m" and found.length > 0.0 else ""
        factor = math.degrees(1.0) if unit in DEGREES else 1.0
        shown.add_row(
            name,
            f"{factor * value:.4g}",
            DEGREES.get(unit, unit),
            in_lengths,
            "" if limit is None else _limited(value, limit, factor, DEGREES.get(unit, unit)),
            meaning,
        )
    return shown


def _limited(value: float, limit: float, factor: float, unit: str) -> str:
    """A limit in a unit, and whether a value exceeds it."""
    return f"{factor * limit:.4g} {unit}" + ", exceeded" * (value > limit)
