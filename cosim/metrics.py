"""Performance metrics of a finished run: ``python -m cosim.metrics DIR [--from T] [--to T]``."""

if __name__ == "__main__":
    from cosim.supervision.supervising import supervised

    supervised()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

from cybership.scratch_folder import atomic_write

from .command import BAD_INPUT, Output, command_parser, complain, finite, run_command
from .errors import InputError
from .results.log import Log, read_log
from .results.performance import MetricsError, compute, over_time, table
from .results.result_files import FILES
from .results.run_options import read_options
from .scenario.roles import Roles
from .trials.trial_outcome import sheet, simulated_trial


def _write_csv(file: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns as CSV, completely or not at all."""
    with atomic_write(file) as scratch:
        np.savetxt(
            scratch,
            np.column_stack(list(columns.values())),
            fmt="%.10g",
            delimiter=",",
            header=",".join(columns),
            comments="",
        )


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "cosim.metrics",
        "Compute the performance metrics of a finished run.",
        """\
examples:
  %(prog)s results/ellipse
  %(prog)s results/ellipse --from 20 --to 100
  %(prog)s results/ellipse --json
  %(prog)s results/ellipse --out results/ellipse/over_time.csv""",
    )
    parser.add_argument("folder", metavar="DIR", type=Path, help="results of a run: holds log.csv")
    parser.add_argument(
        "--from",
        dest="start",
        metavar="T",
        type=finite,
        help="first time that is used [s] (default: as in the scenario)",
    )
    parser.add_argument(
        "--to",
        dest="stop",
        metavar="T",
        type=finite,
        help="last time that is used [s] (default: as in the scenario)",
    )
    parser.add_argument("--json", action="store_true", help="print JSON only")
    parser.add_argument(
        "--out", metavar="FILE.csv", type=Path, help="also write the metrics over time to this file"
    )
    return parser


def _read(folder: Path, roles: Roles) -> Log:
    try:
        return read_log(folder, roles.of("pose", "velocity", "target", "force"))
    except InputError:
        # A column or the log is missing: reading everything finds out which.
        return read_log(folder)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        run = read_options(options.folder)
        if run.trial is not None and options.out is None:
            trial = simulated_trial(options.folder, options.start, options.stop)
            _show(dict(trial.measures), sheet(trial), options.json)
            return 0
        log = _read(options.folder, run.roles)
        start = run.start if options.start is None else options.start
        stop = run.stop if options.stop is None else options.stop
        metrics = compute(log, start, stop, run.roles)
        if options.out is not None:
            if options.out.resolve().parent == options.folder.resolve() and options.out.name in FILES:
                raise InputError(f"'{options.out}' is a file of the run itself; name another file")
            _write_csv(options.out, over_time(log, start, stop, run.roles))
    except (InputError, MetricsError) as error:
        complain(error)
        return BAD_INPUT
    except OSError as error:
        complain(f"'{options.out}' cannot be written: {error.strerror}")
        return BAD_INPUT
    _show(metrics, table(metrics), options.json)
    return 0


def _show(metrics: Mapping[str, float], shown: Table, as_json: bool) -> None:
    if as_json:
        print(json.dumps(metrics, indent=2))
    else:
        Output().print(shown)


if __name__ == "__main__":
    run_command(main)
