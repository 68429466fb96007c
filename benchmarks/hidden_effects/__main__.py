"""How often the diagnosis finds effects hidden in the ship: ``python -m benchmarks.hidden_effects``."""

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path

from cosim import InputError, SimulationError
from cosim.command import BAD_INPUT, FAILED, command_parser, run_command
from cosim.errors import nearest
from studies.study_command import progress

from .answers import judge, kept_answer, path_of
from .cells import KINDS, Cell, Key, cells
from .confidence_fit import write_fit
from .draw import SINGLE
from .problems import kept, make
from .reliability_diagram import draw_diagram
from .results import Results, Row
from .scoring import row
from .simulated_runs import NOISE
from .summary import write

OUT = Path("docs") / "benchmarks" / "hidden_effects"
PROBLEMS = Path("results") / "hidden_effects"
ANSWERS, DIAGRAM, FIT = "answers", "reliability.png", "calibration.json"  # in the folder of results
SOME = 32  # cells that are simulated before the diagnosis gets them: a fleet
QUICK = ("X_u", "N_r", "loss_yaw", "bow_failure", "current", "delay")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def run(todo: Sequence[Cell], results: Results, problems: Path, jobs: int, peers: bool) -> None:
    """Simulate cells, let the diagnosis answer them in other processes, and keep each as it comes.

    What was simulated or answered before is not done again.
    """
    for name in THREADS:
        os.environ[name] = "1"  # inherited: the processes are as many as the cores
    answers = results.path.parent / ANSWERS
    answers.mkdir(parents=True, exist_ok=True)
    with progress(len(todo), "cells") as advance:
        for k in range(0, len(todo), SOME):
            some = todo[k : k + SOME]
            for _ in make(some, problems):
                pass
            for key in answered([c.key for c in some], problems, answers, jobs, peers):
                results.add(scored(key, problems, answers))
                advance()


def scored(key: Key, problems: Path, answers: Path) -> Row:
    """The row of a cell that was answered."""
    return row(kept(key, problems), kept_answer(key, answers))


def answered(
    keys: Sequence[Key], problems: Path, answers: Path, jobs: int, peers: bool
) -> Iterator[Key]:
    """Keys of cells, each when it is answered."""
    there = [key for key in keys if path_of(key, answers).is_file()]
    yield from there
    # Forking a process whose libraries have threads would copy their locks.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"))
    try:
        left = [key for key in keys if key not in there]
        futures: list[Future] = [pool.submit(judge, key, problems, answers, peers) for key in left]
        for future in as_completed(futures):
            yield future.result()
    finally:
        with suppress(KeyboardInterrupt):
            pool.shutdown(cancel_futures=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        todo = list(cells(*_chosen(options)))
        results = Results(options.out / "results.csv")
        left = [cell for cell in todo if cell.key not in results.done]
        if len(left) < len(todo):
            print(f"{len(todo) - len(left)} of {len(todo)} cells are there already", file=sys.stderr)
        try:
            if left:
                run(left, results, options.problems, options.jobs, not options.no_peers)
        finally:
            path = write(options.out, results.rows)
            draw_diagram(results.rows, options.out / DIAGRAM)
        if options.calibrate:
            print(write_fit(results.rows, options.out / FIT))
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except SimulationError as error:
        print(f"error: {error}", file=sys.stderr)
        return FAILED
    print(path)
    return 0


def _chosen(
    options: argparse.Namespace,
) -> tuple[Sequence[str], Sequence[str], list[str], list[bool], range]:
    """Kinds, effects, noises, kinds of coefficients and seeds that are chosen."""
    for e in options.effects:
        if e not in SINGLE:
            raise InputError(f"no effect '{e}'{nearest(e, SINGLE)}")
    effects = options.effects or (QUICK if options.quick else SINGLE)
    noises = options.noise or (["n4"] if options.quick else list(NOISE))
    wrong = [False] * options.exact + [True] * options.wrong or [False] + [True] * (not options.quick)
    usual = KINDS if len(effects) > 1 and not options.quick else KINDS[: min(2, len(effects))]
    kinds = options.kinds or usual
    return kinds, effects, noises, wrong, range(options.first, options.first + options.seeds)


def _integer(low: int, high: int) -> Callable[[str], int]:
    """Parser of an argument that is a whole number within limits."""

    def number(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"needs a whole number from {low} to {high}, not '{text}'")
        return int(text)

    return number


_count, _seed = _integer(1, 100), _integer(0, 99)


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.hidden_effects",
        "Hide an effect in a ship, and test whether the diagnosis finds it.",
        "examples:\n"
        "  python -m benchmarks.hidden_effects --quick --out /tmp/hidden\n"
        "  python -m benchmarks.hidden_effects --effects X_u 'Y_|v|v' --noise n1 n10 --exact --seeds 3\n"
        "  python -m benchmarks.hidden_effects --first 50 --seeds 4 --calibrate --out /tmp/calibration\n"
        "Cells that are in DIR/results.csv are not run again: after Ctrl-C, the same command goes on.\n"
        "exit codes: 0 done, 2 bad input, 3 failed, 130 interrupted",
    )
    parser.add_argument(
        "--effects", nargs="+", default=[], metavar="ID", help="what is hidden (everything)"
    )
    parser.add_argument(
        "--kinds",
        nargs="+",
        choices=KINDS,
        metavar="KIND",
        help=f"of cells: {', '.join(KINDS)} (all; single only where one effect is named)",
    )
    parser.add_argument("--noise", nargs="+", choices=list(NOISE), help="levels of noise (all)")
    parser.add_argument(
        "--exact", action="store_true", help="exact coefficients (both, if neither is given)"
    )
    parser.add_argument("--wrong", action="store_true", help="coefficients up to 10 %% wrong")
    parser.add_argument("--seeds", type=_count, default=1, metavar="N", help="how many seeds (1)")
    parser.add_argument(
        "--first", type=_seed, default=0, metavar="K", help="the first seed, below 100 (0)"
    )
    parser.add_argument(
        "--jobs", type=_count, default=os.cpu_count(), metavar="N", help="processes (one for each core)"
    )
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"where results go ({OUT})")
    parser.add_argument(
        "--problems",
        type=Path,
        default=PROBLEMS,
        metavar="DIR",
        help=f"simulated runs, 3 MB a cell, for any version of the diagnosis ({PROBLEMS})",
    )
    parser.add_argument("--no-peers", action="store_true", help="without PySINDy and PLS")
    parser.add_argument(
        "--calibrate",
        action="store_true",
        help=f"fit the calibration of confidences to cells set aside, seeds from 50 on: DIR/{FIT}",
    )
    parser.add_argument("--quick", action="store_true", help="few effects, n4, exact coefficients")
    return parser


if __name__ == "__main__":
    run_command(main)
