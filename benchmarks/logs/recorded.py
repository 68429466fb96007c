"""What is made of a good log that was recorded in some way: whether it is read, its noise, the cause."""

import json
import os
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

import diagnosis
from diagnosis.predictors import ship_with
from diagnosis.runs import prepare

from .ways_to_log import POSE, WAYS

FASTER = 8  # order of the filter that parts motions by their frequency


@dataclass(frozen=True)
class Good:
    """A good log.

    Attributes:
        table: time, pose, and commands by the names of the ship.
        motion: (n, 3), its pose without noise [m, m, rad].
        sigma: (3,), standard deviation of the noise of its pose [m, m, rad].
        ship: name or file; None: the default one.
    """

    table: pd.DataFrame
    motion: np.ndarray
    sigma: np.ndarray
    ship: str | None

    def noise(self, rates: Sequence[float]) -> np.ndarray:
        """(3,), standard deviation of what is noise for samples at some rates (3,) [Hz].

        Motions above half of a rate cannot be distinguished from noise by samples at that rate.
        """
        of_table = 1.0 / float(np.median(np.diff(self.table["time"])))
        quick = np.zeros(3)
        for k, rate in enumerate(rates):
            if rate < of_table:
                low = butter(FASTER, 0.5 * rate, fs=of_table, output="sos")
                quick[k] = np.std(self.motion[:, k] - sosfiltfilt(low, self.motion[:, k]))
        return np.hypot(self.sigma, quick)


@dataclass(frozen=True)
class Recorded:
    """What was made of a recorded log.

    Attributes:
        way: its name.
        refused: the line; empty where it was read.
        noise: (3,), what was found over what there is; NaN where it is given, or not white.
        rel_std: (3,), relative standard deviation of it, as it was found.
        at_most: (3,), whether it was found to be an upper bound.
        misstated: channels whose given noise is ten times too large or small.
        doubted: channels of whose given noise a line says that it is wrong.
        verdict: of ``learn``; empty where nothing was learned.
        found: effects and their confidences.
        listed: effects that the diagnosis lists, found, possible or indistinguishable from one of these,
            and the share of the squared error that each explains; those that are not fitted have none.
        error: of the prediction of the test run by the learned model [m]; NaN without one.
        seconds: processor time.
    """

    way: str
    refused: str = ""
    noise: tuple[float, ...] = (np.nan, np.nan, np.nan)
    rel_std: tuple[float, ...] = (np.nan, np.nan, np.nan)
    at_most: tuple[bool, ...] = (False, False, False)
    misstated: tuple[str, ...] = ()
    doubted: tuple[str, ...] = ()
    verdict: str = ""
    found: Mapping[str, float | None] = field(default_factory=dict)
    listed: Mapping[str, float | None] = field(default_factory=dict)
    error: float = np.nan
    seconds: float = 0.0

    @property
    def physics(self) -> set[str]:
        """Effects that were found, without those that the way itself has."""
        return {*self.found} - WAYS[self.way].adds

    def content(self) -> dict[str, Any]:
        """What a file of results holds, in which a number that is not finite is null."""
        return json.loads(json.dumps(asdict(self)), parse_constant=lambda _: None)

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> "Recorded":
        """The same, of such a file."""
        known: dict[str, Any] = {n: np.nan if v is None else v for n, v in content.items()}
        for name in ("noise", "rel_std"):
            known[name] = tuple(np.nan if v is None else v for v in content[name])
        return cls(**known)


def recorded(way: str, good: Good, seed: int, learn: bool, test: Good | None) -> Recorded:
    """Record a log in some way, read it, and learn from it.

    Args:
        way: name of one of :data:`WAYS`.
        good: the log.
        seed: of all that is random in the way.
        learn: whether a cause is looked for.
        test: another good run, of which the learned model's error is stated; None: none.
    """
    start, how = time.process_time(), WAYS[way]
    table = how.record(good.table.copy(), np.random.default_rng([seed, [*WAYS].index(way)]))
    wrong = tuple(name for name, factor in how.given.items() if factor != 1.0)
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
            found = _read(Recorded(way, misstated=wrong), file, good, table)
            if learn:
                found = _learned(found, file, good.ship, seed, test)
        except diagnosis.InputError as problem:
            found = Recorded(way, str(problem).replace(f"{folder}{os.sep}", ""))
        except Exception:
            last = traceback.format_exc().strip().splitlines()[-1]
            found = Recorded(way, f"TRACEBACK {last}")
    return replace(found, seconds=round(time.process_time() - start, 1))


def _read(o: Recorded, file: Path, good: Good, table: pd.DataFrame) -> Recorded:
    """The same with the noise that was found, and that which is doubted."""
    how, s = WAYS[o.way], prepare(file, ship_with((), good.ship)).smoothed
    doubted = tuple(n for n in POSE if any(f"noise of {n} is given" in line for line in s.doubted))
    if how.noise is None:
        return replace(o, doubted=doubted)
    ratio = s.noise / how.noise(good.noise(how.rates), table)
    ratio[np.isin(POSE, [*how.given])] = np.nan
    rounded = (tuple(np.round(x, 3).tolist()) for x in (ratio, s.noise_rel_std))
    at_most = tuple(s.noise_at_most.tolist())
    named = dict(zip(("noise", "rel_std"), rounded, strict=True))
    return replace(o, doubted=doubted, at_most=at_most, **named)


def _learned(o: Recorded, file: Path, ship: str | None, seed: int, test: Good | None) -> Recorded:
    """The same with the cause, and the error on the test run."""
    tests = [] if test is None else diagnosis.load(test.table, ship=ship)
    d = diagnosis.diagnose(diagnosis.load(file, ship=ship), tests, seed=seed)
    # The test run is measured without what the way does to the pose.
    model = replace(d.learned.model, measurement={})
    error = diagnosis.compare(tests, model).evaluations[-1].before.position if tests else np.nan
    effects = {e.id: e.confidence for e in d.content.effects}
    listed = {i: None for e in d.content.accepted for i in e.indistinguishable}
    listed |= {e.id: e.share_of_error for e in d.content.accepted}
    return replace(o, verdict=d.content.verdict, found=effects, listed=listed, error=error)
