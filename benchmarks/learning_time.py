"""What ``learn`` takes, part by part, now and at an earlier commit.

Each state learns in a process of its own, one after the other, from the same files: three simulated runs
of 240 s at 50 Hz with a hidden drag, or those that are named. Times are of the processor, so that other
work on the machine hardly counts; the wall's is told for the whole.
"""

import argparse
import json
import os
import subprocess
import sys
import tarfile
import time
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory

HERE = Path(__file__)
COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
# First words of the steps that `learn` tells -> part.
PARTS = {
    "reading": "reading, smoothing",
    "smoothing": "reading, smoothing",
    "every": "search",
    "effect": "search",
    "waves": "waves",
    "what unseen": "unseen data",
    "fit to": "fit to predictions",
    "predicting": "errors of predictions",
    "what is": "what is left",
    "stability": "stability check",
    "dissipation": "stability check",
    "closed loop": "stability check",
    "report": "report",
}


def seconds() -> float:
    """Processor time of this process and of its children that have ended."""
    return sum(os.times()[:4])


def learn(runs: Sequence[str]) -> dict[str, float]:
    """Seconds of each part of one ``learn``, and of the whole."""
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
        part = next((p for words, p in PARTS.items() if step.startswith(words)), part)

    from diagnosis import learn as command

    with TemporaryDirectory() as folder:
        options = command._parser().parse_args([*runs, "--out", folder])
        command.learn(options, advance)
    close()
    return found | {"all": seconds() - begun, "wall": time.perf_counter() - wall}


def simulated(folder: Path) -> list[str]:
    """Files of three runs of a ship with more drag than its model."""
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
        pd.DataFrame(columns, columns=COLUMNS).to_csv(path, index=False)
        files.append(str(path))
    return files[:3]


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learning_time", description=__doc__)
    parser.add_argument("runs", nargs="*", help="measured runs (three simulated ones)")
    parser.add_argument("--before", metavar="COMMIT", help="an earlier state to compare with")
    parser.add_argument("--once", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once:
        print(json.dumps(learn(options.runs)))
        return
    with TemporaryDirectory() as scratch:
        runs = [str(Path(r).absolute()) for r in options.runs] or simulated(Path(scratch))
        trees = {"now": HERE.parents[1]}
        if options.before:
            content = subprocess.run(["git", "archive", options.before], capture_output=True, check=True)
            tree = Path(scratch) / "before"
            with tarfile.open(fileobj=BytesIO(content.stdout)) as archive:
                archive.extractall(tree, filter="data")
            trees = {"before": tree} | trees
        found = {name: in_tree(tree, runs) for name, tree in trees.items()}
    print("| s |", " | ".join(found), "|")
    print("|---|", "|".join(["--:"] * len(found)), "|")
    for part in dict.fromkeys(["import", *PARTS.values(), "all", "wall"]):
        print("|", part, "|", " | ".join(f"{each.get(part, 0.0):.1f}" for each in found.values()), "|")


def in_tree(tree: Path, runs: Sequence[str]) -> dict[str, float]:
    """What a state of the project takes."""
    done = subprocess.run(
        [sys.executable, str(HERE), "--once", *runs],
        env=os.environ | {"PYTHONPATH": str(tree)},
        cwd=tree,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
