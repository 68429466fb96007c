"""``learn`` with an FMU whose own parameters are calibrated."""

import argparse
from collections.abc import Mapping
from contextlib import closing

from cosim import InputError

from ...execution.progress import Advance
from ...execution.result_folder import together
from ...predictors import WRITTEN, Execution
from ...predictors.predictor import FOUND, MAP
from ..calibration_task import CalibrationTask
from ..residuals import WindowResiduals
from ..sensitivity import sensitivities
from ..ship_task import ship_task
from ..system_calibration import calibrate
from ..system_task import is_system, system_task
from .system_content import FILES, CalibrationReport, plots_of

OTHERS = ("comparison.json", "calibrated.ssv", "calibrated.json", "coefficients.csv", "coefficients.tex")


def learn_fmu(
    options: argparse.Namespace,
    advance: Advance,
    origin: dict[str, str],
    execution: Execution,
    made_of: Mapping[str, object],
) -> CalibrationReport:
    """Calibrate the FMU of a ship or of any other system, and write the result.

    Files of an older result go away.

    Args:
        options: of the command.
        advance: receives the name of each step.
        origin: what the result was made with.
        execution: how the FMU is run.
        made_of: files and options, for ``cybership next``.

    Raises:
        InputError: FMU, map, parameters or runs are not as they should be.
    """
    runs = {use: getattr(options, use) for use in ("train", "validate", "test")}
    task: CalibrationTask
    if is_system(options.train, options.map):
        task = system_task(
            options.model, options.map, runs, options.parameters, options.horizon, execution
        )
    else:
        task = ship_task(options, runs, advance, execution)
    with closing(task):
        parts = task.residuals()
        if options.parameters is None and task.parameters:
            _only_known(task, parts, advance)
        result = calibrate(parts, task.possible, task.names, task.units, task.usual, advance)
        report = CalibrationReport(result, task, parts["train"].samples, made_of)
        advance("report")
        with together(options.out, [*dict.fromkeys((*FILES, *OTHERS, *WRITTEN))]) as new:
            if result.changed and result.forces:
                from .found_fmu import write_found  # only now: it takes a while to import

                values = {v.parameter.name: v.value for v in result.values}
                forces, h = [a.force for a in result.forces], parts["train"].windows[0].course.h
                model = task.confined.model
                task.notes.append(write_found(new, model, task.content, values, forces, h))
                report.files.extend(name for name in (FOUND, MAP) if (new / name).exists())
            report.write(new, origin, plots_of(parts, result, task.names))
        return report


def _only_known(task: CalibrationTask, parts: Mapping[str, WindowResiduals], advance: Advance) -> None:
    """Leave to be calibrated what the runs can tell, within the range in which the FMU works."""
    found = sensitivities(parts["train"], advance)
    if not any(s.known for s in found.each):
        raise InputError(
            "the runs do not identify any parameter: no output changes by more than its noise"
        )
    task.notes += [s.fault for s in found.each if s.fault]
    if untold := [s.parameter.name for s in found.each if not s.known]:
        task.notes.append(
            f"Not identifiable from these runs: {', '.join(untold)}; kept at the start value."
        )
    task.parameters = [s.parameter for s in found.each if s.known]
    for part in parts.values():
        part.choose(task.parameters)
