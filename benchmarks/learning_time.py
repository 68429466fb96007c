"""What ``learn`` takes, part by part: now and at an earlier commit, or of a described ship.

Each state learns in a process of its own, one after the other, from the same files: three simulated runs
of 240 s at 50 Hz with a hidden drag, or those that are named. With ``--ship`` the present state learns
from three runs of CyberShip Enterprise 1 and from three of that ship, each of 180 s at 10 Hz (times the
scale of the ship) with a hidden drag. Times are of the processor, the last one is that of the wall.
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
SECONDS, SAMPLES, THINNED = 180.0, 1800, 5  # s; of each run; samples at 50 Hz in one at 10 Hz
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
    "coming to rest": "stability check",
    "report": "report",
}


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
        part = next((p for words, p in PARTS.items() if step.startswith(words)), part)

    from diagnosis import learn as command

    with TemporaryDirectory() as folder:
        of = ["--ship", ship] if ship else []
        options = command._parser().parse_args([*runs, *of, "--out", folder])
        command.learn(options, advance)
    close()
    return found | {"all": seconds() - begun, "wall": time.perf_counter() - wall}


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


def described(folder: Path, name: str) -> list[str]:
    """Files of three runs of a described ship with more drag than its model."""
    import numpy as np

    from diagnosis.predictors import ship_with

    from .ship_effects import causes, sail

    ship, files = ship_with((), name), []
    for k in range(3):
        run = sail(ship, causes(ship)["drag"], np.random.default_rng(k), None, SECONDS)
        files.append(str(folder / f"described{k}.csv"))
        run.to_csv(files[-1], index=False)
    return files


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.learning_time", description=__doc__)
    parser.add_argument("runs", nargs="*", help="measured runs (three simulated ones)")
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument("--before", metavar="COMMIT", help="an earlier state to compare with")
    chosen.add_argument("--ship", metavar="NAME|FILE", help="a described ship to compare with")
    parser.add_argument("--once", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.once:
        print(json.dumps(learn(options.runs, options.ship)))
        return
    here = HERE.parents[1]
    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        if options.ship:
            ship = str(Path(options.ship).absolute()) if Path(options.ship).is_file() else options.ship
            found = {
                "CyberShip Enterprise 1": in_tree(here, simulated(folder, thinned=True)),
                options.ship: in_tree(here, described(folder, ship), ship),
            }
        else:
            runs = [str(Path(r).absolute()) for r in options.runs] or simulated(folder)
            trees = {"now": here}
            if options.before:
                archive = ["git", "archive", options.before]
                content = subprocess.run(archive, capture_output=True, check=True)
                tree = folder / "before"
                with tarfile.open(fileobj=BytesIO(content.stdout)) as packed:
                    packed.extractall(tree, filter="data")
                trees = {"before": tree} | trees
            found = {name: in_tree(tree, runs) for name, tree in trees.items()}
    print("| s |", " | ".join(found), "|")
    print("|---|", "|".join(["--:"] * len(found)), "|")
    for part in dict.fromkeys(["import", *PARTS.values(), "all", "wall"]):
        print("|", part, "|", " | ".join(f"{each.get(part, 0.0):.1f}" for each in found.values()), "|")
    if len(found) > 1:
        first, second = (each["all"] for each in found.values())
        print(f"\nRatio of the processor time: {second / first:.2f}")


def in_tree(tree: Path, runs: Sequence[str], ship: str | None = None) -> dict[str, float]:
    """What a state of the project takes to learn from runs of a ship."""
    done = subprocess.run(
        [sys.executable, str(HERE), "--once", *runs, *(["--ship", ship] if ship else [])],
        env=os.environ | {"PYTHONPATH": str(tree)},
        cwd=tree,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
