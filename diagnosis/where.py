"""Where the model fails: by time, speed, yaw rate, thruster level and heading, where that is sure.

Neighbouring windows share samples, so that stretches of 30 s are what counts as independent: errors of
means are cluster-robust over blocks (Liang and Zeger 1986). A region is named only if the logarithm of
its mean square is above that of the rest beyond chance among all regions that were looked at (Welch's
test, Bonferroni).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .clusters import Mean, chance, clustered
from .covariates import AXES, Course, Kind, courses
from .weak import Integrals

NAMES = {"X": "Surge", "Y": "Sway", "N": "Yaw"}
UNITS = {"X": "N", "Y": "N", "N": "N m"}
CHANCE = 0.01
TOGETHER = 2  # blocks of 15 s; with one alone, slow noise got a region three times as often
# The noise is known to a third or so.
BEYOND = 1.4
WORSE = 1.4
LEAST_SHARE, MOST_SHARE = 0.05, 0.6
FEWEST_BLOCKS = 4


@dataclass(frozen=True, eq=False)
class Profile:
    """RMS of the model error of an axis over one covariate.

    Attributes:
        axis: X, Y or N.
        kind: the covariate.
        run: the only run that is meant; None: all.
        ends: (bins + 1,).
        rms, uncertainty: (bins,) [N or N m]; NaN in a bin without windows.
        share: (bins,), of all windows.
    """

    axis: str
    kind: Kind
    run: str | None
    ends: np.ndarray
    rms: np.ndarray
    uncertainty: np.ndarray
    share: np.ndarray


@dataclass(frozen=True)
class Region:
    """Where the model is clearly worse than elsewhere.

    Attributes:
        axis: X, Y or N.
        kind: the covariate.
        run: the only run that is meant; None: all.
        low, high: its ends, in the unit of the kind; None where it is open.
        rms, elsewhere: RMS of the model error inside and outside [N or N m].
        share: of the windows inside.
        chance: probability of such a difference by chance.
        contrast: how well it parts bad from good: variance that it explains of the logarithm.
    """

    axis: str
    kind: Kind
    run: str | None
    low: float | None
    high: float | None
    rms: float
    elsewhere: float
    share: float
    chance: float
    contrast: float

    @property
    def words(self) -> str:
        """The region as a phrase."""
        low, high = (None if x is None else f"{self.kind.shown * x:.3g}" for x in (self.low, self.high))
        if high is None:
            text = self.kind.above.format(low)
        elif low is None:
            text = self.kind.below.format(high)
        else:
            text = self.kind.between.format(low, high)
        return f"in run {self.run} {text}" if self.run else text

    @property
    def sentence(self) -> str:
        unit = UNITS[self.axis]
        return (
            f"{NAMES[self.axis]}: worst {self.words}: {self.rms:.2g} {unit} against "
            f"{self.elsewhere:.2g} {unit} elsewhere, {100.0 * self.share:.0f} % of the time."
        )


@dataclass(frozen=True, eq=False)
class Where:
    """Where a model fails: the most important in a sentence for each axis, regions, profiles."""

    sentences: Sequence[str]
    regions: Sequence[Region]
    profiles: Sequence[Profile]


def where(data: Sequence[Integrals], omega: Sequence[np.ndarray], std: Sequence[np.ndarray]) -> Where:
    """Where the model error of some runs is largest.

    Args:
        data: windows of each run.
        omega: of each run the model error (K, 3) [N, N, N m].
        std: of each run its uncertainty (K, 3).
    """
    squares, noise = np.concatenate(omega) ** 2, np.concatenate(std) ** 2
    stretches = np.concatenate([10_000 * k + w.block // TOGETHER for k, w in enumerate(data)])
    block = np.unique(stretches, return_inverse=True)[1]
    many = len(data) > 1
    sentences: list[str] = []
    regions: list[Region] = []
    profiles: list[Profile] = []
    for k, by in enumerate(courses(data)):
        axis = AXES[k]
        tables = [_Table.of(axis, c, squares[:, k], noise[:, k], block, many) for c in by]
        profiles += [t.profile for t in tables]
        ms, own = squares[:, k].mean(), noise[:, k].mean()
        rms, sure = f"{np.sqrt(ms):.2g}", f"{np.sqrt(own):.1g}"
        if not seen(squares[:, k], noise[:, k], block):
            sentences.append(
                f"{NAMES[axis]}: no error seen, {rms} {UNITS[axis]} is within the uncertainty of {sure}."
            )
            continue
        named = sorted(filter(None, (t.worst() for t in tables)), key=lambda r: -r.contrast)
        regions += named
        throughout = f"{rms} {UNITS[axis]} (uncertainty {sure}), nowhere clearly worse than elsewhere."
        sentences.append(named[0].sentence if named else f"{NAMES[axis]}: {throughout}")
    return Where(sentences, regions, profiles)


def seen(squares: np.ndarray, noise: np.ndarray, blocks: np.ndarray) -> bool:
    """Whether a model error is more than noise, by its squares and the noise's variance (K,)."""
    count = np.bincount(blocks)
    beyond = clustered(np.bincount(blocks, squares - BEYOND**2 * noise), count)
    return beyond.mean > 2.0 * np.sqrt(beyond.variance)


@dataclass(frozen=True, eq=False)
class _Table:
    """Sums of squares, of the noise alone, and numbers of windows (bins, blocks) of an axis."""

    profile: Profile
    total: np.ndarray
    own: np.ndarray
    count: np.ndarray

    @classmethod
    def of(
        cls, axis: str, by: Course, squares: np.ndarray, noise: np.ndarray, block: np.ndarray, many: bool
    ) -> "_Table":
        ends = by.ends
        bins = max(ends.size - 1, 1)
        place = np.clip(np.searchsorted(ends, by.values, side="right") - 1, 0, bins - 1)
        flat = place * (block.max() + 1) + block[by.rows]
        shape = (bins, block.max() + 1)

        def table(weights: np.ndarray | None) -> np.ndarray:
            return np.bincount(flat, weights, bins * shape[1]).reshape(shape)

        total, own, count = table(squares[by.rows]), table(noise[by.rows]), table(None)
        n = count.sum(axis=1)
        with np.errstate(invalid="ignore"):
            rms, uncertainty = (np.sqrt(x.sum(axis=1) / n) for x in (total, own))
        run = by.run if many else None
        profile = Profile(axis, by.kind, run, ends, rms, uncertainty, n / max(n.sum(), 1))
        return cls(profile, total, own, count)

    def candidates(self) -> Iterator[tuple[int, int]]:
        """Regions as first bin and the bin after the last, which may lie beyond the last of all."""
        kind, bins = self.profile.kind, len(self.total)
        for first in range(bins):
            for after in range(first + 1, first + bins if kind.cyclic else bins + 1):
                if (kind.any_range or first == 0 or after == bins) and after - first < bins:
                    yield first, after

    def worst(self) -> Region | None:
        """Of the regions that are surely worse than the rest the one that parts best."""
        bins = len(self.total)
        options = list(self.candidates())
        best: Region | None = None
        for first, after in options:
            inside = np.isin(np.arange(bins), np.arange(first, after) % bins)
            found = self._region(first, after, inside, len(options))
            if found is not None and (best is None or found.contrast > best.contrast):
                best = found
        return best

    def _log(self, part: np.ndarray) -> Mean:
        """Logarithm of the mean square in some bins, with the noise to keep it from nothing."""
        total, count = ((x[part].sum(axis=0)) for x in (self.total + self.own, self.count))
        there = np.maximum(count, 1)
        return clustered(count * np.log(np.maximum(total, 1e-30) / there), count)

    def _region(self, first: int, after: int, inside: np.ndarray, tried: int) -> Region | None:
        """A region, if it is worse than the rest beyond chance among so many that were tried."""
        share = float(self.profile.share[inside].sum())
        if not LEAST_SHARE <= share <= MOST_SHARE:
            return None
        parts = (inside, ~inside)
        inner, outer = (float(np.sqrt(self.total[x].sum() / self.count[x].sum())) for x in parts)
        a, b = map(self._log, parts)
        if min(a.free, b.free) + 1 < FEWEST_BLOCKS or inner < WORSE * outer:
            return None
        likely = min(1.0, tried * chance(a, b))
        if likely > CHANCE:
            return None
        p, bins = self.profile, len(self.total)
        cyclic = p.kind.cyclic
        low = float(p.ends[first]) if first > 0 or cyclic else None
        high = float(p.ends[(after - 1) % bins + 1]) if after < bins or cyclic else None
        contrast = share * (1.0 - share) * (a.mean - b.mean) ** 2
        return Region(p.axis, p.kind, p.run, low, high, inner, outer, share, likely, contrast)
