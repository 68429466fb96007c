"""The path of a ship and the rate of its log's clock, by all channels that tell of its motion.

Between two instants of the log's time t the ship moves by c times what velocity and yaw rate integrate
to, where c = d(true time)/dt is the rate of the clock: it acts alike on the path and on the turn, as no
fault of a single channel does. Unknown are pose and c at nodes and the constant faults of
:mod:`.constants`,

    P(t_i) measured with white noise, along and across the track and in heading,
    P_(j+1) - P_j = c_j (D_j + constants) + a random walk of the velocity's and of the rate's error,
    c_(j+1) - c_j   a random walk.

Where a ship hardly moves, velocity and rate are noise, or what a receiver states at rest. The clock does
not act on these, or it would be found slow enough to make them vanish.

All is linear but for c times a constant, which is iterated: banded least squares with a variance for
each group of equations, as those of the smoother (:mod:`..smoothing.penalised`). The variances are
those of restricted maximum likelihood, by the fixed point of Harville (1977), J. Am. Stat. Assoc. 72,
320-338. It is that of their logarithms, on the secant of the last two steps (D. G. Anderson, J. ACM 12,
1965), which takes half of the steps.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.linalg import cholesky_banded
from scipy.sparse import csr_array, vstack

from ..cleaning import noise as noise_of
from ..smoothing.outliers import OUTLIER
from ..smoothing.penalised import Equations, LinearSystem
from ..thinning import MOST_ROWS
from .constants import FaultColumn
from .evidence import Evidence

NODE = ("north", "east", "heading", "rate of the clock")  # the unknowns of a node
STATES = len(NODE)
CLOCKS = slice(NODE.index("rate of the clock"), None, STATES)  # the rates among all unknowns
# s between two nodes, or as long as a sampling period. Chosen: a clock of arrival wanders over seconds.
SPACING = 1.0
# 1, between two nodes, evenly chosen of more; chosen: the path between is nearly straight
MOST_SAMPLES = 8
# 1, prior standard deviation of c about 1 at each node; chosen: no clock runs at half or double rate.
ANCHOR = 0.5
# [1, m, rad] the same of a clock that may not be off; of a noise; inverse of the prior deviation of a
# pose. It keeps the equations well-posed.
NEGLIGIBLE = 1e-6
LEAST = (
    1e-3  # 1, of the noise, and of the walks over the whole run; with less a sea trial has another path
)
BEGIN = 0.1  # 1, of the walks in a second, times the noise or the rate; first guess
SWEEPS = 25  # 1, of the fixed point; chosen: the likelihood then changes by less than 0.1
FURTHER = 1.0  # 1, of a logarithm, by which a secant leads beyond a step at the most; chosen
# Groups of equations of one variance: samples along, across, heading; drift of velocity, of rate; clock.
ALONG, ACROSS, HEADING, DRIFT, TURN, CLOCK, RATE, FIXED = range(8)


class PathProblem:
    """The equations of a run.

    Args:
        e: what its channels say.
        noise: (2,), of the samples' positions and headings [m, rad], to begin with.
        gaps: pairs of times [s] of the log between which it jumps.
        without: samples left out.
        spacing: time between two nodes at the least [s].
    """

    def __init__(
        self,
        e: Evidence,
        noise: Sequence[float],
        gaps: Sequence[tuple[float, float]] = (),
        without: frozenset[int] = frozenset(),
        spacing: float = SPACING,
    ) -> None:
        self.evidence, self.noise, self.gaps, self.without = e, noise, gaps, without
        time, rows = e.time, e.rows
        for start, end in gaps:
            rows = rows[(time[rows] <= start) | (time[rows] >= end)]
        spacing = max(spacing, float(time[rows[-1]] - time[rows[0]]) * MOST_SAMPLES / MOST_ROWS)
        self.nodes = rows[_spaced(time[rows], spacing)]
        self.edges = time[self.nodes]
        self.cut = np.zeros(self.nodes.size - 1, bool)
        for start, end in gaps:
            self.cut |= (self.edges[1:] > start) & (self.edges[:-1] < end)
        rows = rows[(rows >= self.nodes[0]) & (rows < self.nodes[-1])]
        rows = rows[:: max(1, rows.size // (MOST_SAMPLES * self.nodes.size))]
        rows = rows[~np.isin(rows, list(without))]
        at = np.searchsorted(self.nodes, rows, side="right") - 1
        whole = ~self.cut[at] | (rows == self.nodes[at])
        self._build(rows[whole], at[whole])

    def _build(self, rows: np.ndarray, at: np.ndarray) -> None:
        """The equations, of samples in some rows after their nodes, from node to node, and of priors."""
        e, m, nodes, steps = self.evidence, self.nodes.size, self.nodes, np.diff(self.edges)
        c, s, none = np.cos(e.psi), np.sin(e.psi), np.zeros_like(e.psi)
        sides = ((c, s, none), (-s, c, none), (none, none, none + 1.0))  # along, across, heading
        axes = np.array([np.column_stack(side) for side in sides])
        pose = np.column_stack([e.run.pose[:, :2] - e.run.pose[e.rows[0], :2], e.psi])
        moved = np.column_stack([e.gone, e.turned])
        speed, turn = (np.linalg.norm(np.diff(x[nodes], axis=0), axis=1) for x in (e.gone, moved[:, 2:]))
        moves = np.array([x > still * steps for x, still in zip((speed, turn), e.still, strict=True)])
        moves, clock, every = moves[[0, 0, 1]], STATES - 1, np.arange(m)
        matrices, columns = [], []  # of each group of equations; its number, right sides and time steps

        def add(
            group: int, node: np.ndarray, factors: Any, right: Any, step: Any = 1.0, first: int = 0
        ) -> None:
            """Equations of unknowns in a row, from one of each node on."""
            f = np.column_stack(factors)
            unknown = STATES * node[:, None] + first + np.arange(f.shape[1])
            ends = np.arange(0, f.size + 1, f.shape[1])
            matrices.append(csr_array((f.ravel(), unknown.ravel(), ends), shape=(len(f), STATES * m)))
            columns.append([np.broadcast_to(x, node.shape) for x in (group, right, step)])

        j = np.flatnonzero(~self.cut)
        measured = [0, 1] * (e.velocity is not None) + [2] * (e.rate is not None)
        at_rows, at_nodes = axes[measured][:, rows], axes[measured][:, nodes[j]]
        # What constants change: the first equation of samples and of nodes, rows of begin and end, and
        # the directions of the axes.
        self.parts = (
            (0, nodes[at], rows, at_rows),
            (rows.size * len(measured), nodes[j], nodes[j + 1], -at_nodes),
        )
        for k, a in zip(measured, at_rows, strict=True):  # pose of a node + way from there = sample
            way = (a * (moved[rows] - moved[nodes[at]])).sum(axis=1)
            timed = np.where(moves[k][at], way, 0.0)
            add(k, at, (a, timed), (a * pose[rows]).sum(axis=1) - (way - timed))
        for k, a in zip(measured, at_nodes, strict=True):  # pose of the next node - pose of a node = way
            way = (a * (moved[nodes[j + 1]] - moved[nodes[j]])).sum(axis=1)
            timed = np.where(moves[k][j], way, 0.0)
            add(TURN if k == HEADING else DRIFT, j, (-a, -timed, a), way - timed, steps[j])
        j = np.flatnonzero(~self.cut[:-1] & ~self.cut[1:])
        change = np.tile([-1.0, 0.0, 0.0, 0.0, 1.0], (j.size, 1))
        add(CLOCK, j, (change,), 0.0, 0.5 * (steps[j] + steps[j + 1]), first=clock)
        add(RATE, every, (np.ones(m),), 1.0, first=clock)
        for i in range(clock):
            add(FIXED, every, (np.full(m, NEGLIGIBLE),), 0.0, first=i)
        matrix: Any = vstack(matrices, format="csr")
        group, self.right, lengths = (np.concatenate(x) for x in zip(*columns, strict=True))
        root = 1.0 / np.sqrt(lengths)
        self.present = sorted(set(group.tolist()) - {RATE, FIXED})
        normals = []
        for g in range(FIXED + 1):  # lower band of M^T W M, in which two neighbouring nodes lie
            of = matrix[group == g]
            normal = of.T @ (of * (root[group == g] ** 2)[:, None])
            normals.append([np.pad(normal.diagonal(-k), (0, k)) for k in range(2 * STATES)])
        # The walk of the clock and its anchor are one prior, which counts as a whole.
        counts = np.array([np.sum(group == g) if g < CLOCK else 0 for g in range(FIXED + 1)])
        self.equations = Equations(matrix, matrix.T, root, group, np.array(normals), counts)

    def border(self, constants: Sequence[FaultColumn], clock: np.ndarray) -> np.ndarray:
        """(equations, constants): what one unit of each constant changes, with a rate of the clock."""
        made = np.zeros((self.right.size, len(constants)))
        run = np.interp(self.evidence.time, self.edges, integral_of(self.edges, clock))
        pace = np.diff(run) / np.diff(self.evidence.time)
        for k, fault in enumerate(constants):
            path = fault.path
            if fault.clocked:
                steps = np.diff(path, axis=0) * pace[:, None]
                path = np.vstack([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
            for begin, start, end, a in self.parts:
                change = np.einsum("qni,ni->qn", a, path[end] - path[start]).ravel()
                made[begin : begin + change.size, k] = change
        return made

    def solve(self, constants: Sequence[FaultColumn], fixed_clock: bool = False) -> "Path":
        """The likeliest path with some constant faults; a fixed clock runs evenly at rate 1."""
        place, angle = self.noise
        samples, walk = np.array([place, place, angle]), np.array([place, angle, 1.0])
        std = np.array([*samples, *(BEGIN * walk), NEGLIGIBLE if fixed_clock else ANCHOR, 1.0])
        least = LEAST * np.array([*samples, *(walk / np.sqrt(self.edges[-1] - self.edges[0]))])
        path = Path(self, constants, std, np.ones(self.nodes.size - 1))
        free = [g for g in self.present if not (fixed_clock and g == CLOCK)]
        last: tuple[np.ndarray, np.ndarray] | None = None
        for _ in range(SWEEPS):
            new = np.log(np.maximum([path.likeliest_std(g) for g in free], least[free]))
            step, ahead = new - np.log(path.std[free]), 0.0
            if last is not None and (bend := step - last[1]).any():
                ahead = (step @ bend) / (bend @ bend) * (last[0] - new)
            last = new, step
            std = path.std.copy()
            std[free] = np.maximum(np.exp(new + np.clip(ahead, -FURTHER, FURTHER)), least[free])
            path = Path(self, constants, std, path.clock)
            if (np.abs(step) <= NEGLIGIBLE).all():
                break
        return path

    def outliers(self, path: "Path") -> frozenset[int]:
        """Samples far from the path."""
        _, _, rows, a = self.parts[0]
        off = np.abs(path.residual[: len(a) * rows.size]).reshape(len(a), -1)
        return frozenset(rows[(off > OUTLIER).any(axis=0)].tolist())


class Path:
    """The likeliest path for some variances.

    Args:
        problem: its equations.
        columns: constant faults that are looked for.
        std: (8,), standard deviations of the groups.
        clock: (m - 1,), rate of the clock between the nodes, by which the constants act.

    Attributes:
        clock: (m - 1,), rate c between the nodes.
        constants: (k,), value of each constant fault.
        covariance: (k, k), of these.
        residual: standardised, of each equation.
        criterion: -2 log of the likelihood, restricted to all but the constants.
    """

    def __init__(
        self, problem: PathProblem, columns: Sequence[FaultColumn], std: np.ndarray, clock: np.ndarray
    ) -> None:
        self.problem, self.columns, self.std = problem, columns, std
        self.system = LinearSystem(problem.equations, std**-2.0)
        data = np.column_stack([problem.right, problem.border(columns, clock)])
        found = self.system.solve(data)
        off = self.system.residual(data, found)
        left, border, self._by_constants = off[:, 0], off[:, 1:], found[:, 1:]
        self.covariance = np.linalg.pinv(border.T @ border, hermitian=True)
        self.constants = self.covariance @ (border.T @ left)
        unknown = found[:, 0] - self._by_constants @ self.constants
        self.clock, self._heading = unknown[CLOCKS][:-1], unknown[HEADING::STATES]
        self.residual = left - border @ self.constants
        clocks = [CLOCK, RATE]
        prior = np.tensordot(self.system.precision[clocks], problem.equations.normals[clocks], 1)
        factor = cholesky_banded(prior[::STATES, CLOCKS], lower=True)
        self.criterion = self.system.deviance(self.residual) - 2.0 * float(np.log(factor[0]).sum())

    @property
    def heading(self) -> np.ndarray:
        """(n,) [rad]: between the nodes as the yaw rate has it."""
        e, nodes = self.problem.evidence, self.problem.nodes
        return e.turned + np.interp(e.time, e.time[nodes], self._heading - e.turned[nodes])

    def likeliest_std(self, group: int) -> float:
        """Standard deviation of a group by its residuals and the equations that it has to itself."""
        off = self.residual[self.problem.equations.group == group]
        alone = max(off.size - self.system.trace(group), 1.0)
        return float(self.std[group] * np.sqrt((off**2).sum() / alone))

    @property
    def deviation(self) -> np.ndarray:
        """(k,), standard deviation of the constants."""
        return np.sqrt(np.diag(self.covariance))

    def mean_clock(self, weights: np.ndarray) -> np.ndarray:
        """(k,): standard deviation of weighted means (k, m) of the clock's rate at the nodes."""
        right = np.zeros((len(self._by_constants), weights.shape[0]))
        right[CLOCKS] = weights.T
        by_constants = self._by_constants.T @ right
        variance = (right * self.system.inverse(right)).sum(axis=0)
        variance += (by_constants * (self.covariance @ by_constants)).sum(axis=0)
        return np.sqrt(variance)


def noisier_than_pose(e: Evidence, of_pose: Sequence[float]) -> bool:
    """Whether noise of velocity or yaw rate, integrated between two nodes, is beyond that of the pose.

    Samples of the pose in between would have it in place of their own, and the clock would lessen it.
    """
    step = float(np.median(np.diff(e.time)))
    beside = (e.velocity, None if e.rate is None else e.rate[:, None])
    walks = [0.0 if x is None else float(np.hypot.reduce(noise_of(x))) for x in beside]
    walked = np.sqrt(step * SPACING) * np.array(walks)
    return bool((walked > np.asarray(of_pose)).any())


def _spaced(time: np.ndarray, spacing: float) -> np.ndarray:
    """Indices of times [s] at least that far apart."""
    kept, last = [], -np.inf
    for k, t in enumerate(time.tolist()):
        if t - last >= spacing * (1.0 - NEGLIGIBLE):
            kept.append(k)
            last = t
    return np.array(kept)


def integral_of(edges: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """(m,): true time [s] at the nodes since the first, for the rate of the clock between them.

    Between two nodes that noise has made fall the later one is put off: all others keep their time.
    """
    least = NEGLIGIBLE * (edges - edges[0])
    true = np.concatenate([[0.0], np.cumsum(clock * np.diff(edges))])
    return np.maximum.accumulate(true - least) + least
