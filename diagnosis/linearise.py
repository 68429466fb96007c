"""Linearise an FMU: ``python -m diagnosis.linearise vendor.fmu --operating-point state.json``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cosim import InputError
from cosim.command import renamed_option, run_command
from cosim.errors import nearest
from cosim.scenario import json_content
from cybership.message_text import quoted

from .commands.command_line import Done, execution_of, fmu_parser, out_options, run
from .execution.progress import Advance
from .execution.result_folder import together
from .runs.run_constants import NEGLIGIBLE

if TYPE_CHECKING:
    from cosim.fmu import FmuModel

    from .fmu_parameters.system_map import SystemMap

FILES = ("linear.json", "linear.mat")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(linearise, _parser().parse_args(arguments))


def linearise(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from cosim.fmu import FmuModel

    from .fmu_parameters.linear_model import linearised, states_of
    from .fmu_parameters.parameter_file import unit_of
    from .fmu_parameters.system_map import check_map, read_system_map
    from .fmu_parameters.system_task import is_system

    model, given = FmuModel(options.fmu.absolute()), None
    of_ship = options.run is not None and not is_system([options.run], options.map)
    if options.map is not None and not of_ship:
        given = read_system_map(options.map)
        check_map(given, model, f"'{options.map}'")
    if (options.run is None) != (options.time is None):
        raise InputError("--run and --time belong together: a run, and the time in it [s]")
    states = states_of(model, given)
    if options.operating_point is not None:
        at = _read_state(options.operating_point, model)
    elif options.run is None:
        at = {}
    elif of_ship:
        at = _of_ship(options, advance)
    else:
        at = _of_run(options, model, given)
    outputs = [v.name for v in model.reals("output")]
    advance("slopes")
    found = linearised(model, states, at, outputs, execution_of(options))
    names = (*found.states, *found.inputs, *found.outputs)
    units = {n: unit_of(model.variables[n]) for n in names}
    with together(options.out, FILES) as new:
        found.write(new, units)
    roots = ", ".join(f"{x:.4g}" for x in np.linalg.eigvals(found.A))
    shown = [
        f"states: {', '.join(found.states)}; inputs: {', '.join(found.inputs) or 'none'}; "
        f"outputs: {', '.join(found.outputs)}",
        f"eigenvalues of A [1/s]: {roots}",
        *_doubt(found.doubt),
        f"Files in {options.out}: {', '.join(FILES)}",
    ]
    return Done(0, shown)


def _doubt(share: float) -> list[str]:
    """What longer steps say of rates that are differences."""
    if share <= NEGLIGIBLE:
        return []
    return [
        f"A is uncertain by {share:.0%}: its rates are differences over short steps, and steps of twice "
        "the length change them. A tighter tolerance of the FMU, or rates that it declares, are better."
    ]


def _read_state(path: Path, model: "FmuModel") -> dict[str, float]:
    """Variable -> value, of a JSON file."""
    content = json_content(path, "a state")
    if not isinstance(content, dict):
        raise InputError(f'\'{path}\' must be an object of numbers, as {{"u_0": 0.1, "tau_X": 0.5}}')
    possible = [v.name for v in model.reals() if model.can_be_set(v)]
    for name, value in content.items():
        if name not in possible:
            raise InputError(
                f"'{path}': {quoted(name)} cannot be set at the start{nearest(name, possible)}"
            )
        if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
            raise InputError(f"'{path}': {quoted(name)} must be a finite number; got {quoted(value)}")
    return {name: float(value) for name, value in content.items()}


def _of_run(
    options: argparse.Namespace, model: "FmuModel", given: "SystemMap | None"
) -> Mapping[str, float]:
    """Start values and inputs at a time of a measured run."""
    from .fmu_parameters.measured_system import MeasuredRun, columns_of, noises, read_runs, windows_of
    from .fmu_parameters.system_map import map_by_names

    given = given or map_by_names(model, columns_of(options.run), f"'{options.run}'")
    (whole,) = read_runs([options.run], [*given.inputs, *given.outputs])
    rows = whole.time >= options.time
    rest = MeasuredRun(whole.name, whole.time[rows], {n: x[rows] for n, x in whole.columns.items()})
    if not whole.time[0] <= options.time <= whole.time[-1] or rest.time.size < 2:
        ends = f"{whole.time[0]:g} to {whole.time[-1]:g} s"
        raise InputError(f"--time {options.time:g} must lie in the run '{whole.name}', {ends}")
    window, *_ = windows_of(rest, given, model, noises([whole], given), None)
    inputs = zip((c.name for c in given.inputs.values()), window.course.inputs[0].tolist(), strict=True)
    return {**window.course.start, **dict(inputs)}


def _of_ship(options: argparse.Namespace, advance: Advance) -> Mapping[str, float]:
    """The smoothed state and the commands at a time of a run of a ship."""
    from .fmu_parameters.ship_task import ship_task

    task = ship_task(options, {"train": [options.run]}, advance, execution_of(options))
    return task.state_at(options.time)


def _parser() -> argparse.ArgumentParser:
    made = fmu_parser(
        "linearise",
        "Compute A, B, C, D of an FMU in a state, with names and units, as JSON and MAT.",
        "examples:  %(prog)s vendor.fmu --operating-point state.json\n"
        "           %(prog)s vendor.fmu --run trial.csv --time 60\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    where = made.add_mutually_exclusive_group()
    renamed_option(
        where,
        "--operating-point",
        Path,
        metavar="STATE.json",
        help="start values, parameters and inputs by their names (default: start values of the FMU)",
    )
    where.add_argument("--run", type=Path, metavar="RUN", help="measured run that contains the state")
    made.add_argument("--time", type=float, metavar="SECONDS", help="time in that run [s]")
    out_options(made, Path("results", "linear"))
    return made


if __name__ == "__main__":
    run_command(main)
