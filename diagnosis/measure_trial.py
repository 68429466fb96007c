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
from cosim.trials import KINDS, TrialOutcome, draw_trial, outcome, sheet, simulated_trial

from .commands.command_line import Done, anyway_option, out_options, run, ship_option
from .execution.progress import Advance
from .execution.result_folder import together

FILES = ("trial.json", "trial.png")
PART = "part"  # a channel that marks the rows of the trial, whatever becomes of their times


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(trial, _parser().parse_args(arguments))


def trial(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    folder: Path = options.run
    _check_log(options)
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


def _check_log(options: argparse.Namespace) -> None:
    """Refuse a ship or a kind of trial that is not that of the log of a simulated run."""
    log = read_options(options.run)
    ship = log.ship or (log.outline and log.outline.name)
    stated = {
        "ship": (options.ship, ship, Path(options.ship or "").resolve() == Path(ship or "").resolve()),
        "trial": (options.trial, log.trial and log.trial.kind, False),
    }
    for name, (given, reported, same) in stated.items():
        if given and reported and given != reported and not same:
            raise InputError(
                f"'{options.run}' is a log, and states the {name} '{reported}'; --{name} {given} "
                f"contradicts that: leave --{name} out"
            )


def _measured(options: argparse.Namespace, advance: Advance) -> tuple[TrialOutcome, list[str]]:
    """A measured trial, smoothed, and what its channels show of the measurement.

    The whole run is prepared, as for all commands; the trial is the part of it between two times of the
    file, whatever its channels show of its clock.
    """
    from .assessment.gathering import motion, usable
    from .assessment.trial_errors import length_of, measured_passage
    from .predictors import Model, ship_with
    from .runs import prepare, read, sensor_lines

    craft = ship_with((), options.ship)
    advance("reading")
    whole = read(options.run, of=craft)
    kind = options.trial or whole.trial
    if kind is None:
        beside = f', or put {{"trial": "zigzag"}} into \'{options.run}.json\''
        raise InputError(
            f"'{options.run}' does not state its trial: give --trial"
            f"{'' if options.run.is_dir() else beside}"
        )
    low, high = options.start or -np.inf, np.inf if options.stop is None else options.stop
    inside = ((whole.time >= low) & (whole.time <= high)).astype(float)
    marked = replace(whole, trial=kind, measured={**whole.measured, PART: inside})
    prepared = prepare(marked, craft, options.anyway)
    part = prepared.part(prepared.track.run.measured[PART] > 0.5)
    advance("smoothing")
    usable([motion(part)], Model(ship=craft), options.anyway)
    length = length_of(craft)
    passage = measured_passage(part.smoothed, craft)
    notes = [*sensor_lines(prepared.sensors.findings), *prepared.sensors.notes]
    return outcome(kind, passage, length), notes


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.measure_trial",
        "Measure a manoeuvring trial by the definitions of IMO and ISO: a turning circle, "
        "zig-zag, stop or spiral, from a measurement or a run of cosim.",
        "examples:  %(prog)s results/otter_circle\n"
        "           %(prog)s sea_trial.csv --ship my_ship.toml --trial circle --from 470 --to 684\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted (nothing is written)",
    )
    made.add_argument("run", type=Path, metavar="RUN", help="measured run, or folder of a log")
    ship_option(made)
    made.add_argument(
        "--trial",
        choices=KINDS,
        help="kind of the trial (default: as stated in the log, or in the side-car, the JSON file next "
        "to a CSV file)",
    )
    made.add_argument(
        "--from", dest="start", metavar="T", type=float, help="first time of the file that is used [s]"
    )
    made.add_argument("--to", dest="stop", metavar="T", type=float, help="last one [s]")
    anyway_option(made)
    out_options(made, Path("results", "trial"))
    return made


if __name__ == "__main__":
    run_command(main)
