"""The path of a ship and the rate of its log's clock, by all channels that tell of its motion.

Between two instants of the log's time t the ship moves by c times what velocity and yaw rate integrate
to, where c = d(true time)/dt is the rate of the clock: it acts alike on the path and on the turn, as no
fault of a single channel does. Unknown are pose and c at nodes and the constant faults of
:mod:`.constants`,

    P(t_i) measured with white noise, along and across the track and in heading,
    P_(j+1) - P_j = c_j (D_j + constants) + a random walk of the velocity's and of the rate's error,
    c_(j+1) - c_j   a random walk.

All is linear but for c times a constant, which is iterated. The variances are those of restricted
maximum likelihood, by the fixed point of Harville (1977), J. Am. Stat. Assoc. 72, 320-338.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded
from scipy.sparse import csr_array

from .constants import Column
from .evidence import Evidence

BAND = 8  # unknowns of two neighbouring nodes: north, east, heading, clock
# s between two nodes, or as long as a sampling period. Chosen: a clock of arrival wanders over seconds.
SPACING = 1.0
MOST_NODES, MOST_SAMPLES = 20_000, 8  # and samples between two of them, evenly chosen of more
# Standard deviation believed of c about 1 at each node: of a clock that may be off, none of which runs
# at half or double rate, and of one that may not.
ANCHOR, EVEN = 0.5, 1e-6
SLOWEST = 0.1  # true seconds in a second of the log, at the least: time does not fall; chosen
BEGIN = np.array(
    [0.1, 0.1, 0.03]
)  # of the walks in a second: of the noise, and of the rate; first guesses
# Of the noise, and of it over the whole run; what is less makes no difference to the path.
LEAST, LEAST_WALK = 1e-2, np.array([1e-3, 1e-3, 1e-4])
SWEEPS = 25  # of the fixed point; chosen: the likelihood then changes by less than 0.1
STILL = (
    1e-6  # relative change of all deviations in a sweep that ends them; chosen: no digit told changes
)
PROBES = 6  # random vectors that estimate traces (Hutchinson 1990)
OUTLIER = 5.0  # standard deviations: one in 1.7 million samples of normal noise is left out
# Groups of equations of one variance: samples along, across, heading; drift of velocity, of rate; clock.
ALONG, ACROSS, HEADING, DRIFT, TURN, CLOCK, RATE, FIXED = range(8)


@dataclass(frozen=True, eq=False)
class Solution:
    """A path that was found.

    Attributes:
        clock: (m - 1,), rate c between the nodes.
        constants: (k,), value of each constant fault.
        covariance: (k, k), of these.
        std: (7,), standard deviations of the groups.
        criterion: -2 log of the likelihood, restricted to all but the constants.
        residual: standardised, of each equation.
    """

    clock: np.ndarray
    constants: np.ndarray
    covariance: np.ndarray
    std: np.ndarray
    criterion: float
    residual: np.ndarray
    system: "_System"


class PathProblem:
    """The equations of a run.

    Args:
        e: what its channels say.
        constants: faults that are looked for.
        noise: (2,), of the samples' positions and headings [m, rad], to begin with.
        gaps: pairs of times [s] of the log between which it jumps.
        without: samples left out.
    """

    def __init__(
        self,
        e: Evidence,
        constants: Sequence[Column],
        noise: Sequence[float],
        gaps: Sequence[tuple[float, float]] = (),
        without: frozenset[int] = frozenset(),
    ) -> None:
        self.evidence, self.constants, self.noise = e, constants, noise
        self.gaps, self.without = gaps, without
        time = e.time
        rows = e.rows
        for start, end in gaps:
            rows = rows[(time[rows] <= start) | (time[rows] >= end)]
        spacing = max(SPACING, float(time[rows[-1]] - time[rows[0]]) / MOST_NODES)
        self.nodes = rows[_spaced(time[rows], spacing)]
        m = self.nodes.size
        self.edges = time[self.nodes]
        steps = np.diff(self.edges)
        self.cut = np.zeros(m - 1, bool)
        for start, end in gaps:
            self.cut |= (self.edges[1:] > start) & (self.edges[:-1] < end)
        rows = rows[(rows >= self.nodes[0]) & (rows < self.nodes[-1])]
        thin = max(1, rows.size // (MOST_SAMPLES * m))
        self.rows = np.array([k for k in rows[::thin].tolist() if k not in without])
        self.at = np.searchsorted(self.nodes, self.rows, side="right") - 1
        at_cut = self.cut[self.at] & (self.rows != self.nodes[self.at])
        self.rows, self.at = self.rows[~at_cut], self.at[~at_cut]
        self.whole = np.flatnonzero(~self.cut)
        self.pairs = np.flatnonzero(~self.cut[:-1] & ~self.cut[1:])
        self.moved = np.column_stack([e.gone, e.turned])
        self._build(steps)

    def _build(self, steps: np.ndarray) -> None:
        e, m = self.evidence, self.nodes.size
        c, s = np.cos(e.psi), np.sin(e.psi)
        one, none = np.ones_like(c), np.zeros_like(c)
        axes = np.stack([np.column_stack(a) for a in ((c, s, none), (-s, c, none), (none, none, one))])
        pose = np.column_stack([e.run.pose[:, :2] - e.run.pose[e.rows[0], :2], e.psi])
        measured = [
            k for k, there in ((0, e.velocity), (1, e.velocity), (2, e.rate)) if there is not None
        ]
        parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []  # equation, unknown, factor
        self.parts: list[tuple[int, np.ndarray, np.ndarray, np.ndarray]] = []
        right, groups, lengths, count = [], [], [], 0

        def add(
            group: int, entries: list[tuple[np.ndarray, np.ndarray]], y: np.ndarray, h: np.ndarray
        ) -> int:
            nonlocal count
            parts.extend(
                (count + np.arange(y.size), at, np.broadcast_to(f, y.shape)) for at, f in entries
            )
            right.append(y)
            groups.append(np.full(y.size, group))
            lengths.append(np.broadcast_to(h, y.shape))
            count += y.size
            return count - y.size

        rows, at, one = self.rows, self.at, np.ones(1)
        whole, here, there = self.whole, self.nodes[:-1][self.whole], self.nodes[1:][self.whole]
        for k in measured:  # samples of the pose
            a = axes[k][rows]
            ahead = (a * (self.moved[rows] - self.moved[self.nodes[at]])).sum(axis=1)
            entries = [(4 * at + i, a[:, i]) for i in range(3) if a[:, i].any()]
            begin = add(k, [*entries, (4 * at + 3, ahead)], (a * pose[rows]).sum(axis=1), one)
            self.parts.append((begin, a, self.nodes[at], rows))
        for k in measured:  # from node to node
            a = axes[k][here]
            ahead = (a * (self.moved[there] - self.moved[here])).sum(axis=1)
            entries = [(4 * (whole + j) + i, (2 * j - 1) * a[:, i]) for i in range(3) for j in (0, 1)]
            group = TURN if k == 2 else DRIFT
            begin = add(group, [*entries, (4 * whole + 3, -ahead)], np.zeros(whole.size), steps[whole])
            self.parts.append((begin, -a, here, there))
        j = self.pairs
        ends = [(4 * j + 7, one), (4 * j + 3, -one)]
        add(CLOCK, ends, np.zeros(j.size), 0.5 * (steps[j] + steps[j + 1]))
        add(RATE, [(4 * np.arange(m) + 3, one)], np.ones(m), one)
        for i in range(3):  # holds what nothing measures
            add(FIXED, [(4 * np.arange(m) + i, np.array([1e-6]))], np.zeros(m), one)
        equation, unknown, factor = (np.concatenate(each) for each in zip(*parts, strict=True))
        self.matrix = csr_array((factor, (equation, unknown)), shape=(count, 4 * m))
        self.right, self.group = np.concatenate(right), np.concatenate(groups)
        self.steps = np.sqrt(np.concatenate(lengths))
        self.present = sorted(set(self.group.tolist()) - {RATE, FIXED})

    def border(self, clock: np.ndarray) -> np.ndarray:
        """(equations, constants): what one unit of each constant changes, with a rate of the clock."""
        made = np.zeros((self.right.size, len(self.constants)))
        run = np.interp(self.evidence.time, self.edges, integral_of(self.edges, clock))
        for k, fault in enumerate(self.constants):
            path = fault.path
            if fault.clocked:
                steps = np.diff(path, axis=0) * (np.diff(run) / np.diff(self.evidence.time))[:, None]
                path = np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
            for begin, a, start, end in self.parts:
                made[begin : begin + end.size, k] = np.einsum("ij,ij->i", a, path[end] - path[start])
        return made

    def solve(self, fixed_clock: bool = False) -> Solution:
        """The likeliest path.

        Args:
            fixed_clock: whether the clock is believed to run evenly at rate 1.
        """
        place, angle = self.noise
        walk = np.array([place, angle, 1.0])
        std = np.array([place, place, angle, *(BEGIN * walk), EVEN if fixed_clock else ANCHOR])
        seconds = float(self.edges[-1] - self.edges[0])
        floor = np.array([*(LEAST * std[:3]), *(LEAST_WALK * walk / np.sqrt(seconds)), 0.0])
        clock, rng = np.ones(self.nodes.size - 1), np.random.default_rng(0)
        probes = rng.choice([-1.0, 1.0], (self.right.size, PROBES))
        for _ in range(SWEEPS):
            system, before = _System(self, std, clock), std.copy()
            clock = system.unknown[3::4][:-1]
            share = system.leverage(probes)
            for g in self.present:
                if g == CLOCK and fixed_clock:
                    continue
                of = self.group == g
                free = max(of.sum() - share[of].mean(axis=1).sum(), 1.0)
                std[g] = max(std[g] * np.sqrt((system.residual[of] ** 2).sum() / free), floor[g])
            if (np.abs(std - before) <= STILL * before).all():
                break
        system = _System(self, std, clock)
        return Solution(
            system.unknown[3::4][:-1].copy(),
            system.constants,
            system.covariance,
            std,
            system.criterion,
            system.residual,
            system,
        )

    def outliers(self, solution: Solution) -> frozenset[int]:
        """Samples far from the path."""
        far: set[int] = set()
        for begin, _, _, rows in self.parts[: len(self.parts) // 2]:
            off = np.abs(solution.residual[begin : begin + rows.size])
            far |= set(rows[off > OUTLIER].tolist())
        return frozenset(far)


class _System:
    """The equations with weights, solved."""

    def __init__(self, p: PathProblem, std: np.ndarray, clock: np.ndarray) -> None:
        weight = 1.0 / (np.append(std, 1.0)[p.group] * p.steps)
        entries = np.repeat(weight, np.diff(p.matrix.indptr)) * p.matrix.data
        self.weighted = csr_array((entries, p.matrix.indices, p.matrix.indptr), p.matrix.shape)
        self._turned = self.weighted.T
        right, self.border = p.right * weight, p.border(clock) * weight[:, None]
        normal = self._turned @ self.weighted
        band = np.zeros((BAND, 4 * p.nodes.size))
        for k in range(BAND):
            band[k, : band.shape[1] - k] = normal.diagonal(-k)
        self.factor = cholesky_banded(band, lower=True)
        mixed = self._turned @ self.border
        self.mixed = self.solve(mixed)
        schur = self.border.T @ self.border - mixed.T @ np.asarray(self.mixed)
        self.covariance = np.linalg.pinv(schur, hermitian=True)
        plain = self.solve(self._turned @ right)
        self.constants = self.covariance @ (self.border.T @ right - mixed.T @ plain)
        self.unknown = plain - self.mixed @ self.constants
        self.residual = right - self.weighted @ self.unknown - self.border @ self.constants
        other = p.group < CLOCK  # the walk of the clock and its anchor are one prior
        determinant = np.log(self.factor[0]).sum() - np.log(weight[other]).sum()
        determinant -= 0.5 * _prior(p, weight**2)
        self.criterion = float(2.0 * determinant + (self.residual**2).sum())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """N^-1 times columns."""
        return cho_solve_banded((self.factor, True), right)

    def leverage(self, probes: np.ndarray) -> np.ndarray:
        """(equations, probes): whose mean is the leverage of each equation."""
        return (self.weighted @ self.solve(self._turned @ probes)) * probes

    def mean_clock(self, weights: np.ndarray) -> np.ndarray:
        """(k,): standard deviation of weighted means (k, m) of the clock's rate at the nodes."""
        right = np.zeros((self.unknown.size, weights.shape[0]))
        right[3::4] = weights.T
        found = self.solve(right)
        by_constants = self.mixed.T @ right
        variance = (right * found).sum(axis=0)
        variance += (by_constants * (self.covariance @ by_constants)).sum(axis=0)
        return np.sqrt(variance)


def _prior(p: PathProblem, precision: np.ndarray) -> float:
    """log |Q| of the precision Q of the rates of the clock before anything is measured."""
    walk, j = precision[p.group == CLOCK], p.pairs
    band = np.zeros((2, p.nodes.size))
    band[0] = precision[p.group == RATE]
    band[0, j] += walk
    band[0, j + 1] += walk
    band[1, j] = -walk
    return float(2.0 * np.log(cholesky_banded(band, lower=True)[0]).sum())


def _spaced(time: np.ndarray, spacing: float) -> np.ndarray:
    """Indices of times [s] at least that far apart."""
    kept, last = [], -np.inf
    for k, t in enumerate(time.tolist()):
        if t - last >= spacing * (1.0 - 1e-9):
            kept.append(k)
            last = t
    return np.array(kept)


def integral_of(edges: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """(m,): true time [s] at the nodes since the first, for the rate of the clock between them.

    Between two nodes that noise has made fall the later one is put off: all others keep their time.
    """
    least = SLOWEST * (edges - edges[0])
    true = np.concatenate([[0.0], np.cumsum(clock * np.diff(edges))])
    return np.maximum.accumulate(true - least) + least
