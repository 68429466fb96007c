"""What ``learn`` takes, part by part: now and at an earlier commit, or of a described ship.

Each state learns in a process of its own, one after the other, from the same files: three simulated runs
of 240 s at 50 Hz with a hidden drag, or those that are named. With ``--ship`` the present state learns
from three runs of CyberShip Enterprise 1 and from three of that ship, each of 180 s at 10 Hz (times the
scale of the ship) with a hidden drag. Times are of the processor, the last one is that of the wall.
With ``--answers`` each state learns from one run of the Otter, or of that ship, of ten minutes at 10 Hz:
the table has the time of the processor until each answer is there, imports included.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tarfile
import time
from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__)
SECONDS, SAMPLES, THINNED = 180.0, 1800, 5  # s; of each run; samples at 50 Hz in one at 10 Hz
COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
# First words of the steps that `learn` tells -> part.
PARTS = {
    "reading": "reading, smoothing",
    "smoothing": "reading, smoothing",
    "calibration of": "calibration",
    "every": "search",
    "effect": "search",
    "waves": "waves",
    "effects without": "validation",
    "fit to": "fit to predictions",
    "gain of the search": "gain over calibration",
    "predicting": "errors of predictions",
    "residual": "residual",
    "stability": "stability check",
    "dissipation": "stability check",
    "closed loop": "stability check",
    "decay of the motion": "stability check",
    "report": "report",
}

ANSWERS = ["compare", "compare, wall", "compare, report", *(f"until answer {k}" for k in (1, 2, 3))]


def seconds() -> float:
    """Processor time of this process and of its children that have ended."""
    return sum(os.times()[:4])


def learn(runs: Sequence[str], ship: str | None) -> dict[str, float]:
    """Seconds of each part of one ``learn`` from runs of a ship, and of the whole."""
    begun, wall, found = seconds(), time.perf_counter(), {}
    part, since = "import", 0.0

    def close() -> None:
        nonlocal since
        now = seconds()
        found[part] = found.get(part, 0.0) + now - since
        since = now

    def advance(step: str) -> None:
        nonlocal part
        close()
        part = next(
            (
                p
                for words, p in PARTS.items()
                if re.sub(r"^effect \d+[^:]*: ", "", step).startswith(words)
            ),
            part,
        )

    from diagnosis import learn as command

    with TemporaryDirectory() as folder:
        of = ["--ship", ship] if ship else []
        options = command._parser().parse_args([*runs, *of, "--out", folder])
        answers = command.learn(options, advance)
        for k, _ in enumerate(answers if isinstance(answers, Iterator) else [answers]):
            found[f"until answer {k + 1}"] = seconds()
    close()
    return found | {"all": seconds() - begun, "wall": time.perf_counter() - wall}


def compare(runs: Sequence[str], ship: str | None) -> dict[str, float]:
    """Seconds until one ``compare`` shows the errors, the same by the wall, and until its report."""
    wall = time.perf_counter()
    from diagnosis import compare as command

    with TemporaryDirectory() as folder:
        of = ["--ship", ship] if ship else []
        options = command._parser().parse_args([*runs, *of, "--out", folder])
        answers, found = command.compare(options, lambda step: None), {}
        for _ in answers if isinstance(answers, Iterator) else [answers]:
            found = found or {"compare": seconds(), "compare, wall": time.perf_counter() - wall}
    return found | {"compare, report": seconds()}


def simulated(folder: Path, thinned: bool = False) -> list[str]:
    """Files of three runs of a ship with more drag than its model; of 180 s at 10 Hz if thinned."""
    import numpy as np
    import pandas as pd

    from .hidden_effects.fleet import Order, sail_all
    from .hidden_effects.manoeuvres import manoeuvres
    from .hidden_effects.simulated_runs import Hidden, RunawayError

    files = []
    hidden = Hidden({"delta_X_u": -1.0})
    for k, voyage in enumerate(
        sail_all([Order(m, hidden, 4.0, j) for j, m in enumerate(manoeuvres(0))])
    ):
        if isinstance(voyage, RunawayError):
            raise voyage
        run, path = voyage.measured, folder / f"run{k}.csv"
        columns = np.column_stack([run.time, run.pose, run.tau_cmd])
        if thinned:  # commands are held from sample to sample: their mean
            parts = columns[: SAMPLES * THINNED].reshape(SAMPLES, THINNED, -1)
            columns = np.concatenate([parts[:, 0, :4], parts[:, :, 4:].mean(axis=1)], axis=1)
        pd.DataFrame(columns, columns=COLUMNS).to_csv(path, index=False)
        files.append(str(path))
    return files[:3]


def described(folder: Path, name: str, count: int = 3, minutes: float = 0.0) -> list[str]:
    """Files of runs of a described ship with more drag than its model; of so many minutes at 10 Hz."""
    import numpy as np

    from diagnosis.predictors import ship_with

    from .ship_effects import PERIOD, causes, sail

    ship, files = ship_with((), name), []
    scale = ship.scale.time if minutes else 1.0
    seconds, period = (60.0 * minutes / scale or SECONDS), (0.1 / scale if minutes else PERIOD)
    for k in range(count):
        rng = np.random.default_rng(k)
        run = sail(ship, causes(ship)["drag"], rng, None, seconds=seconds, period=period)
        files.append(str(folder / f"described{k}.csv"))
        run.to_csv(files[-1], index=False)
    return files


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learning_time", description=__doc__)
    parser.add_argument("runs", nargs="*", help="measured runs (three simulated ones)")
    parser.add_argument("--before", metavar="COMMIT", help="an earlier state to compare with")
    parser.add_argument("--ship", metavar="NAME|FILE", help="a described ship to compare with")
    parser.add_argument("--answers", action="store_true", help="the time until each answer is there")
    parser.add_argument("--once", choices=["learn", "compare"], help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once:
        work = learn if options.once == "learn" else compare
        print(json.dumps(work(options.runs, options.ship)))
        return
    here = HERE.parents[1]
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if options.answers:
            ship = options.ship or "otter"
            runs = options.runs or described(folder, ship, 1, 10.0)
            found = {
                name: in_tree(tree, runs, ship) | in_tree(tree, runs, ship, "compare")
                for name, tree in states(options.before, folder, here).items()
            }
        elif options.ship:
            ship = str(Path(options.ship).absolute()) if Path(options.ship).is_file() else options.ship
            found = {
                "CyberShip Enterprise 1": in_tree(here, simulated(folder, thinned=True)),
                options.ship: in_tree(here, described(folder, ship), ship),
            }
        else:
            runs = [str(Path(r).absolute()) for r in options.runs] or simulated(folder)
            trees = states(options.before, folder, here)
            found = {name: in_tree(tree, runs) for name, tree in trees.items()}
    print("| s |", " | ".join(found), "|")
    print("|---|", "|".join(["--:"] * len(found)), "|")
    parts = ["import", *PARTS.values(), "all", "wall"]
    for part in ANSWERS if options.answers else dict.fromkeys(parts):
        print("|", part, "|", " | ".join(f"{each.get(part, 0.0):.1f}" for each in found.values()), "|")
    if len(found) > 1:
        whole = "compare" if options.answers else "all"
        first, second = (each[whole] for each in found.values())
        print(f"\nRatio of the processor time of {whole}: {second / first:.2f}")


def states(before: str | None, folder: Path, here: Path) -> dict[str, Path]:
    """The present state, and before it an earlier one if there is one: name -> its tree."""
    if not before:
        return {"now": here}
    content = subprocess.run(["git", "archive", before], capture_output=True, check=True, cwd=here)
    with tarfile.open(fileobj=BytesIO(content.stdout)) as packed:
        packed.extractall(folder / "before", filter="data")
    return {"before": folder / "before", "now": here}


def in_tree(
    tree: Path, runs: Sequence[str], ship: str | None = None, command: str = "learn"
) -> dict[str, float]:
    """What a state of the project takes to learn from runs of a ship, or to compare."""
    done = subprocess.run(
        [sys.executable, str(HERE), "--once", command, *runs, *(["--ship", ship] if ship else [])],
        env=os.environ | {"PYTHONPATH": str(tree)},
        cwd=tree,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
