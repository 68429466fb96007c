"""Make one table of the files of one run: ``python -m diagnosis.join FILE... --out RUN.csv``."""

if __name__ == "__main__":
    from cosim.supervision import supervised

    supervised()  # before all other imports, which take a while

import argparse
from collections.abc import Sequence
from pathlib import Path

from cosim.command import command_parser, printable, run_command

from .commands.command_line import Done, run
from .commands.table_file import table_options, table_target, write_table
from .execution.progress import Advance
from .execution.result_folder import together


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    return run(join, _parser().parse_args(arguments))


def join(options: argparse.Namespace, advance: Advance) -> Done:
    """Run the command with parsed options."""
    from .runs import one_table  # only now: it takes a second to import

    out = table_target(options)
    advance("reading files")
    table = one_table(options.file)
    with together(out.parent, (out.name,)) as new:
        write_table(table, new / out.name)
    rows = f"{len(table)} rows, columns {', '.join(map(str, table))}"
    after = f"next: python -m diagnosis.propose_columns {out} --write"
    return Done(0, [printable(line) for line in (rows, f"written: {out}", after)])


def _parser() -> argparse.ArgumentParser:
    made = command_parser(
        "diagnosis.join",
        "Make one table of the files of one run. Topics that are logged in files of their own (pose,\n"
        "commands, wind) get rows of their own; files with the same columns follow each other. Of a\n"
        "table with one value in a row (time, name, value) each name is a column.",
        "examples:  %(prog)s pose.csv thrusters.csv --out run.csv\n"
        "           %(prog)s log_0.csv log_1.csv log_2.csv --out run.csv\n"
        "           %(prog)s historian.csv --out run.csv\n"
        "exit codes: 0 done; 2 bad input; 130 interrupted (nothing is written)",
    )
    made.add_argument(
        "file",
        metavar="FILE",
        type=Path,
        nargs="+",
        help="CSV, Parquet or MATLAB file; the JSON file next to it may state its time",
    )
    table_options(made, "CSV or Parquet file")
    return made


if __name__ == "__main__":
    run_command(main)
