"""Reliability of confidences: how often findings that are reported with a confidence are right."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import beta

from cosim import atomic_write

from .cells import KINDS, for_showing
from .results import Row

LEAST = 50  # findings in a bin: fewer tell a rate to no better than 14 points
EDGES = (0.0, 0.5, 0.8, 0.9, 0.95, 0.99)  # where bins may begin; the last is closed at 1
SIDES = (0.025, 0.975)
POINTS = 0.05  # a bin may be off by this, or lie within its interval


class Told(NamedTuple):
    """One finding: how sure it was, and whether it is a true cause."""

    confidence: float
    true: bool


@dataclass(frozen=True)
class Bin:
    """Findings of similar confidence.

    Attributes:
        count, right: findings, and those that are true causes.
        confidence: mean.
        low, high: binomial 95 % interval of the rate of right ones (Clopper and Pearson, 1934).
    """

    count: int
    right: int
    confidence: float
    low: float
    high: float

    @property
    def rate(self) -> float:
        return self.right / self.count

    @property
    def calibrated(self) -> bool:
        """Within five points, or within the binomial interval."""
        return abs(self.rate - self.confidence) <= POINTS or self.low <= self.confidence <= self.high


def stated(rows: Iterable[Row]) -> list[Told]:
    """All findings of some cells."""
    return [
        Told(float(c), true == "1") for r in rows for c, true in zip(r.confidences, r.true, strict=True)
    ]


def interval(right: int, count: int) -> tuple[float, float]:
    """Exact binomial 95 % interval of a rate."""
    low = float(beta.ppf(SIDES[0], right, count - right + 1)) if right else 0.0
    high = float(beta.ppf(SIDES[1], right + 1, count - right)) if right < count else 1.0
    return low, high


def mean_and_error(each: Sequence[float]) -> tuple[float, float]:
    """Mean of independent numbers, at least two, and its standard error."""
    return float(np.mean(each)), float(np.std(each, ddof=1) / np.sqrt(len(each)))


def bins(findings: Sequence[Told], least: int = LEAST) -> list[Bin]:
    """Bins by confidence, from the surest down: each ends at an edge where it holds enough findings.

    What is left below the last such edge joins the bin above it, so that only a single bin may hold less
    than enough.
    """
    ordered = sorted(findings, reverse=True)
    groups: list[list[Told]] = [[]]
    for edge in reversed(EDGES):
        group = [f for f in ordered if f.confidence >= edge]
        taken = sum(map(len, groups))
        groups[-1] += group[taken:]
        if len(groups[-1]) >= least and edge > EDGES[0]:
            groups.append([])
    if len(groups) > 1 and len(groups[-1]) < least:
        few = groups.pop()
        groups[-1] += few
    return [_bin(g) for g in groups if g]


def _bin(group: Sequence[Told]) -> Bin:
    right = sum(f.true for f in group)
    mean = float(np.mean([f.confidence for f in group]))
    return Bin(len(group), right, mean, *interval(right, len(group)))


def tables(rows: Sequence[Row]) -> dict[str, list[Bin]]:
    """Bins of all cells together, and of each kind; only of cells that no calibration was fitted on."""
    shown = [r for r in rows if for_showing(r.effect, r.seed) and not r.note]
    kinds = {"all": shown} | {kind: [r for r in shown if r.kind == kind] for kind in KINDS}
    found = {kind: stated(some) for kind, some in kinds.items()}
    return {kind: bins(findings) for kind, findings in found.items() if findings}


def draw_diagram(rows: Sequence[Row], path: Path) -> None:
    """Draw rate over confidence, a panel for all cells and for each kind that has findings."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib.figure import Figure

    panels = tables(rows)
    figure = Figure(figsize=(3.2 * max(1, len(panels)), 3.4), layout="constrained")
    for k, (kind, some) in enumerate(panels.items()):
        axes = figure.add_subplot(1, len(panels), k + 1)
        axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
        x, rate = [b.confidence for b in some], [b.rate for b in some]
        errors = [[b.rate - b.low for b in some], [b.high - b.rate for b in some]]
        axes.errorbar(x, rate, errors, fmt="o", color="C0", capsize=3)
        for b in some:
            axes.annotate(str(b.count), (b.confidence, b.rate), (5, -11), textcoords="offset points")
        axes.set(title=kind, xlabel="stated confidence", xlim=(-0.03, 1.03), ylim=(-0.03, 1.03))
        axes.set_ylabel("share of findings that are right" if not k else "")
        axes.set_aspect("equal")
    with atomic_write(path) as part:
        figure.savefig(part, format="png", dpi=110)
