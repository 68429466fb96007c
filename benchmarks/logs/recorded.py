"""What is made of a good log that was recorded in some way: whether it is read, its noise, the cause."""

import json
import os
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import diagnosis
from diagnosis.predictors import ship_with
from diagnosis.runs import prepare

from .ways_to_log import POSE, WAYS

SURE = 0.9  # confidence from which on a cause that is not there is wrong; contract


@dataclass(frozen=True)
class Good:
    """A good log.

    Attributes:
        table: time, pose, and commands by the names of the ship.
        sigma: (3,), standard deviation of the noise of its pose [m, m, rad].
        ship: name or file; None: the default one.
        test: another good run, of which the learned model's error is told; None: none.
    """

    table: pd.DataFrame
    sigma: np.ndarray
    ship: str | None
    test: Path | None


@dataclass(frozen=True)
class Recorded:
    """What was made of a recorded log.

    Attributes:
        way: its name.
        refused: the line; empty where it was read.
        noise: (3,), what was found over what there is; NaN where that cannot be said.
        verdict: of ``learn``; empty where nothing was learned.
        found: effects and their confidences.
        error: of the prediction of the test run by the learned model [m]; NaN without one.
        seconds: processor time.
    """

    way: str
    refused: str
    noise: tuple[float, ...]
    verdict: str
    found: dict[str, float | None]
    error: float
    seconds: float


def recorded(way: str, good: Good, seed: int, learn: bool) -> Recorded:
    """Record a log in some way, read it, and learn from it.

    Args:
        way: name of one of :data:`WAYS`.
        good: the log.
        seed: of all that is random in the way.
        learn: whether a cause is looked for.
    """
    start, how = time.process_time(), WAYS[way]
    table = how.record(good.table.copy(), np.random.default_rng([seed, [*WAYS].index(way)]))
    noise, verdict, error = np.full(3, np.nan), "", np.nan
    refused, found = "", {}
    with TemporaryDirectory() as folder:
        file = Path(folder, "run.csv")
        table.to_csv(file, index=False)
        columns = {n: dict(c) for n, c in how.columns.items()}
        for name, factor in how.given.items():
            sigma = float(good.sigma[POSE.index(name)])
            columns.setdefault(name, {"name": name})["noise"] = factor * sigma
        if columns:
            file.with_name("run.csv.json").write_text(json.dumps({"columns": columns}))
        try:
            craft = ship_with((), good.ship)
            estimated = prepare(file, craft).smoothed.noise
            if how.noise is not None:
                noise = estimated / how.noise(good.sigma, table)
            if learn:
                tests = [] if good.test is None else diagnosis.load(good.test, ship=good.ship)
                d = diagnosis.diagnose(diagnosis.load(file, ship=good.ship), tests, seed=seed)
                verdict = d.content.verdict
                found = {e.id: e.confidence for e in d.content.effects}
                if tests:
                    error = d.comparison.evaluations[-1].after.position
        except diagnosis.InputError as problem:
            refused = str(problem).replace(f"{folder}{os.sep}", "")
        except Exception:
            refused = f"TRACEBACK {traceback.format_exc().strip().splitlines()[-1]}"
    ratio = tuple(np.round(noise, 3).tolist())
    return Recorded(way, refused, ratio, verdict, found, error, round(time.process_time() - start, 1))
