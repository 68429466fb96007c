"""What a diagnosis says of one spoilt file."""

import os
import time
import traceback
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

import diagnosis

from .ways import POSE, TAU, WAYS

SURE = 0.9  # confidence at which a claim of an absent cause is wrong, whatever else is said


@dataclass(frozen=True)
class Outcome:
    """What a diagnosis says of a spoilt file.

    Attributes:
        way: its name.
        kind: refused, kept, claim or traceback.
        text: the line of a refusal, the verdict, or the end of a traceback.
        found: effects reported, with their confidences.
        false: those of them that are absent.
        seconds: wall time.
    """

    way: str
    kind: str
    text: str
    found: dict[str, float | None] = field(default_factory=dict)
    false: dict[str, float | None] = field(default_factory=dict)
    seconds: float = 0.0

    @property
    def wrong(self) -> bool:
        """Whether a user reads something false with confidence, or nothing that makes sense."""
        return self.kind == "traceback" or any((c or 0.0) >= SURE for c in self.false.values())


def outcome(way: str, good: pd.DataFrame, truth: Sequence[str], seed: int) -> Outcome:
    """Spoil a table and diagnose what comes out.

    Args:
        way: name of one of :data:`WAYS`.
        good: the table.
        truth: ids of the effects that are in it.
        seed: of all that is random in the way.
    """
    start = time.monotonic()
    there = {*truth, *WAYS[way].causes}
    rng = np.random.default_rng([seed, [*WAYS].index(way)])
    with TemporaryDirectory() as folder:
        file = Path(folder, f"{way}.csv")
        WAYS[way].spoil(good.copy(), rng).to_csv(file, index=False)
        try:
            found = diagnosis.diagnose(diagnosis.load(file), seed=seed).content
        except diagnosis.InputError as error:
            kind, text, stated = "refused", str(error).replace(f"{folder}{os.sep}", ""), {}
        except Exception:
            kind, text, stated = "traceback", traceback.format_exc().strip().splitlines()[-1], {}
        else:
            stated = {e.id: e.confidence for e in found.effects}
            kind = "kept" if stated and set(stated) <= there else "claim"
            text = found.verdict
    false = {effect: c for effect, c in stated.items() if effect not in there}
    return Outcome(way, kind, text, stated, false, round(time.monotonic() - start, 1))


def table(good: Path) -> pd.DataFrame:
    """Time, pose and commanded force of a measurement."""
    run = diagnosis.read(good)
    columns = np.column_stack([run.time, run.pose, run.tau_cmd])
    return pd.DataFrame(columns, columns=["time", *POSE, *TAU])
