"""Maximum a posteriori regression of the model error, and its cross-validated loss.

With the model error y in units of the noise, the candidate's regressors X with coefficients beta, and
the nuisance regressors Z with coefficients b, the fit minimises

    |y - X beta - Z b|^2 + (beta_0 + beta)^T P (beta_0 + beta) + (o + b)^T Q (o + b),

where P, Q are prior precisions and beta_0, o how far the parameters already are from their prior mean.
A candidate's score is its loss on blocks that the fit has not seen, the prior penalty of the fit to all
data, and log n for each effective parameter, tr((X^T X + P)^-1 X^T X), as of the Bayesian information
criterion.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag

from ..runs.run_constants import DIGITS
from .candidates import SLIGHT
from .gram import Folds, GramTable
from .most_likely import ridge

REPLICATES = 200  # 1, of the block bootstrap: the standard error of a share is 3.5 % at the most


def _form(matrix: np.ndarray, x: np.ndarray) -> np.ndarray:
    """x^T A x of symmetric matrices A (..., p, p) and vectors (..., p)."""
    return (np.matmul(matrix, x[..., None])[..., 0] * x).sum(axis=-1)


class RegressionFit(NamedTuple):
    """A fitted regression, or several of the same columns.

    Attributes:
        used, left: columns (n,) and weights (..., n), whose sum is what is left of the model error.
        beta: (..., p), fitted coefficients of the candidate.
        penalty: (...), prior penalty of all fitted parameters.
    """

    used: np.ndarray
    left: np.ndarray
    beta: np.ndarray
    penalty: np.ndarray

    def loss(self, grams: np.ndarray) -> np.ndarray:
        """Sum of squares left in each of some Gram matrices (..., p, p)."""
        part = grams[..., self.used[:, None], self.used]
        return _form(part, self.left)


class CandidateRegression(NamedTuple):
    """One shape of a candidate, and the nuisance parameters.

    Attributes:
        target: (p,), weights of the columns that are to be explained.
        use: columns fitted: the candidate's, then the nuisance parameters'.
        free: how many of them are the candidate's.
        precision, offset: their prior precision, and distance from the prior mean at first.
        nonlinear: number of parameters that were given, not fitted.
        unit: (q,), what one unit of each is at the size of the ship.
    """

    target: np.ndarray
    use: np.ndarray
    free: int
    precision: np.ndarray
    offset: np.ndarray
    nonlinear: int
    unit: np.ndarray

    def fitted(self, gram: np.ndarray) -> RegressionFit:
        """The maximum a posteriori fits to data with Gram matrices (..., p, p)."""
        H = gram[..., self.use[:, None], self.use] + self.precision
        diagonal = np.einsum("...ii->...i", H)
        diagonal += DIGITS * (diagonal + self.unit**-2.0)
        given = np.flatnonzero(self.target)
        right = gram[..., self.use[:, None], given] @ self.target[given] - self.precision @ self.offset
        beta = np.linalg.solve(H, right[..., None])[..., 0]
        target = np.broadcast_to(self.target[given], (*beta.shape[:-1], given.size))
        return RegressionFit(
            np.concatenate([given, self.use]),
            np.concatenate([target, -beta], axis=-1),
            beta[..., : self.free],
            _form(self.precision, self.offset + beta),
        )

    def size(self, gram: np.ndarray) -> float:
        """Effective number of the candidate's parameters, those that were given included."""
        k = self.use[: self.free]
        data = gram[k[:, None], k]
        regular = data + self.precision[: k.size, : k.size] + ridge(data, self.unit[: k.size])
        inverse = np.linalg.solve(regular, data)
        return float(np.trace(inverse)) + self.nonlinear


def regression(t: GramTable, candidate: int, shape: int) -> CandidateRegression:
    """A candidate's shape as a regression; candidate -1 is none at all."""
    entry = t.entries[candidate][shape]
    target = np.zeros(t.grams.shape[1])
    target[0] = 1.0
    if entry.given >= 0:
        target[entry.given] = -1.0
    plain = not entry.precision.any()
    sizes = [t.total[c, c] * t.unit[c] ** 2 for c in entry.columns]
    live = np.array([k for k, size in enumerate(sizes) if not plain or size > SLIGHT], int)
    use = np.array([*[entry.columns[k] for k in live], *t.nuisance])
    precision = np.asarray(block_diag(entry.precision[live[:, None], live], t.precision))
    offset = np.concatenate([entry.start[live], entry.offset])
    return CandidateRegression(target, use, live.size, precision, offset, entry.nonlinear, t.unit[use])


def fitted_columns(t: GramTable, candidate: int, shape: int) -> dict[int, float]:
    """Of each column of a candidate's shape that is fitted its coefficient, by all data."""
    r = regression(t, candidate, shape)
    return dict(zip(r.use.tolist(), r.fitted(t.total).beta.tolist(), strict=False))


@dataclass(frozen=True, eq=False)
class Scored:
    """A candidate with its cross-validated loss.

    Attributes:
        candidate, shape: which, and the shape that fits all data best.
        blocks: (blocks,), loss of each block by a fit that has not seen it.
        runs: (blocks,), the same by a fit that has not seen its run; ``blocks`` where there is one run.
        prior: prior penalty of the fit to all data.
        complexity: log n for each effective parameter, and the noise that a filter takes away.
    """

    candidate: int
    shape: int
    blocks: np.ndarray
    runs: np.ndarray
    prior: float
    complexity: float

    @property
    def penalty(self) -> float:
        """What is charged beside the loss."""
        return self.prior + self.complexity

    @property
    def score(self) -> float:
        """Lower is better."""
        return float(self.blocks.sum()) + self.penalty


def score(t: GramTable, candidate: int, shapes: int) -> Scored:
    """Score of a candidate; in each fold its shape is chosen by the training part."""
    options = [regression(t, candidate, k) for k in range(shapes)]
    charges = np.array(
        [
            o.size(t.total) * t.per_parameter + e.removed_noise
            for o, e in zip(options, t.entries[candidate], strict=False)
        ]
    )
    by_block = held_out_loss(t, options, charges, t.by_block)
    by_run = held_out_loss(t, options, charges, t.by_run) if len(t.by_run.held) > 1 else by_block
    fits = [o.fitted(t.total) for o in options]
    shape = int(np.argmin(charges + [f.loss(t.total) + f.penalty for f in fits]))
    return Scored(candidate, shape, by_block, by_run, float(fits[shape].penalty), float(charges[shape]))


def held_out_loss(
    t: GramTable, options: Sequence[CandidateRegression], charges: np.ndarray, folds: Folds
) -> np.ndarray:
    """Loss of each block (blocks,) by the fit, of the shape that does best, to all other folds.

    Args:
        t: all columns.
        options: the candidate's shapes.
        charges: (shapes,), of the complexity of each.
        folds: whose loss is by the fit to the others.
    """
    found = np.empty(len(t.grams))
    fits = [o.fitted(folds.train) for o in options]
    best = np.argmin(
        [f.loss(folds.train) + f.penalty + c for f, c in zip(fits, charges, strict=True)], axis=0
    )
    for k, held in enumerate(folds.held):
        fit = fits[best[k]]
        # In one step: whole Gram matrices of the blocks would be copied, of which few columns are used.
        part = t.grams[held[:, None, None], fit.used[:, None], fit.used]
        found[held] = _form(part, fit.left[k])
    return found


def first_share(scored: Sequence[Scored], rng: np.random.Generator) -> np.ndarray:
    """Probability of each of some candidates (c,) beside the others, averaged over blocks drawn anew.

    In each replicate of the block bootstrap a candidate weighs exp(-score / 2), as in a posterior over
    models; the mean over replicates does not overstate what a few blocks say (J. H. Huggins and J. W.
    Miller, Reproducible model selection using bagged posteriors, Bayesian Analysis 18, 2023).
    """
    blocks = np.array([s.blocks for s in scored])
    count = blocks.shape[1]
    drawn = rng.integers(0, count, (REPLICATES, count))
    times = np.stack([np.bincount(d, minlength=count) for d in drawn])
    scores = times @ blocks.T + np.array([s.penalty for s in scored])
    weights = np.exp(-0.5 * (scores - scores.min(axis=1, keepdims=True)))
    return np.mean(weights / weights.sum(axis=1, keepdims=True), axis=0)
