"""Performance metrics of a finished run: ``python -m cosim.metrics DIR [--from T] [--to T]``."""

if __name__ == "__main__":
    from cosim.watch.watching import watched

    watched()  # before all other imports, which take a while

import argparse
import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from .command import BAD_INPUT, Output, complain, program, run_command
from .errors import InputError
from .files import atomic_write
from .results.log import CSV, Log, read_log
from .results.performance import MetricsError, compute, over_time, table
from .results.run_options import RunOptions, read_options
from .trials.trial_outcome import outcome_of_log, sheet


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
    parser = argparse.ArgumentParser(
        prog=program("cosim.metrics"),
        description="Performance metrics of a finished run.",
        epilog="""\
examples:
  %(prog)s results/ellipse
  %(prog)s results/ellipse --from 20 --to 100
  %(prog)s results/ellipse --json
  %(prog)s results/ellipse --out results/ellipse/over_time.csv""",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("folder", metavar="DIR", type=Path, help="results of a run: holds log.csv")
    parser.add_argument(
        "--from", dest="start", metavar="T", type=float, help="first time used [s] (as in the scenario)"
    )
    parser.add_argument(
        "--to", dest="stop", metavar="T", type=float, help="last time used [s] (as in the scenario)"
    )
    parser.add_argument("--json", action="store_true", help="print JSON and nothing else")
    parser.add_argument("--out", metavar="FILE.csv", type=Path, help="write the metrics over time")
    return parser


def _read(folder: Path, run: RunOptions) -> Log:
    trial = [] if run.trial is None else [*run.roles.pose, run.trial.order]
    try:
        return read_log(folder, trial or run.roles.of("pose", "velocity", "target", "force"))
    except InputError:
        # A column or the log is missing: reading everything finds out which.
        return read_log(folder)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code: 0 done, 2 bad input."""
    options = _parser().parse_args(arguments)
    try:
        run = read_options(options.folder)
        log = _read(options.folder, run)
        start = run.start if options.start is None else options.start
        stop = run.stop if options.stop is None else options.stop
        trial = None
        if run.trial is None:
            metrics = compute(log, start, stop, run.roles)
        else:
            length = 0.0 if run.outline is None else run.outline.length
            trial = outcome_of_log(log, run.trial, run.roles, length, start, stop)
            metrics = dict(trial.measures)
        if options.out is not None:
            if options.out.resolve().parent == options.folder.resolve() and options.out.name == CSV:
                raise InputError(f"'{options.out}' is the log itself")
            _write_csv(options.out, over_time(log, start, stop, run.roles))
    except (InputError, MetricsError) as error:
        complain(error)
        return BAD_INPUT
    except OSError as error:
        complain(f"'{options.out}' cannot be written: {error.strerror}")
        return BAD_INPUT
    if options.json:
        print(json.dumps(metrics, indent=2))
    else:
        Output().print(table(metrics) if trial is None else sheet(trial))
    return 0


if __name__ == "__main__":
    run_command(main)
