"""Which measured runs to learn from first: ``python -m benchmarks.next_pool DATA --ship kvlcc2``.

Of a pool of measured runs some are kept out. The coefficients are calibrated on one run, then on more,
in the order that a precision criterion of ``cybership next`` chooses, and in random orders that begin
with the same runs. Counted are the runs until the error of the runs kept out is within 10 % of that
after all runs of the pool, at first, and for all larger numbers.
"""

import argparse
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

import diagnosis
from cosim import InputError
from cosim.command import BAD_INPUT, command_parser, complain, run_command
from diagnosis import Model, WeakWindows
from diagnosis.design import CRITERIA, knowledge
from diagnosis.search.prior import MEASURED, NominalPrior
from diagnosis.session import begin
from studies.study_command import progress

from .ships.datasets import DATASETS

NEAR = 1.1  # of the error after all runs; the 10 %
OUT = Path("results") / "next_pool"


class Pool:
    """Measured runs to choose from, and those kept out.

    Args:
        runs: all of them.
        start: the nominal model.
        kept: how many are kept out.
        seed: of the choice.
    """

    def __init__(self, runs: Sequence[WeakWindows], start: Model, kept: int, seed: int) -> None:
        mixed = np.random.default_rng(seed).permutation(len(runs))
        self.held = [runs[k] for k in mixed[:kept]]
        self.runs, self.start = [runs[k] for k in mixed[kept:]], start
        self.known: dict[frozenset[int], float] = {}

    def error(self, chosen: Sequence[int]) -> float:
        """Error of the runs kept out after calibration on some runs.

        Geometric mean of the RMSE of position [m] and heading [rad] in windows.
        """
        key = frozenset(chosen)
        if key not in self.known:
            model = self.start
            with suppress(InputError):  # too little data to learn from
                fit = begin([self.runs[k] for k in sorted(key)], model=self.start).calibration
                model = self.start if fit is None else fit.findings.model
            each = diagnosis.evaluate(self.held, self.start, model).evaluations
            squares = [(e.after.position**2, e.after.heading**2) for e in each]
            self.known[key] = float(np.prod(np.mean(squares, axis=0)) ** 0.25)
        return self.known[key]

    def by(self, criterion: str, first: int) -> list[int]:
        """All runs in the order of a criterion, from a first one."""
        prior = NominalPrior.of(self.start, None, MEASURED)
        order, left = [first], set(range(len(self.runs))) - {first}
        while left:
            space, k = knowledge([self.runs[n] for n in order], self.start, prior, [])
            gain = {n: CRITERIA[criterion](k, space.gram([self.runs[n]])) for n in left}
            order.append(max(gain, key=lambda n: gain[n]))
            left.remove(order[-1])
        return order


def rows(pool: Pool, count: int, seed: int, advance: Callable[[], object]) -> Iterator[dict]:
    """For each of some first runs the runs that are needed in each order."""
    rng = np.random.default_rng(seed)
    for first in rng.permutation(len(pool.runs))[:count]:
        others = [int(n) for n in rng.permutation(len(pool.runs)) if n != first]
        orders = {name: pool.by(name, int(first)) for name in ("d-optimal", "a-optimal")}
        orders["random"] = [int(first), *others]
        for name, order in orders.items():
            names = [pool.runs[n].run.name for n in order]
            errors = [pool.error(order[: n + 1]) for n in range(len(order))]
            near = np.array(errors) <= NEAR * errors[-1]
            first_near = int(np.argmax(near)) + 1
            stays = len(near) - int(np.argmin(near[::-1])) + 1 if not near.all() else 1
            counts = {"first_near": first_near, "stays_near": stays}
            yield {"order": name} | counts | {"runs": names, "errors": errors}
            advance()


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns the exit code."""
    options = _parser().parse_args(arguments)
    try:
        pool = Pool(*DATASETS[options.ship].load(options.data), options.keep, options.seed)
    except InputError as error:
        complain(error)
        return BAD_INPUT
    options.out.mkdir(parents=True, exist_ok=True)
    found = []
    with progress(3 * options.orders, "orders") as advance:
        for row in rows(pool, options.orders, options.seed, advance):
            found.append(row)
            (options.out / f"{options.ship}.json").write_text(json.dumps(found, indent=1) + "\n")
    print(f"{options.ship}: {len(pool.runs)} runs, {options.keep} kept out; median of runs needed:")
    for name in ("d-optimal", "a-optimal", "random"):
        mine = [(r["first_near"], r["stays_near"]) for r in found if r["order"] == name]
        once, stays = np.median(mine, axis=0)
        print(f"  {name}: {once:g} until the error is near at first, {stays:g} until it stays so")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = command_parser(
        "benchmarks.next_pool",
        "Test whether a criterion chooses measured runs in an order that needs fewer of them.",
        "example:  python -m benchmarks.next_pool data --ship kvlcc2\n"
        "exit codes: 0 done, 2 bad input, 130 interrupted",
    )
    parser.add_argument("data", type=Path, metavar="DATA", help="folder of the measured ships")
    parser.add_argument("--ship", choices=DATASETS, default="kvlcc2", help="(kvlcc2)")
    parser.add_argument("--keep", type=int, default=3, metavar="N", help="runs kept out (3)")
    parser.add_argument("--orders", type=int, default=5, metavar="N", help="first runs (5)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is drawn (0)")
    parser.add_argument("--out", type=Path, default=OUT, metavar="DIR", help=f"of the results ({OUT})")
    return parser


if __name__ == "__main__":
    run_command(main)
