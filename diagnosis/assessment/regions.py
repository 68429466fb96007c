"""Where the model fails: regions of a covariate in which the model error is larger than elsewhere.

Windows overlap and the model error is correlated in time, so that clusters of two blocks count as
independent and means have cluster-robust standard errors. A region is reported only if the mean
logarithm of its clusters' mean squares is above that of the rest at level 1 %: Welch's test, with
Bonferroni's correction for the number of regions that were tried. Samples within a cluster may be
correlated in any way, clusters are independent.

K. Y. Liang and S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika 73
(1986); B. L. Welch, The generalization of "Student's" problem, Biometrika 34 (1947).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr

from fmus.effects.text import number

from ..execution.short_text import ShortRepr
from ..predictors import WeakWindows
from ..predictors.uncertainty import NOISE_TOLERANCE
from ..runs.cleaning import Z95
from ..runs.run_constants import CHANCE, PARTS
from .covariates import AXES, Covariate, CovariateValues, covariates_by_axis
from .settings import SETTINGS

NAMES = {"X": "Surge", "Y": "Sway", "N": "Yaw"}
UNITS = {"X": "N", "Y": "N", "N": "N m"}


class ClusterMean(NamedTuple):
    """A mean over clusters, the cluster-robust variance of that mean, and its degrees of freedom."""

    mean: float
    variance: float
    dof: int


def numbered(runs: Sequence[np.ndarray]) -> np.ndarray:
    """(K,), numbers of clusters over all runs, from those (K_i,) within each run."""
    return np.unique(np.concatenate([k + 1j * n for k, n in enumerate(runs)]), return_inverse=True)[1]


def cluster_mean(total: np.ndarray, count: np.ndarray) -> ClusterMean:
    """Mean of all samples, with its cluster-robust (sandwich) variance.

    With sum s_g and number n_g of the samples of cluster g, n = sum n_g, and G clusters that have any::

        mean = sum s_g / n,    variance = G / (G - 1) sum (s_g - n_g mean)^2 / n^2,    dof = G - 1

    Args:
        total: (clusters,), sum of the samples of each.
        count: (clusters,), number of samples of each; a cluster without samples does not count.
    """
    filled = count > 0
    n, clusters = float(count.sum()), int(filled.sum())
    mean = float(total.sum()) / max(n, 1.0)
    residual = total[filled] - count[filled] * mean
    variance = float(residual @ residual) / max(n, 1.0) ** 2 * clusters / max(clusters - 1, 1)
    return ClusterMean(mean, variance, clusters - 1)


def welch_p_value(a: ClusterMean, b: ClusterMean) -> float:
    """One-sided p-value of Welch's test that the expectation of a is not above that of b.

    Returns:
        A probability; 1 where a mean has no degree of freedom or neither has a variance.
    """
    variance = a.variance + b.variance
    if a.dof < 1 or b.dof < 1 or variance <= 0.0:
        return 1.0
    dof = variance**2 / (a.variance**2 / a.dof + b.variance**2 / b.dof)  # Satterthwaite
    return float(stdtr(dof, (b.mean - a.mean) / np.sqrt(variance)))


@dataclass(frozen=True, eq=False, repr=False)
class Profile(ShortRepr):
    """RMS of the model error of an axis over a covariate.

    Attributes:
        axis: X, Y or N.
        covariate: which.
        run: name of the only run that is meant; None: all.
        edges: (bins + 1,), in the covariate's unit.
        rms, uncertainty: (bins,) [N or N m]; NaN in a bin without windows.
        share: (bins,), of all windows.
    """

    axis: str
    covariate: Covariate
    run: str | None
    edges: np.ndarray
    rms: np.ndarray
    uncertainty: np.ndarray
    share: np.ndarray


@dataclass(frozen=True)
class Region:
    """An interval of a covariate in which the model error is significantly larger than elsewhere.

    Attributes:
        axis: X, Y or N.
        covariate: which.
        run: name of the only run that is meant; None: all.
        low, high: its ends, in the covariate's unit; None where it is open.
        rms, elsewhere: RMS of the model error inside and outside [N or N m].
        share: of the windows inside.
        p_value: of Welch's test, corrected for the number of regions tried.
        contrast: variance of the logarithm that the division into inside and outside explains.
        spread: of the covariate over all bins, in its unit.
    """

    axis: str
    covariate: Covariate
    run: str | None
    low: float | None
    high: float | None
    rms: float
    elsewhere: float
    share: float
    p_value: float
    contrast: float
    spread: float

    @property
    def phrase(self) -> str:
        """The region as a part of a sentence."""
        by = self.covariate
        ends = [x for x in (self.low, self.high) if x is not None]
        apart, most = np.ptp(ends) or self.spread, np.abs(ends).max()
        # Of the ends three digits, of those far from zero as many as show where in its spread one is.
        digits = 3 + max(int(np.log10(most / apart)) if apart > 0.0 else 0, 0)
        low, high = (
            None if x is None else f"{by.display_factor * x:.{digits}g}" for x in (self.low, self.high)
        )
        text = by.above.format(low) if high is None else by.between.format(low, high)
        text = by.below.format(high) if low is None else text
        return f"in run {self.run} {text}" if self.run else text

    @property
    def sentence(self) -> str:
        unit = UNITS[self.axis]
        return (
            f"{NAMES[self.axis]}: the error is largest {self.phrase}: {number(self.rms, 2)} {unit}, "
            f"compared with {number(self.elsewhere, 2)} {unit} elsewhere, "
            f"for {100.0 * self.share:.0f} % of the time."
        )


@dataclass(frozen=True, eq=False, repr=False)
class ErrorRegions(ShortRepr):
    """Where a model fails.

    Attributes:
        sentences: one for each axis, on its clearest region.
        regions: all that are significant, by axis, the clearest first.
        profiles: of each axis over each covariate.
    """

    sentences: Sequence[str]
    regions: Sequence[Region]
    profiles: Sequence[Profile]


def find_regions(
    data: Sequence[WeakWindows], omega: Sequence[np.ndarray], std: Sequence[np.ndarray]
) -> ErrorRegions:
    """Regions in which the model error of some runs is significantly larger than elsewhere.

    Args:
        data: windows of each run.
        omega: of each run the model error (K, 3) [N, N, N m].
        std: of each run its standard deviation by the noise of the measurement (K, 3) [N, N, N m].
    """
    squares, noise = np.concatenate(omega) ** 2, np.concatenate(std) ** 2
    cluster = numbered([w.block // SETTINGS.blocks_per_cluster for w in data])
    sentences: list[str] = []
    regions: list[Region] = []
    profiles: list[Profile] = []
    for axis, covariates, s, n in zip(AXES, covariates_by_axis(data), squares.T, noise.T, strict=True):
        designs = [_Design.of(axis, c, s, n, cluster, len(data) > 1) for c in covariates]
        profiles += [d.profile for d in designs]
        rms, uncertainty = np.sqrt(s.mean()), np.sqrt(n.mean())
        measured = f"{number(rms, 2)} {UNITS[axis]} (uncertainty {number(uncertainty, 1)})"
        found: list[Region] = []
        if _exceeds_noise(s, n, cluster):
            clearest = filter(None, (d.clearest_region() for d in designs))
            found = sorted(clearest, key=lambda r: -r.contrast)
            where = f"{measured}, no region is significantly worse than the others"
        elif rms <= NOISE_TOLERANCE * uncertainty:
            where = f"no model error detected, {measured} is within the noise"
        else:
            where = f"{measured}, too rare to locate"
        regions += found
        sentences.append(found[0].sentence if found else f"{NAMES[axis]}: {where}.")
    return ErrorRegions(sentences, regions, profiles)


def _exceeds_noise(squares: np.ndarray, noise: np.ndarray, cluster: np.ndarray) -> bool:
    """Whether a model error (K,) is more than the noise of the measurement."""
    excess = squares - NOISE_TOLERANCE**2 * noise
    above = cluster_mean(np.bincount(cluster, excess), np.bincount(cluster))
    return above.mean > Z95 * np.sqrt(above.variance)


@dataclass(frozen=True, eq=False)
class _Design:
    """Block design of an axis and a covariate: sums of the squares and of the noise's variance, and
    numbers of windows, in bins and clusters (bins, clusters).
    """

    profile: Profile
    total: np.ndarray
    noise: np.ndarray
    count: np.ndarray

    @classmethod
    def of(
        cls,
        axis: str,
        by: CovariateValues,
        squares: np.ndarray,
        noise: np.ndarray,
        cluster: np.ndarray,
        several_runs: bool,
    ) -> "_Design":
        edges = by.edges
        bins, clusters = max(edges.size - 1, 1), cluster.max() + 1
        place = np.clip(np.searchsorted(edges, by.values, side="right") - 1, 0, bins - 1)
        flat = place * clusters + cluster[by.rows]
        total, variance, count = (
            np.bincount(flat, weights[by.rows], bins * clusters).reshape(bins, clusters)
            for weights in (squares, noise, np.ones_like(noise))
        )
        n = count.sum(axis=1)
        with np.errstate(invalid="ignore"):
            rms, uncertainty = (np.sqrt(x.sum(axis=1) / n) for x in (total, variance))
        run = by.run if several_runs else None
        profile = Profile(axis, by.covariate, run, edges, rms, uncertainty, n / max(n.sum(), 1))
        return cls(profile, total, variance, count)

    def intervals(self) -> Iterator[tuple[int, int]]:
        """First bin and the one after the last of each interval, which may pass the end if cyclic."""
        by, bins = self.profile.covariate, len(self.total)
        for first, more in product(range(bins), range(1, bins)):
            after = first + more
            if (by.cyclic or after <= bins) and (by.bounded or first == 0 or after == bins):
                yield first, after

    def clearest_region(self) -> Region | None:
        """The significant region of the largest contrast; None: there is none."""
        tried = list(self.intervals())
        found = filter(None, (self._test(*ends, len(tried)) for ends in tried))
        return max(found, key=lambda region: region.contrast, default=None)

    @cached_property
    def _squares(self) -> np.ndarray:
        """(bins,), sums of the squares over the clusters."""
        return self.total.sum(axis=1)

    @cached_property
    def _windows(self) -> np.ndarray:
        """(bins,), numbers of windows."""
        return self.count.sum(axis=1)

    def _log_mean_square(self, bins: np.ndarray) -> ClusterMean:
        """Mean logarithm of the clusters' mean squares in some bins; the noise keeps it finite."""
        total, count = ((x[bins].sum(axis=0)) for x in (self.total + self.noise, self.count))
        windows = np.maximum(count, 1)
        return cluster_mean(count * np.log(np.maximum(total, np.finfo(float).tiny) / windows), count)

    def _test(self, first: int, after: int, tried: int) -> Region | None:
        """The region, if it is significantly worse than the rest among so many that were tried."""
        p, bins = self.profile, len(self.total)
        inside = (np.arange(bins) - first) % bins < after - first
        share, parts = float(self.profile.share[inside].sum()), (inside, ~inside)
        squares, windows = ([float(x[y].sum()) for y in parts] for x in (self._squares, self._windows))
        clear = squares[0] * windows[1] >= SETTINGS.least_contrast**2 * squares[1] * windows[0]
        if share > SETTINGS.largest_region or not clear:
            return None
        a, b = map(self._log_mean_square, parts)
        if min(a.dof, b.dof) + 1 < PARTS:  # three degrees of freedom of each variance
            return None
        inner, outer = np.sqrt(np.divide(squares, windows)).tolist()
        p_value = min(1.0, tried * welch_p_value(a, b))  # Bonferroni
        if p_value > CHANCE:
            return None
        cyclic = p.covariate.cyclic
        low = float(p.edges[first]) if first > 0 or cyclic else None
        high = float(p.edges[(after - 1) % bins + 1]) if after < bins or cyclic else None
        contrast = share * (1.0 - share) * (a.mean - b.mean) ** 2
        spread = float(np.ptp(p.edges))
        return Region(
            p.axis, p.covariate, p.run, low, high, inner, outer, share, p_value, contrast, spread
        )
