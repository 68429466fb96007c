"""How often the diagnosis finds effects hidden in the ship: ``python -m benchmarks.hidden_effects``."""

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import suppress
from itertools import product
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from cosim import InputError, SimulationError
from cosim.command import BAD_INPUT, FAILED, run_command
from cosim.errors import nearest
from studies.study_command import progress

from .cell import Cell, trial
from .cost import Cost, measure
from .draw import SINGLE
from .results import Results, Row
from .simulated_runs import NOISE, build
from .summary import write

OUT = Path("docs") / "benchmarks" / "hidden_effects"
NONES, PAIRS = 5, 4  # cells without an effect and with two, for each of the others and a seed
CELLS = 10  # that a process takes
QUICK = ("X_u", "N_r", "loss_yaw", "bow_failure", "current", "delay")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def cells(
    effects: Sequence[str], noises: Sequence[str], wrong: Sequence[bool], seeds: Sequence[int]
) -> Iterator[Cell]:
    """The cells of a benchmark; with more effects than one also those with none and with two."""
    ways, several = list(product(noises, wrong)), len(effects) > 1
    for seed in seeds:
        rng = np.random.default_rng([seed, 4])
        drawn = [rng.choice(effects, 2, replace=False).tolist() for _ in range(PAIRS * several)]
        pairs = dict.fromkeys(tuple(pair) for pair in drawn)
        # The manoeuvres are those of the seed; all else is drawn anew.
        nones = [seed + 100 * k for k in range(NONES * several)]
        yield from (Cell((e,), *way, seed) for way in ways for e in effects)
        yield from (Cell((), *way, each) for way in ways for each in nones)
        yield from (Cell(pair, *way, seed) for way in ways for pair in pairs)


def run(todo: Sequence[Cell], results: Results, jobs: int, peers: bool) -> None:
    """Run cells in processes of their own, and keep each as it comes.

    Raises:
        InputError: the FMUs cannot be built.
    """
    for name in THREADS:
        os.environ[name] = "1"  # inherited: the processes are as many as the cores
    with TemporaryDirectory() as folder, progress(len(todo), "cells") as advance:
        build(Path(folder))
        for k in range(0, len(todo), CELLS * jobs):
            for row in results_of(todo[k : k + CELLS * jobs], Path(folder), jobs, peers):
                results.add(row)
                advance()


def results_of(some: Sequence[Cell], fmus: Path, jobs: int, peers: bool) -> Iterator[Row]:
    """Results of some cells, as they come, by new processes.

    A Python FMU stays in its process for good: after many runs each further one would be slower.
    """
    # Forking a process that has loaded FMUs would copy their threads' locks.
    pool = ProcessPoolExecutor(jobs, get_context("spawn"))
    try:
        futures: list[Future] = [pool.submit(trial, cell, fmus, peers) for cell in some]
        for future in as_completed(futures):
            yield future.result()
    finally:
        with suppress(KeyboardInterrupt):
            pool.shutdown(cancel_futures=True)


def cost() -> Cost:
    """Time and memory of the diagnosis."""
    with TemporaryDirectory() as folder:
        build(Path(folder))
        return measure(Path(folder))


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
                run(left, results, options.jobs, not options.no_peers)
        finally:
            path = write(options.out, results.rows, None)
        if options.cost:
            path = write(options.out, results.rows, cost())
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    except SimulationError as error:
        print(f"error: {error}", file=sys.stderr)
        return FAILED
    print(path)
    return 0


def _chosen(options: argparse.Namespace) -> tuple[Sequence[str], list[str], list[bool], range]:
    """Effects, noises, kinds of coefficients and seeds that are chosen."""
    for e in options.effects:
        if e not in SINGLE:
            raise InputError(f"no effect '{e}'{nearest(e, SINGLE)}")
    effects = options.effects or (QUICK if options.quick else SINGLE)
    noises = options.noise or (["n4"] if options.quick else list(NOISE))
    wrong = [False] * options.exact + [True] * options.wrong or [False] + [True] * (not options.quick)
    return effects, noises, wrong, range(options.first, options.first + options.seeds)


def _integer(low: int, high: int) -> Callable[[str], int]:
    """Parser of an argument that is a whole number within limits."""

    def number(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(f"needs a whole number from {low} to {high}, not '{text}'")
        return int(text)

    return number


_count, _seed = _integer(1, 100), _integer(0, 99)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.hidden_effects",
        description="Hide an effect in a ship, and test whether the diagnosis finds it.",
        epilog="examples:\n"
        "  python -m benchmarks.hidden_effects --quick --out /tmp/hidden\n"
        "  python -m benchmarks.hidden_effects --effects X_u 'Y_|v|v' --noise n1 n10 --exact --seeds 3\n"
        "  python -m benchmarks.hidden_effects --cost\n"
        "Cells that are in DIR/results.csv are not run again: after Ctrl-C, the same command goes on.\n"
        "exit codes: 0 done, 2 bad input, 3 failed, 130 interrupted",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        "--effects", nargs="+", default=[], metavar="ID", help="what is hidden (everything)"
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
    parser.add_argument("--no-peers", action="store_true", help="without PySINDy and PLS")
    parser.add_argument("--cost", action="store_true", help="measure time and memory, too")
    parser.add_argument("--quick", action="store_true", help="few effects, n4, exact coefficients")
    return parser


if __name__ == "__main__":
    run_command(main)
