"""Which effect explains the model error best, and how sure that is.

Every candidate is fitted together with changes of all nominal coefficients, which are believed to within
a prior (generalised least squares), and judged by blocks of time that the fit has not seen.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from .table import Fold, Table

RIDGE = 1e-9
# Below this a column holds nothing on these data.
NOTHING = 1e-12


class Fit(NamedTuple):
    """A model fitted.

    Attributes:
        used, left: columns and their weights, whose sum is what is left of the model error.
        beta: free coefficients.
        unlikely: sum of squares of the nominal coefficients' changes, in standard deviations.
    """

    used: np.ndarray
    left: np.ndarray
    beta: np.ndarray
    unlikely: float

    def loss(self, grams: np.ndarray) -> np.ndarray:
        """Sum of squares left in each of some Gram matrices (..., p, p)."""
        part = grams[..., self.used[:, None], self.used]
        return (part @ self.left) @ self.left


class Pieces(NamedTuple):
    """One shape of a candidate, and what is fitted along.

    Attributes:
        target: (p,), weights of the columns that are to be explained.
        use: free columns of the candidate, then what is fitted along.
        free: how many of them are the candidate's.
        stiff, moved: how unlikely all these are, and where they are at first.
        bent: parameters that were given, not fitted.
    """

    target: np.ndarray
    use: np.ndarray
    free: int
    stiff: np.ndarray
    moved: np.ndarray
    bent: int

    def fitted(self, gram: np.ndarray) -> Fit:
        """Maximum a posteriori: as well as may be, and no further than is likely."""
        H = gram[self.use[:, None], self.use] + self.stiff
        diagonal = np.einsum("ii->i", H)
        diagonal += RIDGE * (diagonal + 1.0)
        given = np.flatnonzero(self.target)
        right = gram[self.use[:, None], given] @ self.target[given] - self.stiff @ self.moved
        beta = np.linalg.solve(H, right)
        last = self.moved + beta
        return Fit(
            np.concatenate([given, self.use]),
            np.concatenate([self.target[given], -beta]),
            beta[: self.free],
            float(last @ self.stiff @ last),
        )

    def size(self, gram: np.ndarray) -> float:
        """How many parameters it has; one that is held by others counts in part."""
        k = self.use[: self.free]
        data = gram[k[:, None], k]
        ridge = RIDGE * np.diag(np.diag(data) + 1.0)
        return (
            float(np.trace(np.linalg.solve(data + self.stiff[: k.size, : k.size] + ridge, data)))
            + self.bent
        )


def pieces(t: Table, candidate: int, shape: int) -> Pieces:
    """A candidate's shape in the table; candidate -1 is none at all."""
    key = candidate, shape
    target = np.zeros(t.grams.shape[1])
    target[0] = 1.0
    offset, columns = t.place.get(key, (-1, []))
    if offset >= 0:
        target[offset] = -1.0
    plain = not t.stiff[key].any()
    live = np.array([k for k, c in enumerate(columns) if not plain or t.total[c, c] > NOTHING], int)
    use = np.array([*[columns[k] for k in live], *t.doubt])
    stiff = np.asarray(block_diag(t.stiff[key][live[:, None], live], t.doubt_stiff))
    moved = np.concatenate([t.given[key][live], t.moved[key]])
    return Pieces(target, use, live.size, stiff, moved, t.bent[key])


@dataclass(frozen=True, eq=False)
class Judged:
    """A candidate judged.

    Attributes:
        candidate, shape: which, and the shape that fits all data best.
        blocks: (blocks,), loss of each block by a fit that has not seen it.
        runs: loss of all runs, each by a fit to the others; that of the blocks where there is one run.
        charge: what its parameters cost, and the changes of nominal coefficients that it needs.
    """

    candidate: int
    shape: int
    blocks: np.ndarray
    runs: float
    charge: float

    @property
    def score(self) -> float:
        """Lower is better."""
        return float(self.blocks.sum()) + self.charge


def judge(t: Table, candidate: int, shapes: int) -> Judged:
    """Cross-validated loss of a candidate, its shape chosen by the training part of each fold."""
    options = [pieces(t, candidate, k) for k in range(shapes)]
    found = unseen(t, options, t.by_block)
    by_run = unseen(t, options, t.by_run) if len(t.by_run) > 1 else found
    whole = [o.fitted(t.total) for o in options]
    shape = int(np.argmin([float(w.loss(t.total)) + w.unlikely for w in whole]))
    charge = options[shape].size(t.total) * t.price + whole[shape].unlikely
    return Judged(candidate, shape, found, float(by_run.sum()), charge)


def unseen(t: Table, options: Sequence[Pieces], folds: Sequence[Fold]) -> np.ndarray:
    """Loss of each block by the fit, of the shape that does best, to all other folds (blocks,)."""
    found = np.empty(len(t.grams))
    for held, train in folds:
        fits = [o.fitted(train) for o in options]
        best = min(fits, key=lambda one, train=train: float(one.loss(train)) + one.unlikely)
        found[held] = [best.loss(t.grams[k]) for k in held]
    return found


def first_share(
    t: Table, judged: Sequence[Judged], replicates: int, rng: np.random.Generator
) -> np.ndarray:
    """Share of block-bootstrap replicates in which each of the judged comes first."""
    wins = np.zeros(len(judged))
    count = len(t.grams)
    models = [pieces(t, j.candidate, j.shape) for j in judged]
    sizes = [m.size(t.total) for m in models]
    for _ in range(replicates):
        weights = np.bincount(rng.integers(0, count, count), minlength=count).astype(float)
        gram = np.tensordot(weights, t.grams, axes=1)
        fits = [m.fitted(gram) for m in models]
        scores = [
            float(f.loss(gram)) + f.unlikely + size * t.price
            for f, size in zip(fits, sizes, strict=True)
        ]
        wins[int(np.argmin(scores))] += 1
    return wins / replicates
