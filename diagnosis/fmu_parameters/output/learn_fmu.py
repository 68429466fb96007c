"""``learn`` with an FMU whose own parameters are calibrated."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

from ...execution.progress import Advance
from ...execution.result_folder import together
from ...predictors import WRITTEN, Execution
from ...predictors.predictor import FOUND, MAP
from ..residuals import WindowResiduals
from ..sensitivity import refuse_unknown, sensitivities
from ..ship_task import ship_task
from ..system_calibration import calibrate
from ..system_task import SystemTask, system_task
from .system_content import FILES, CalibrationReport
from .system_plots import plots_of

OTHERS = ("comparison.json", "calibrated.ssv", "calibrated.json", "coefficients.csv", "coefficients.tex")


def learn_system(
    options: argparse.Namespace, advance: Advance, origin: dict[str, str], execution: Execution
) -> CalibrationReport:
    """Calibrate the FMU of any system, and write the result.

    Args:
        options: of the command.
        advance: receives the name of each step.
        origin: what the result was made with.
        execution: how the FMU is run.

    Raises:
        InputError: FMU, map, parameters or runs are not as they should be.
    """
    runs = {use: getattr(options, use) for use in ("train", "validate", "test")}
    task = system_task(options.model, options.map, runs, options.parameters, options.horizon, execution)
    try:
        parts = task.residuals()
        train = parts["train"]
        if options.parameters is None and task.parameters:
            _only_known(task, parts, advance)
        result = calibrate(parts, task.possible, task.names, task.units, task.usual, advance)
        use = {r.name: u for u, every in task.runs.items() for r in every}
        content = task.map.model_dump(exclude_none=True)
        units = dict(zip(task.names, task.units, strict=True))
        report = CalibrationReport(result, task.confined, content, use, train.samples, units, task.notes)
        return written(report, options.out, origin, parts, task.names, advance)
    finally:
        task.close()


def written(
    report: CalibrationReport,
    out: Path,
    origin: dict[str, str],
    parts: Mapping[str, WindowResiduals],
    names: Sequence[str],
    advance: Advance,
) -> CalibrationReport:
    """Write a report; files of an older result go away."""
    advance("report")
    found = report.result
    with together(out, [*dict.fromkeys((*FILES, *OTHERS, *WRITTEN))]) as new:
        if found.changed and found.forces:
            from .found_fmu import write_found  # only now: it takes a while to import

            values = {v.parameter.name: v.value for v in found.values}
            forces, h = [a.force for a in found.forces], parts["train"].windows[0].course.h
            report.notes.append(write_found(new, report.model, report.map, values, forces, h))
            report.files.extend(name for name in (FOUND, MAP) if (new / name).exists())
        report.write(new, origin, plots_of(parts, report.result, names))
    return report


def _only_known(task: SystemTask, parts: Mapping[str, WindowResiduals], advance: Advance) -> None:
    """Leave to be calibrated what the runs can tell, within the range in which the FMU works.

    Raises:
        InputError: they can tell nothing.
    """
    found = sensitivities(parts["train"], advance)
    refuse_unknown(found)
    task.notes += [s.fault for s in found.each if s.fault]
    if untold := [s.parameter.name for s in found.each if not s.known]:
        task.notes.append(
            f"Not identifiable from these runs: {', '.join(untold)}; kept at the start value."
        )
    task.parameters = [s.parameter for s in found.each if s.known]
    for part in parts.values():
        part.choose(task.parameters)


def learn_ship(
    options: argparse.Namespace, advance: Advance, origin: dict[str, str], execution: Execution
) -> CalibrationReport:
    """Calibrate the FMU of a ship, and write the result; arguments as of :func:`learn_system`."""
    runs = {use: getattr(options, use) for use in ("train", "validate", "test")}
    task = ship_task(options, runs, advance, execution)
    try:
        parts = task.residuals()
        train = parts["train"]
        result = calibrate(parts, task.possible, task.names, task.units, task.usual, advance)
        use = {w.run.name: u for u, every in task.runs.items() for w in every}
        content, units = task.predictor.given.content(), dict(zip(task.names, task.units, strict=True))
        confined, notes = task.confined, task.notes
        report = CalibrationReport(result, confined, content, use, train.samples, units, notes)
        return written(report, options.out, origin, parts, task.names, advance)
    finally:
        task.close()
