"""Measures of a manoeuvring trial: ``python -m diagnosis.measure_trial RUN``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from cosim import InputError
from cosim.command import command_parser, printable, run_command
from cosim.results import read_options
from cosim.trials import KINDS, Outcome, draw_trial, executes, outcome, sheet, simulated_trial

from .commands.command_line import Done, out_options, run
from .execution.progress import Advance
from .execution.result_folder import together

FILES = ("trial.json", "trial.png")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(trial, _parser().parse_args(arguments))


def trial(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    folder: Path = options.run
    if read_options(folder).trial is not None and options.trial is None:
        found, notes = simulated_trial(folder, options.start, options.stop), []
    else:
        found, notes = _measured(options, advance)
    with together(options.out, FILES) as new:
        found.write(new)
        draw_trial(found).save(new / FILES[1])
    title = f"Trial: {found.kind}, {folder.name}"
    written = f"{' and '.join(FILES)} in {options.out}"
    return Done(0, [sheet(found, title), *map(printable, [*notes, written])])


def _measured(options: argparse.Namespace, advance: Advance) -> tuple[Outcome, list[str]]:
    """A measured trial, smoothed, and what its channels say of the measurement.

    Raises:
        InputError: it cannot be read, or nobody says which trial it is.
    """
    from .assessment.trial_errors import length_of, measured_passage
    from .gathering import gather
    from .predictors import Model, ship_with
    from .runs import read, sensor_lines

    craft = ship_with((), options.ship)
    found = read(options.run, of=craft)
    kind = options.trial or found.trial
    if kind is None:
        raise InputError(
            f"'{options.run}' does not say which trial it is: give --trial, or put "
            f'{{"trial": "zigzag"}} into \'{options.run}.json\''
        )
    low, high = options.start or -np.inf, np.inf if options.stop is None else options.stop
    found = replace(found.rows((found.time >= low) & (found.time <= high)), trial=kind)
    (windows,) = gather([found], advance, options.anyway, Model(ship=craft))
    length = length_of(craft)
    whole = measured_passage(windows.smoothed, craft)
    seen = outcome(kind, whole, length)
    examined = windows.smoothed.sensors
    notes = [] if examined is None else [*sensor_lines(examined.findings), *examined.notes]
    way = whole.along(whole.time[0], executes(whole)[0])
    if way < length:
        notes.append(
            f"only {way:.3g} m before the first execute: heading and speed there are of the last ship's "
            f"length, {length:.3g} m; begin the trial earlier"
        )
    return seen, notes


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.measure_trial",
        "Measure a manoeuvring trial by the definitions of IMO and ISO: a turning circle, a "
        "zig-zag, a stop, a spiral; measured, or a run of cosim.",
        "examples:  %(prog)s results/otter_circle\n"
        "           %(prog)s sea_trial.csv --ship my_ship.toml --trial circle --from 470 --to 684\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    made.add_argument("--ship", metavar="NAME|FILE.toml", help="the ship that was measured (cse1)")
    made.add_argument(
        "--trial", choices=KINDS, help="which it is (as the file beside it, or the log, says)"
    )
    made.add_argument("--from", dest="start", metavar="T", type=float, help="first time used [s]")
    made.add_argument("--to", dest="stop", metavar="T", type=float, help="last time used [s]")
    made.add_argument(
        "--anyway", action="store_true", help="though units or signs seem to be other ones than said"
    )
    out_options(made, Path("results", "trial"))
    return made


if __name__ == "__main__":
    run_command(main)
