"""What is said of spoilt measurements: ``python -m benchmarks.spoilt_files GOOD``.

GOOD is a measurement, or the folder of a run, of a ship of which one thing is known that its model
lacks. For each way to spoil it: refused with which line, the truth kept, or another claim with its
confidence.
"""

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from multiprocessing import get_context
from pathlib import Path

from .outcomes import Outcome, outcome, table
from .ways import WAYS

PROCESSES = 2  # more need more memory than they save time (chosen)


def line(o: Outcome) -> str:
    """A row of the table that is printed."""
    stated = ", ".join(f"{effect} {'-' if c is None else f'{c:.2f}'}" for effect, c in o.found.items())
    mark = " WRONG" if o.wrong else ""
    return f"| {o.way} | {o.kind}{mark} | {stated or o.text} | {o.seconds:.0f} |"


def main(arguments: Sequence[str] | None = None) -> int:
    """Command line; returns 1 if anything false is reported with confidence."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.spoilt_files", description=__doc__)
    parser.add_argument("good", type=Path, metavar="GOOD", help="measurement, or folder of a run")
    parser.add_argument("--only", nargs="+", choices=list(WAYS), metavar="NAME", help="of the ways")
    parser.add_argument("--truth", nargs="+", default=["X_u"], metavar="ID", help="effects in it (X_u)")
    parser.add_argument("--seed", type=int, default=0, help="of all that is random (0)")
    parser.add_argument(
        "--processes", type=int, default=PROCESSES, metavar="N", help=f"at a time ({PROCESSES})"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for outcomes.json")
    options = parser.parse_args(arguments)
    good = table(options.good)
    outcomes = []
    print("| way | outcome | says | s |\n|---|---|---|--:|")
    with ProcessPoolExecutor(options.processes, get_context("spawn")) as pool:
        tasks = [
            pool.submit(outcome, way, good, options.truth, options.seed) for way in options.only or WAYS
        ]
        for task in tasks:
            outcomes.append(task.result())
            print(line(outcomes[-1]), flush=True)
    kinds = [o.kind for o in outcomes]
    counts = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    wrong = [o.way for o in outcomes if o.wrong]
    print(f"\n{len(outcomes)} files: {counts}; wrong: {', '.join(wrong) or 'none'}")
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        content = json.dumps([asdict(o) for o in outcomes], indent=2)
        (options.out / "outcomes.json").write_text(content + "\n", encoding="utf-8")
    return int(bool(wrong))


if __name__ == "__main__":
    raise SystemExit(main())
