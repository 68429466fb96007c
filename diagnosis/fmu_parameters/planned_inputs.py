"""Inputs over time that determine the parameters of an FMU best (D-optimality).

Each input that the runs drive gets a course from its lowest to its highest measured value: steps, waves,
or a constant. The slopes of the outputs by the parameters, simulated with the FMU at the fitted values
from where the first run began, give the information of a course; that of all runs so far is added.
"""

import time
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import qmc

from cosim import InputError

from ..design.designing import SECONDS
from ..design.information import Hypothesis, Knowledge, a_optimal, d_optimal
from ..design.run_files import commands_file
from ..design.run_plan import JSON, PAGE
from ..execution.progress import Advance, silent
from ..execution.result_folder import together
from ..report.formatting import write_json
from ..runs.cleaning import Z95
from ..search.nonlinear.multistart import POINTS
from .measured_system import MeasuredRun, windows_of
from .residuals import Setting, WindowResiduals
from .sensitivity import confounded
from .system_task import SystemTask

COURSE = ("form", "least value", "largest value", "period")  # of an input, by a number each
SHORTEST, LONGEST = 0.02, 0.5  # 1, of the length of a run: period of a course; chosen


@dataclass(frozen=True, eq=False)
class FmuRun:
    """A designed run of an FMU.

    Attributes:
        time, inputs: (n,) [s], and column -> values (n,).
        before, after: what is known without it, and with it.
        together: parameters that are known only together after it.
    """

    time: np.ndarray
    inputs: Mapping[str, np.ndarray]
    before: Knowledge
    after: Knowledge
    together: Sequence[Sequence[str]]

    def content(self, number: int) -> dict[str, Any]:
        """For ``next.json``; there is no scenario, and one candidate that is certain already."""
        gram = self.after.G - self.before.G
        criteria = {"d-optimal": d_optimal(self.before, gram), "a-optimal": a_optimal(self.before, gram)}
        return {
            "scenario": None,
            "commands": commands_file(number),
            "minutes": float(self.time[-1]) / 60.0,
            "sure": None,
            "criteria": criteria,
        }


@dataclass(frozen=True, eq=False)
class FmuPlan:
    """What to run next to determine the parameters of an FMU.

    Attributes:
        task: its FMU, parameters and runs.
        z: (p,), fitted values in prior standard deviations.
        runs: in their order.
        seed: by which they were found.
    """

    task: SystemTask
    z: np.ndarray
    runs: Sequence[FmuRun]
    seed: int

    def intervals(self) -> list[dict[str, Any]]:
        """Half widths of the parameters' 95 % intervals, before the runs and after each."""
        known = [self.runs[0].before, *(r.after for r in self.runs)]
        stds = [np.sqrt(np.diag(k.estimates[0].covariance)) for k in known]
        return [
            {
                "name": p.name,
                "unit": p.unit,
                "half_width": [Z95 * p.slope(z) * float(s[n]) for s in stds],
            }
            for n, (p, z) in enumerate(zip(self.task.parameters, self.z, strict=True))
        ]

    def lines(self) -> list[str]:
        """The plan for a terminal."""
        shown = ["Half of the 95 % interval of each parameter, before the designed runs and after each"]
        for row in self.intervals():
            shown.append(
                f"  {row['name']}: {', '.join(f'{x:.3g}' for x in row['half_width'])} {row['unit']}"
            )
        shown += [
            f"No input within its range determines {', '.join(g)} alone." for g in self.runs[-1].together
        ]
        return shown

    def write(self, out: Path) -> list[str]:
        """Write all files into a folder, all or none; returns their names."""
        tables = [commands_file(n) for n in range(1, len(self.runs) + 1)]
        content = {
            "runs": [r.content(n) for n, r in enumerate(self.runs, 1)],
            "inseparable": [list(g) for g in self.runs[-1].together],
            "advice": [],
            "parameters": self.intervals(),
            "criterion": "d-optimal",
            "seed": self.seed,
        }
        with together(out, [JSON, PAGE, *tables]) as new:
            for r, name in zip(self.runs, tables, strict=True):
                header = ",".join(["time", *r.inputs])
                table = np.column_stack([r.time, *r.inputs.values()])
                np.savetxt(new / name, table, "%.10g", delimiter=",", header=header, comments="")
            text = [
                "# What to run next",
                "",
                *self.lines(),
                "",
                f"Inputs over time: {', '.join(tables)}.",
            ]
            (new / PAGE).write_text("\n".join(text) + "\n", encoding="utf-8")
            write_json(new / JSON, content)
        return [JSON, PAGE, *tables]


def plan_inputs(
    task: SystemTask, z: Sequence[float], seconds: float, runs: int, seed: int, advance: Advance = silent
) -> FmuPlan:
    """Design runs of an FMU.

    Args:
        task: its runs so far, and the parameters that were fitted.
        z: of each parameter the fitted value, in prior standard deviations.
        seconds: length of a run [s].
        runs: how many, each designed after the one before.
        seed: of the courses.
        advance: progress callback.

    Raises:
        InputError: no input is driven, or the FMU fails on the runs or on every course.
    """
    if not task.map.inputs:
        raise InputError("the runs drive no input of the FMU, so no course of one can be designed")
    setting, p = Setting(tuple(z)), len(task.parameters)
    with closing(task):
        old = task.residuals()["train"]
        processes, noise, found = old.processes, old.noise, []
        rows = [_slopes(old, setting)]
        h = Hypothesis(tuple(q.name for q in task.parameters), np.arange(p), np.arange(p))
        none = np.zeros((p, p))
        k = Knowledge([h], np.ones(1), none, np.zeros(p), np.eye(p), np.zeros(p), 1.0).plus(
            rows[0].T @ rows[0]
        )
        end = time.monotonic() + SECONDS * runs
        for n in range(runs):
            best: tuple[float, MeasuredRun, np.ndarray] | None = None
            points = qmc.Sobol(len(COURSE) * len(task.map.inputs), rng=seed + n).random(POINTS)
            for tried, point in enumerate(points):
                if best is not None and time.monotonic() > end:
                    break
                advance(f"run {n + 1}: {tried} of {len(points)} courses of the inputs")
                run = course(task, point, seconds)
                windows = windows_of(run, task.map, task.confined.model, noise, task.length)
                r = WindowResiduals(processes, windows, noise, task.parameters)
                with suppress(InputError):  # the FMU fails on this course
                    J = _slopes(r, setting)
                    if np.isfinite(J).all() and (best is None or d_optimal(k, J.T @ J) > best[0]):
                        best = d_optimal(k, J.T @ J), run, J
            if best is None:
                raise InputError("the FMU fails on every course of its inputs that was tried")
            _, run, J = best
            rows.append(J)
            after, every = k.plus(J.T @ J), np.concatenate(rows)
            seen = np.flatnonzero(np.square(every).sum(axis=0) > 0.0)
            groups = confounded(every[:, seen], [task.parameters[i].name for i in seen])
            inputs = {column: run.columns[column] for column in task.map.inputs}
            found.append(FmuRun(run.time, inputs, k, after, groups))
            k = after
    return FmuPlan(task, np.array(z), found, seed)


def _slopes(r: WindowResiduals, setting: Setting) -> np.ndarray:
    r.whiten_about(setting)
    return r.slopes(setting, ())[0]


def course(task: SystemTask, point: np.ndarray, seconds: float) -> MeasuredRun:
    """The run at a point of the unit cube, COURSE for each input; outputs rest where a run began."""
    first = task.runs["train"][0]
    t = np.arange(0.0, seconds, float(np.median(np.diff(first.time))))
    outputs = {name: first.columns[name] for name in task.map.outputs}
    columns = {name: np.full(t.size, x[np.isfinite(x)][0]) for name, x in outputs.items()}
    for name, x in zip(task.map.inputs, point.reshape(-1, len(COURSE)), strict=True):
        every = np.concatenate([r.columns[name] for r in task.runs["train"]])
        low, high = np.nanmin(every), np.nanmax(every)
        ends = np.sort(low + (high - low) * x[1:3])
        period = seconds * SHORTEST * (LONGEST / SHORTEST) ** x[3]
        phase = 2.0 * np.pi * t / period
        shape = (
            np.sin(phase) if x[0] < 0.4 else np.sign(np.sin(phase)) if x[0] < 0.8 else np.ones(t.size)
        )
        columns[name] = ends.mean() + 0.5 * np.ptp(ends) * shape
    return MeasuredRun("planned run", t, columns)
