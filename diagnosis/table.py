"""All candidates of one problem in one table: Gram matrices, block by block.

Folds, bootstrap replicates and changes of the prior then cost next to nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .library import Candidate

# Windows overlap: this many count as one.
OVERLAP = 4.0
# Blocks are numbered from here on in each run.
RUN = 10_000
FOLDS = 8


@dataclass(frozen=True, eq=False)
class Doubt:
    """What is fitted along with every candidate.

    Attributes:
        columns: (K, 3, q), force of one unit of each.
        stiff: (q, q), how unlikely they are: 1 on the diagonal for a nominal coefficient, in standard
            deviations of what is believed of it; 0 for a parameter of an effect that was found before.
        moved: (q,), how far each already is from what is believed.
    """

    columns: np.ndarray
    stiff: np.ndarray
    moved: np.ndarray


class Fold(NamedTuple):
    """Blocks held out (h,), and the Gram matrix (p, p) of all others."""

    held: np.ndarray
    train: np.ndarray


@dataclass(frozen=True, eq=False)
class Table:
    """All columns of one problem as Gram matrices, block by block.

    Attributes:
        grams: (blocks, p, p), in units of the noise; column 0 is the model error.
        rows: windows in each block.
        runs: number of each block's run.
        place: (candidate, shape) -> (index of its offset or -1, indices of its columns).
        moved: (candidate, shape) -> how far its offset moves the nominal coefficients (q,).
        bent: (candidate, shape) -> number of its parameters that are given.
        given: (candidate, shape) -> where its free parameters are (p,).
        stiff: (candidate, shape) -> how unlikely they are by themselves (p, p).
        doubt: indices of what is fitted along; the entry (-1, 0) of the above is none at all.
        doubt_stiff: (q, q), see :class:`Doubt`.
        sigma: (3,), noise of each axis [N, N, N m].
    """

    grams: np.ndarray
    rows: np.ndarray
    runs: np.ndarray
    place: dict[tuple[int, int], tuple[int, list[int]]]
    moved: dict[tuple[int, int], np.ndarray]
    bent: dict[tuple[int, int], int]
    given: dict[tuple[int, int], np.ndarray]
    stiff: dict[tuple[int, int], np.ndarray]
    doubt: list[int]
    doubt_stiff: np.ndarray
    sigma: np.ndarray

    @cached_property
    def total(self) -> np.ndarray:
        """(p, p), over all blocks."""
        return self.grams.sum(axis=0)

    @cached_property
    def by_block(self) -> list[Fold]:
        """Folds of blocks all over the runs."""
        return self._folds(np.arange(len(self.grams)) % FOLDS)

    @cached_property
    def by_run(self) -> list[Fold]:
        """Each run as a fold of its own."""
        return self._folds(self.runs)

    def _folds(self, number: np.ndarray) -> list[Fold]:
        held = [np.flatnonzero(number == n) for n in np.unique(number)]
        return [Fold(k, self.total - self.grams[k].sum(axis=0)) for k in held]

    @property
    def price(self) -> float:
        """What one more parameter must gain (as of the Bayesian information criterion)."""
        return float(np.log(3.0 * self.rows.sum() / OVERLAP))


def noise(y: np.ndarray, columns: np.ndarray, floor: np.ndarray) -> np.ndarray:
    """RMS of what even all columns together leave of the model error, by axis, at least ``floor``."""
    left = []
    for axis in range(3):
        A = columns[:, axis, :]
        A = A[:, np.abs(A).max(axis=0) > 0.0]
        scale = np.sqrt((A**2).mean(axis=0))
        A = A / scale
        gram = A.T @ A + 1e-6 * len(A) * np.eye(A.shape[1])
        fit = A @ np.linalg.solve(gram, A.T @ y[:, axis])
        left.append(np.sqrt(np.mean((y[:, axis] - fit) ** 2)))
    return np.maximum(left, floor)


def table(
    y: np.ndarray, blocks: np.ndarray, candidates: Sequence[Candidate], doubt: Doubt, sigma: np.ndarray
) -> Table:
    """Put everything into one table.

    Args:
        y: (K, 3), model error.
        blocks: (K,), number of the block of each window.
        candidates: with their shapes.
        doubt: what is fitted along.
        sigma: (3,), noise of each axis.
    """
    columns = [y[:, :, None]]
    count = 1
    place: dict[tuple[int, int], tuple[int, list[int]]] = {}
    moved = {(-1, 0): doubt.moved}
    bent = {(-1, 0): 0}
    given = {(-1, 0): np.zeros(0)}
    stiff = {(-1, 0): np.zeros((0, 0))}
    for i, c in enumerate(candidates):
        for j, s in enumerate(c.shapes):
            offset = -1
            if s.offset is not None:
                columns.append(s.offset[:, :, None])
                offset = count
                count += 1
            columns.append(s.columns)
            place[i, j] = offset, list(range(count, count + s.columns.shape[2]))
            moved[i, j] = doubt.moved if s.moved is None else s.moved
            bent[i, j] = len(set(s.given) - set(s.free))
            given[i, j] = np.array([s.given.get(n, 0.0) for n in s.free])
            size = len(s.free)
            stiff[i, j] = np.zeros((size, size)) if s.stiff is None else s.stiff
            count += s.columns.shape[2]
    columns.append(doubt.columns)
    indices = list(range(count, count + doubt.columns.shape[2]))
    A = np.concatenate(columns, axis=2) / sigma[:, None] / np.sqrt(OVERLAP)
    names = np.unique(blocks)
    grams = np.empty((names.size, A.shape[2], A.shape[2]))
    for k, name in enumerate(names):
        part = A[blocks == name].reshape(-1, A.shape[2])
        grams[k] = part.T @ part
    rows = np.array([(blocks == name).sum() for name in names])
    return Table(
        grams, rows, names // RUN, place, moved, bent, given, stiff, indices, doubt.stiff, sigma
    )
