"""Which effect explains the model error best, and how sure that is.

Every candidate is fitted together with changes of all nominal coefficients, which are believed to within
a prior (generalised least squares), and judged by blocks of time that the fit has not seen. All of it
works on one Gram matrix for each block of 15 s, so that folds and bootstrap replicates cost next to
nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .library import Candidate

FOLDS = 8
# Windows overlap: this many count as one.
OVERLAP = 4.0
RIDGE = 1e-9
# Below this a column holds nothing on these data.
NOTHING = 1e-12


@dataclass(frozen=True, eq=False)
class Table:
    """All columns of one problem as Gram matrices, block by block.

    Attributes:
        grams: (blocks, p, p), in units of the noise; column 0 is the model error.
        rows: windows in each block.
        place: (candidate, shape) -> (index of its offset or -1, indices of its columns).
        nuisance: indices of the nominal coefficients.
        sigma: (3,), noise of each axis [N, N, N m].
    """

    grams: np.ndarray
    rows: np.ndarray
    place: dict[tuple[int, int], tuple[int, list[int]]]
    nuisance: list[int]
    sigma: np.ndarray

    @cached_property
    def total(self) -> np.ndarray:
        """(p, p), over all blocks."""
        return self.grams.sum(axis=0)


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
    y: np.ndarray,
    blocks: np.ndarray,
    candidates: Sequence[Candidate],
    nuisance: np.ndarray,
    floor: np.ndarray,
) -> Table:
    """Put everything into one table.

    Args:
        y: (K, 3), model error.
        blocks: (K,), number of the block of each window.
        candidates: with their shapes.
        nuisance: (K, 3, q), one standard deviation of each nominal coefficient.
        floor: (3,), least noise of each axis.
    """
    straight = np.concatenate([s.columns for c in candidates for s in c.shapes[:1]] + [nuisance], axis=2)
    sigma = noise(y, straight, floor)
    columns = [y[:, :, None]]
    count = 1
    place: dict[tuple[int, int], tuple[int, list[int]]] = {}
    for i, c in enumerate(candidates):
        for j, s in enumerate(c.shapes):
            offset = -1
            if s.offset is not None:
                columns.append(s.offset[:, :, None])
                offset = count
                count += 1
            columns.append(s.columns)
            place[i, j] = offset, list(range(count, count + s.columns.shape[2]))
            count += s.columns.shape[2]
    columns.append(nuisance)
    indices = list(range(count, count + nuisance.shape[2]))
    A = np.concatenate(columns, axis=2) / sigma[:, None] / np.sqrt(OVERLAP)
    names = np.unique(blocks)
    grams = np.empty((names.size, A.shape[2], A.shape[2]))
    for k, name in enumerate(names):
        part = A[blocks == name].reshape(-1, A.shape[2])
        grams[k] = part.T @ part
    rows = np.array([(blocks == name).sum() for name in names])
    return Table(grams, rows, place, indices, sigma)


class Fit(NamedTuple):
    """A model fitted: what is left as a vector over the columns, its free coefficients, and how unlikely
    the changes of the nominal ones are (their sum of squares in standard deviations)."""

    left: np.ndarray
    beta: np.ndarray
    unlikely: float

    def loss(self, grams: np.ndarray) -> np.ndarray:
        """Sum of squares left in each of some Gram matrices (..., p, p)."""
        return np.einsum("i,...ij,j->...", self.left, grams, self.left)


def fit(gram: np.ndarray, target: np.ndarray, free: list[int], nuisance: list[int]) -> Fit:
    """Maximum a posteriori: free columns at will, nominal coefficients within their prior."""
    use = [*free, *nuisance]
    H = gram[np.ix_(use, use)].copy()
    diagonal = np.einsum("ii->i", H)
    diagonal[: len(free)] += RIDGE * (diagonal[: len(free)].max(initial=0.0) + 1.0)
    diagonal[len(free) :] += 1.0
    beta = np.linalg.solve(H, gram[use] @ target)
    left = target.copy()
    left[use] -= beta
    return Fit(left, beta[: len(free)], float((beta[len(free) :] ** 2).sum()))


class Pieces(NamedTuple):
    """One shape of a candidate: the target left to explain, free columns, parameters counted."""

    target: np.ndarray
    free: list[int]
    size: int

    def fitted(self, gram: np.ndarray, nuisance: list[int]) -> Fit:
        return fit(gram, self.target, self.free, nuisance)


def pieces(t: Table, candidate: int, shape: int) -> Pieces:
    """A candidate's shape in the table; candidate -1 is none at all."""
    target = np.zeros(t.grams.shape[1])
    target[0] = 1.0
    if candidate < 0:
        return Pieces(target, [], 0)
    offset, columns = t.place[candidate, shape]
    if offset >= 0:
        target[offset] = -1.0
    free = [k for k in columns if t.total[k, k] > NOTHING]
    return Pieces(target, free, len(free) + (offset >= 0))


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate judged.

    Attributes:
        candidate, shape: which, and the shape that fits all data best.
        blocks: (blocks,), loss of each block by a fit that has not seen it.
        charge: what its parameters cost, and the changes of nominal coefficients that it needs.
    """

    candidate: int
    shape: int
    blocks: np.ndarray
    charge: float

    @property
    def score(self) -> float:
        """Lower is better."""
        return float(self.blocks.sum()) + self.charge


def judge(t: Table, candidate: int, shapes: int) -> Judged:
    """Cross-validated loss of a candidate, its shape chosen by the training part of each fold."""
    fold = np.arange(len(t.grams)) % FOLDS
    options = [pieces(t, candidate, k) for k in range(shapes)]
    found = np.empty(len(t.grams))
    for f in range(FOLDS):
        train = t.total - t.grams[fold == f].sum(axis=0)
        fits = [o.fitted(train, t.nuisance) for o in options]
        best = min(fits, key=lambda one, train=train: float(one.loss(train)) + one.unlikely)
        found[fold == f] = best.loss(t.grams[fold == f])
    whole = [o.fitted(t.total, t.nuisance) for o in options]
    shape = int(np.argmin([float(w.loss(t.total)) + w.unlikely for w in whole]))
    charge = options[shape].size * price(t) + whole[shape].unlikely
    return Judged(candidate, shape, found, charge)


def price(t: Table) -> float:
    """What one more parameter must gain (as of the Bayesian information criterion)."""
    return float(np.log(3.0 * t.rows.sum() / OVERLAP))


def first_share(
    t: Table, judged: Sequence[Judged], replicates: int, rng: np.random.Generator
) -> np.ndarray:
    """Share of block-bootstrap replicates in which each of the judged comes first."""
    wins = np.zeros(len(judged))
    count = len(t.grams)
    models = [pieces(t, j.candidate, j.shape) for j in judged]
    for _ in range(replicates):
        weights = np.bincount(rng.integers(0, count, count), minlength=count).astype(float)
        gram = np.tensordot(weights, t.grams, axes=1)
        fits = [m.fitted(gram, t.nuisance) for m in models]
        scores = [
            float(f.loss(gram)) + f.unlikely + m.size * price(t)
            for f, m in zip(fits, models, strict=True)
        ]
        wins[int(np.argmin(scores))] += 1
    return wins / replicates
