"""Problems with known answers, their prepared runs, and what the diagnosis says of them.

Measured runs are simulated once. Runs that are read, cleaned and smoothed are kept for constants of
later rooms. Pickles of prepared runs belong to one version of the code.
"""

import pickle
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

import diagnosis
from cosim import InputError, atomic_write
from diagnosis.predictors import Model, ship_with

COLUMNS = ["time", "x", "y", "psi", "tau_X", "tau_Y", "tau_N"]
NOISE = "n4"
# What is hidden in CyberShip Enterprise 1: each kind of cell of benchmarks.hidden_effects.
CELLS = {
    "single": ("current",),
    "none": (),
    "pair": ("X_u", "N_r"),
    "foreign": ("tether",),
    "outages": ("bow_outage at other times",),
    "process noise": ("X_u in process noise",),
}
SECOND, CAUSES = "otter", ("none", "loss")  # another ship, by benchmarks.ship_effects
QUICK = ("single exact", "none wrong", "otter loss wrong")
RUNS = 3  # two to learn from, one held out


class Problem(NamedTuple):
    """Measured runs, the last one held out.

    Attributes:
        ship: name of it.
        prior: relative standard deviation of each nominal coefficient.
        runs: tables with the columns of a file.
    """

    ship: str
    prior: float
    runs: Sequence[pd.DataFrame]

    @property
    def model(self) -> Model:
        return Model(ship=ship_with((), self.ship))


class Answer(NamedTuple):
    """What the diagnosis says of a problem.

    Attributes:
        verdict: or the reason why there is none.
        sets: ids of each finding with those that are indistinguishable from it.
        error: window position error of the run held out [m].
    """

    verdict: str
    sets: str = ""
    error: float = float("nan")


def problem_names(quick: bool) -> list[str]:
    """All problems, exact and 10 % wrong; some of them."""
    kinds = [*CELLS, *(f"{SECOND} {cause}" for cause in CAUSES)]
    every = [f"{kind} {model}" for kind in kinds for model in ("exact", "wrong")]
    return [name for name in every if name in QUICK or not quick]


def make(names: Sequence[str], seed: int, folder: Path) -> None:
    """Simulate the problems that are not in a folder yet."""
    from ..hidden_effects.cells import Cell
    from ..hidden_effects.problems import kept
    from ..hidden_effects.problems import make as simulate
    from ..ship_effects import WRONG, causes, sail

    folder.mkdir(parents=True, exist_ok=True)
    missing = [name for name in names if not (folder / f"{name}.pkl").is_file()]
    cells = {}
    for name in missing:
        kind, _, model = name.rpartition(" ")
        if kind in CELLS:
            cells[name] = Cell(CELLS[kind], NOISE, model == "wrong", seed)
    for _ in simulate(list(cells.values()), folder / "cells"):
        pass
    for name in missing:
        if name in cells:
            found = kept(cells[name].key, folder / "cells")
            tables = [np.column_stack([r.time, r.pose, r.tau_cmd]) for r in found.runs]
            chosen = [*tables[: RUNS - 1], tables[-1]]
            made = Problem("cse1", found.prior, [pd.DataFrame(t, columns=COLUMNS) for t in chosen])
        else:
            _, cause, model = name.split(" ")
            ship, wrong = ship_with((), SECOND), model == "wrong"
            rng = np.random.default_rng([seed, *name.encode()])
            runs = [sail(ship, causes(ship)[cause], rng, seed if wrong else None) for _ in range(RUNS)]
            made = Problem(SECOND, WRONG * wrong, runs)
        write(folder / f"{name}.pkl", made)


def prepare(name: str, folder: Path, evidence: Path) -> None:
    """Keep the prepared runs of a problem, unless they are kept."""
    evidence.mkdir(parents=True, exist_ok=True)
    path = evidence / f"{name}.pkl"
    if not path.is_file():
        problem: Problem = pickle.loads((folder / f"{name}.pkl").read_bytes())
        write(path, [w.smoothed for w in diagnosis.load(problem.runs, model=problem.model)])


def write(path: Path, content: Any) -> None:
    with atomic_write(path) as part:
        part.write_bytes(pickle.dumps(content))


def answer(name: str, folder: Path, evidence: Path | None) -> Answer:
    """What the diagnosis says of a problem.

    Args:
        name: of the problem.
        folder: of the measured runs.
        evidence: of the prepared runs; None: prepare them anew.
    """
    problem: Problem = pickle.loads((folder / f"{name}.pkl").read_bytes())
    model = problem.model
    try:
        if evidence is None:
            runs = diagnosis.load(problem.runs, model=model)
        else:
            smoothed = pickle.loads((evidence / f"{name}.pkl").read_bytes())
            runs = [diagnosis.weak_windows(s) for s in smoothed]
        found = diagnosis.diagnose(runs[:-1], runs[-1:], prior=problem.prior, model=model).content
    except InputError as error:
        return Answer(f"refused: {error}")
    sets = [" ".join([e.id, *sorted(e.indistinguishable)]) for e in found.effects]
    (held_out,) = (e.window_position_rmse for e in found.errors if e.held_out)
    left = held_out.before if held_out.after is None else held_out.after
    return Answer(found.verdict, "; ".join(sets), float("nan") if left is None else float(left))
