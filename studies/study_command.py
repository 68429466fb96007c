"""The command line that the studies share."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import cosim
from cosim.command import (
    BAD_INPUT,
    FAILED,
    command_parser,
    complain,
    folder_name,
    run_command,
    whole_number,
)


def study_parser(
    module: str,
    description: str,
    examples: str,
    seeds: int | None = 10,
    jobs: bool = True,
    again: bool = False,
) -> argparse.ArgumentParser:
    """A parser with the options that studies share: ``--out``, ``--seeds``, ``--jobs``, ``--quick``.

    Args:
        module: of the study, as ``studies.tanker``.
        description: what it does.
        examples: lines for the end of the help.
        seeds: how many by default; None where there is nothing to repeat.
        jobs: whether several runs go on at a time.
        again: whether the words of the report can be written anew from its results.
    """
    parser = command_parser(
        module,
        description,
        f"examples:\n{examples}\nexit codes: 0 done, 2 bad input, 3 a run failed, 130 interrupted",
    )
    out = Path("results") / f"study_{module.rpartition('.')[2]}"
    parser.add_argument(
        "--out", type=folder_name, metavar="DIR", default=out, help=f"report folder (default: {out})"
    )
    if seeds is not None:
        parser.add_argument(
            "--seeds",
            type=whole_number(1),
            metavar="N",
            default=seeds,
            help=f"seeds 0 to N-1 (default: {seeds})",
        )
    if jobs:
        parser.add_argument(
            "--jobs",
            type=whole_number(1),
            metavar="N",
            help="number of runs at a time (default: one for each core)",
        )
    if again:
        parser.add_argument(
            "--again",
            action="store_true",
            help="write the report anew from the results.json of --out; nothing runs, pictures stay",
        )
    parser.add_argument(
        "--quick", action="store_true", help="few seeds and short runs, for a first look"
    )
    return parser


@contextmanager
def progress(total: int, what: str) -> Iterator[Callable[[], None]]:
    """A bar on the terminal, if there is one; gives the function that moves it on by one."""
    console = Console(stderr=True)
    columns = (TextColumn(what), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda: bar.advance(task)


def run_study(study: Callable[[], Path]) -> NoReturn:
    """Run a study, print the path of its report, and leave with an exit code."""

    def work() -> int:
        try:
            print(study())
        except cosim.InputError as error:
            complain(error)
            return BAD_INPUT
        except cosim.SimulationError as error:
            complain(error)
            return FAILED
        return 0

    run_command(work)
