"""Gram matrices of all candidates, block by block.

With the model error y and the regressors X of a block in units of the noise, a block holds
[y X]^T [y X]. Sums over blocks give every regression, its folds and its bootstrap replicates without
the data themselves.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..predictors import WeakWindows
from ..predictors.weak_form import OVERLAP
from ..runs.run_constants import PARTS
from .candidates import SLIGHT, Candidate, CandidateShape
from .most_likely import ridge

FOLDS = 8  # 1, of cross-validation over blocks, and parts of a run whose scores are compared; chosen
WHOLE_RUNS = 3  # 1, runs, from which on whole ones are left out in turn; contract


@dataclass(frozen=True, eq=False)
class Nuisance:
    """Nuisance parameters, fitted along with every candidate.

    Their prior penalty is (offset + b)^T precision (offset + b) for a change b.

    Attributes:
        columns: (K, 3, q), force of one unit of each.
        precision: (q, q), prior precision: 1 on the diagonal for a nominal coefficient, in prior
            standard deviations; 0 for a parameter of an effect that was found before.
        offset: (q,), how far each already is from its prior mean.
        unit: (q,), what one unit of each is at the size of the ship; 1 for a nominal coefficient.
    """

    columns: np.ndarray
    precision: np.ndarray
    offset: np.ndarray
    unit: np.ndarray


class Folds(NamedTuple):
    """Of each fold the blocks held out (h,), and the Gram matrix of all others, (folds, p, p)."""

    held: list[np.ndarray]
    train: np.ndarray


class Entry(NamedTuple):
    """One shape of a candidate among the columns.

    Attributes:
        given: index of the column of what is given, -1 without one.
        columns: indices of its fitted columns.
        start: (p,), where the fitted parameters are at first.
        precision: (p, p), their prior precision.
        offset: (q,), offset of the nuisance parameters that belongs to what is given.
        nonlinear: number of parameters that are given, not fitted.
        removed_noise: fall of the loss by the noise alone, see :func:`.candidates.removed_noise`.
    """

    given: int
    columns: list[int]
    start: np.ndarray
    precision: np.ndarray
    offset: np.ndarray
    nonlinear: int
    removed_noise: float


@dataclass(frozen=True, eq=False)
class GramTable:
    """All columns of one problem as Gram matrices, block by block.

    Attributes:
        grams: (blocks, p, p), in units of the noise; column 0 is the model error.
        rows: windows in each block.
        runs: number of each block's run.
        entries: columns of each shape of each candidate, and last of no candidate at all.
        nuisance: indices of the nuisance parameters' columns.
        precision: (q, q), their prior precision.
        unit: (p,), what one unit of each column's parameter is at the size of the ship.
        sigma: (3,), standard deviation of the noise of each axis [N, N, N m].
    """

    grams: np.ndarray
    rows: np.ndarray
    runs: np.ndarray
    entries: list[list[Entry]]
    nuisance: list[int]
    precision: np.ndarray
    unit: np.ndarray
    sigma: np.ndarray

    @cached_property
    def total(self) -> np.ndarray:
        """(p, p), over all blocks."""
        return self.grams.sum(axis=0)

    @cached_property
    def by_block(self) -> Folds:
        """Folds of interleaved blocks of all runs."""
        return self._folds(np.arange(len(self.grams)) % FOLDS)

    @cached_property
    def by_run(self) -> Folds:
        """Each run as a fold of its own."""
        return self._folds(self.runs)

    def _folds(self, number: np.ndarray) -> Folds:
        held = [np.flatnonzero(number == n) for n in np.unique(number)]
        return Folds(held, np.stack([self.total - self.grams[k].sum(axis=0) for k in held]))

    @property
    def per_parameter(self) -> float:
        """Complexity penalty of one parameter: log n of the Bayesian information criterion."""
        return charge_of(int(self.rows.sum()))


def charge_of(windows: int) -> float:
    """Complexity penalty of one parameter by a number of windows, see :class:`GramTable`."""
    return float(np.log(3.0 * windows / OVERLAP))


def noise(y: np.ndarray, columns: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """RMS of what even all columns together leave of the model error, by axis, at least ``floor``."""

    sizes = np.sum(columns**2, axis=0)  # of each column on each axis
    acts = sizes > SLIGHT * sizes.max(axis=0)  # what is rounding would explain some by chance

    def left(axis: int) -> float:
        A = columns[:, axis, acts[axis]]
        scale = np.sqrt((A**2).mean(axis=0))
        A = A / scale
        gram = A.T @ A
        gram += ridge(gram, np.inf)
        fit = A @ np.linalg.solve(gram, A.T @ y[:, axis])
        return float(np.sqrt(np.mean((y[:, axis] - fit) ** 2)))

    return np.maximum([left(axis) for axis in range(3)], floor)


def gram_table(
    y: np.ndarray,
    blocks: np.ndarray,
    candidates: Sequence[Candidate],
    nuisance: Nuisance,
    sigma: np.ndarray,
) -> GramTable:
    """Gram matrices of some candidates.

    Args:
        y: (K, 3), model error [N, N, N m].
        blocks: (K, 2), run and block of each window, see :func:`block_numbers`.
        candidates: with their shapes.
        nuisance: parameters that are fitted along.
        sigma: (3,), standard deviation of the noise of each axis.
    """
    columns, units, count = [], [], 0

    def added(force: np.ndarray, unit: np.ndarray) -> list[int]:
        """Indices of further columns."""
        nonlocal count
        columns.append(force)
        units.append(unit)
        count += unit.size
        return list(range(count - unit.size, count))

    def entry(s: CandidateShape) -> Entry:
        given = -1 if s.offset is None else added(s.offset[:, :, None], np.ones(1))[0]
        start = np.array([s.given.get(n, 0.0) for n in s.fitted])
        precision = np.zeros((start.size, start.size)) if s.precision is None else s.precision
        offset = nuisance.offset if s.nuisance_offset is None else s.nuisance_offset
        nonlinear = len(set(s.given) - set(s.fitted))
        noise = 0.0 if s.removed_noise is None else float(np.sum(s.removed_noise / sigma**2) / OVERLAP)
        columns_of = added(s.columns, s.unit)
        return Entry(given, columns_of, start, precision, offset, nonlinear, max(noise, 0.0))

    added(y[:, :, None], np.ones(1))
    entries = [[entry(s) for s in c.shapes] for c in candidates]
    entries.append([Entry(-1, [], np.zeros(0), np.zeros((0, 0)), nuisance.offset, 0, 0.0)])
    indices = added(nuisance.columns, nuisance.unit)
    A = np.concatenate(columns, axis=2) / sigma[:, None] / np.sqrt(OVERLAP)
    names, number, rows = np.unique(blocks, axis=0, return_inverse=True, return_counts=True)
    parts = [A[number.ravel() == k].reshape(-1, A.shape[2]) for k in range(rows.size)]
    grams, unit = np.stack([part.T @ part for part in parts]), np.concatenate(units)
    return GramTable(grams, rows, names[:, 0], entries, indices, nuisance.precision, unit, sigma)


def block_numbers(data: Sequence[WeakWindows]) -> np.ndarray:
    """(K, 2), number of the run, and of the block in it, of each window of some runs."""
    runs = np.repeat(np.arange(len(data)), [w.block.size for w in data])
    return np.column_stack([runs, np.concatenate([w.block for w in data])])


def run_folds(data: Sequence[WeakWindows], least: int = WHOLE_RUNS) -> list[tuple[int, np.ndarray]]:
    """The parts of some runs that are left out in turn.

    Args:
        data: windows of every run.
        least: number of runs from which on whole ones are left out.

    Returns:
        For each fold the number of a run and the numbers of its blocks: all of them where there are
        ``least`` or more runs, else those of a stretch of time.
    """
    stretches = 1 if len(data) >= least else -(-PARTS // len(data))
    counts = [np.unique(w.block).size for w in data]
    return [
        (run, blocks)
        for run, n in enumerate(counts)
        for blocks in np.array_split(np.arange(n), min(stretches, n))
    ]


def block_folds(data: Sequence[WeakWindows], least: int = WHOLE_RUNS) -> list[np.ndarray]:
    """The same, the blocks counted through all runs."""
    first = np.cumsum([0, *(np.unique(w.block).size for w in data)])
    return [first[run] + blocks for run, blocks in run_folds(data, least)]
