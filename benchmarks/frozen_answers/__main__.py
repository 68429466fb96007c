"""What does a change of the code change in its answers? Freeze them before, and compare after.

The cases are diagnoses and comparisons by the command line: cells of the benchmark of hidden effects,
all five ships, a foreign FMU, public measurements, faults of sensors and spoilt files.
"""

import argparse
import json
import os
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from .case_answers import answer
from .command_lines import CASES, MEASURED
from .differences import compare

ROOT = Path(__file__).parents[2]


def answer_all(names: Sequence[str], problems: Path, out: Path, tree: Path, jobs: int) -> None:
    """Write the answer of each case; those on measurements that are not there are left out."""
    out.mkdir(parents=True, exist_ok=True)
    if not (problems / MEASURED).is_dir():
        absent = [name for name in names if f"{MEASURED}/" in CASES[name]]
        names = [name for name in names if name not in absent]
        print(f"no measurements in '{problems}', left out: {', '.join(absent)}")
    begun = time.monotonic()
    with ThreadPoolExecutor(jobs) as pool:
        tasks = {pool.submit(answer, name, problems, tree): name for name in names}
        for task in as_completed(tasks):
            found, name = task.result(), tasks[task]
            text = json.dumps(found, indent=1, allow_nan=False) + "\n"
            (out / f"{name}.json").write_text(text, encoding="utf-8")
            stated = found.get("diagnosis", {}).get("verdict", "")
            print(
                f"{time.monotonic() - begun:6.0f} s  {name}: exit {found['exit']} {stated}", flush=True
            )
    used = os.times()
    print(f"{used.children_user + used.children_system:.0f} s of processor time")


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; 1 if answers differ."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.frozen_answers", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    made = commands.add_parser("make", help="simulate the runs of the cases, once")
    answered = commands.add_parser("answer", help="run the cases and keep their answers")
    for each in (made, answered):
        each.add_argument(
            "--problems", type=Path, required=True, metavar="DIR", help="runs of the cases"
        )
    answered.add_argument("--out", type=Path, required=True, metavar="DIR", help="for NAME.json")
    answered.add_argument("--tree", type=Path, default=ROOT, metavar="DIR", help="checkout (this one)")
    answered.add_argument("--jobs", type=int, default=2, metavar="N", help="cases at a time (2)")
    answered.add_argument("--only", nargs="+", choices=CASES, metavar="NAME", help="of the cases (all)")
    compared = commands.add_parser("compare", help="print how the answers in two folders differ")
    compared.add_argument("before", type=Path, metavar="BEFORE")
    compared.add_argument("after", type=Path, metavar="AFTER")
    compared.add_argument("--tolerance", type=float, default=1e-9, help="relative (1e-9)")
    compared.add_argument(
        "--ignore", action="append", default=[], metavar="KEY", help="leave a key out, wherever it is"
    )
    options = parser.parse_args(arguments)
    if options.command == "compare":
        return compare(options.before, options.after, options.tolerance, options.ignore)
    problems = options.problems.resolve()
    if options.command == "make":
        from .case_files import (
            make,
        )  # only now: answers need no simulation, nor this checkout's diagnosis

        make(problems)
        return 0
    names = options.only or list(CASES)
    answer_all(names, problems, options.out, options.tree.resolve(), options.jobs)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
