"""All runs of the study of chapter 6, and means and ratios over those that kept up with the target."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import NamedTuple

from ..monte_carlo import SampleMean, interval
from ..tracking.verdict import finite_ratio
from .store_contents import StoreContents
from .trials import Sailed

Runs = Mapping[str, Sequence[Sailed]]
REGULAR, FAULTY = False, True
PRINTED, FRESH = "as printed", "errors formed anew"
SAME = 0.05  # 1, difference of two errors that is none; chosen
OPENED, BLOCKED = "no blocker", "blocker"


class TrialRuns(NamedTuple):
    """All runs.

    Attributes:
        trials: (trial, with the guidance fault) -> controller -> runs.
        spiked: (store, with spikes) -> controller -> runs.
        eight: (blocker, with spikes) -> controller -> runs of the slow eight.
        delayed: (gains, delay) -> controller -> runs.
        stores: controller -> what its store held.
    """

    trials: Mapping[tuple[str, bool], Runs]
    spiked: Mapping[tuple[str, bool], Runs]
    eight: Mapping[tuple[str, bool], Runs]
    delayed: Mapping[tuple[str, float], Runs]
    stores: Mapping[str, Sequence[StoreContents]]


def values(runs: Sequence[Sailed], name: str) -> list[float]:
    """A number of each run, NaN where the ship did not keep up with the target."""
    return [float("nan") if run.lost else float(getattr(run, name)) for run in runs]


def kept(runs: Sequence[Sailed], name: str) -> list[float]:
    """A number of the runs that kept up with the target."""
    return [x for x in values(runs, name) if isfinite(x)]


def mean(runs: Sequence[Sailed], name: str) -> SampleMean:
    """Over the runs that kept up with the target."""
    return interval(kept(runs, name) or [float("nan")])


def share(a: Sequence[Sailed], b: Sequence[Sailed], name: str = "position") -> SampleMean:
    """A number of runs a over that of b, seed by seed where both kept up with the target."""
    return finite_ratio(values(a, name), values(b, name))


def alike(ratio: SampleMean) -> bool:
    """Whether two controllers do not differ: not where one of them is lost, or where one seed is all."""
    return abs(ratio.mean - 1.0) < SAME or (isfinite(ratio.high) and ratio.low <= 1.0 <= ratio.high)


def lost(runs: Sequence[Sailed]) -> int:
    return int(sum(run.lost for run in runs))


def label(trial: str, faulty: bool) -> str:
    return f"{trial}{', fault' if faulty else ''}"
