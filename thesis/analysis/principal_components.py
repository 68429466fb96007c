"""Principal components, 3.1.2, and outliers by Hotelling's T2 and the Q residual, 3.1.5, corrected.

With the columns of X centred and divided by their standard deviations, X = T P^T + E: the scores
T = U Sigma are orthogonal, the loadings P = V orthonormal (the thesis swaps the two words).
"""

from dataclasses import dataclass

import numpy as np
from scipy import stats

from cosim import InputError

BLOCKS = 8  # sequential parts of the cross-validation, 7.3.1
EXPLAINED = 0.9  # share of the variance that the components kept explain, at the least (chosen)
LEVEL = 0.99  # of both limits


@dataclass(frozen=True, eq=False)
class PrincipalComponents:
    """The components of a data matrix (n, m).

    Attributes:
        mean, scale: (m,), of the columns.
        loadings: (m, m), columns p_1 ... p_m.
        variance: (m,), of the scores, falling.
        samples: n.
        kept: number of components of the model.
    """

    mean: np.ndarray
    scale: np.ndarray
    loadings: np.ndarray
    variance: np.ndarray
    samples: int
    kept: int

    @property
    def explained(self) -> np.ndarray:
        """(m,), share of the variance that the first 1 ... m components explain together, (3.13)."""
        return np.cumsum(self.variance) / self.variance.sum()

    def scores(self, X: np.ndarray) -> np.ndarray:
        """Z = X P (n, kept), (3.9)."""
        return ((X - self.mean) / self.scale) @ self.loadings[:, : self.kept]

    def residuals(self, X: np.ndarray) -> np.ndarray:
        """E (n, m), in standard deviations of the columns."""
        return (X - self.mean) / self.scale - self.scores(X) @ self.loadings[:, : self.kept].T

    def t2(self, X: np.ndarray) -> np.ndarray:
        """Hotelling's T2 (n,): squared scores over their variances, (3.17), corrected."""
        return np.sum(self.scores(X) ** 2 / self.variance[: self.kept], axis=1)

    def q(self, X: np.ndarray) -> np.ndarray:
        """Squared residual (n,), over the variables, (3.16), corrected."""
        return np.sum(self.residuals(X) ** 2, axis=1)

    @property
    def t2_limit(self) -> float:
        """Limit of T2 of a new sample by the F distribution, a (n^2 - 1) / (n (n - a)) F."""
        a, n = self.kept, self.samples
        return a * (n * n - 1.0) / (n * (n - a)) * float(stats.f.ppf(LEVEL, a, n - a))

    @property
    def q_limit(self) -> float:
        """Limit of Q by Jackson and Mudholkar (1979), from the variances that are left out.

        Where one of them is far larger than the others, h0 is negative, the normal approximation has no
        upper limit from some level on, and the limit is infinite.
        """
        left = self.variance[self.kept :]
        t1, t2, t3 = (float(np.sum(left**k)) for k in (1, 2, 3))
        if not t1 > 0.0:
            return 0.0
        h0 = 1.0 - 2.0 * t1 * t3 / (3.0 * t2 * t2) or 1e-9
        c = float(stats.norm.ppf(LEVEL))
        inner = c * h0 * np.sqrt(2.0 * t2) / t1 + 1.0 + t2 * h0 * (h0 - 1.0) / (t1 * t1)
        return t1 * float(inner ** (1.0 / h0)) if inner > 0.0 else np.inf


def standardise(X: np.ndarray, names: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Mean and standard deviation of the columns.

    Raises:
        InputError: a column is constant.
    """
    mean, scale = X.mean(axis=0), X.std(axis=0, ddof=1)
    flat = [n for n, s, m in zip(names, scale, mean, strict=True) if not s > 1e-9 * max(abs(m), 1e-6)]
    if flat:
        raise InputError(f"constant over all samples, so without information: {', '.join(flat)}")
    return mean, scale


def fit_components(X: np.ndarray, names: list[str], kept: int | None = None) -> PrincipalComponents:
    """The principal components of data.

    Args:
        X: (n, m), samples by variables.
        names: of the variables.
        kept: number of components of the model; by default the fewest that explain EXPLAINED.

    Raises:
        InputError: a column is constant, or there are fewer samples than twice the variables.
    """
    n, m = X.shape
    if n < 2 * m:
        raise InputError(f"{n} samples are too few for {m} variables")
    if kept is not None and not 1 <= kept < m:
        raise InputError(f"{kept} components are not possible: 1 to {m - 1} of {m} variables")
    mean, scale = standardise(X, names)
    _, sigma, Vt = np.linalg.svd((X - mean) / scale, full_matrices=False)
    loadings = Vt.T * np.where(Vt[np.arange(m), np.abs(Vt).argmax(axis=1)] < 0.0, -1.0, 1.0)
    variance = sigma**2 / (n - 1.0)
    share = np.cumsum(variance) / variance.sum()
    least = min(int(np.searchsorted(share, EXPLAINED)) + 1, m - 1)
    return PrincipalComponents(mean, scale, loadings, variance, n, kept or least)


def sequential(n: int, blocks: int = BLOCKS) -> list[np.ndarray]:
    """Rows of each of the sequential parts of a cross-validation."""
    return np.array_split(np.arange(n), blocks)


def validated(X: np.ndarray, names: list[str], blocks: int = BLOCKS) -> np.ndarray:
    """Q2 (m,) of 1 ... m components, (3.14)-(3.15): 1 - PRESS / SS over sequential blocks left out.

    A block is projected on loadings found without it.
    """
    n, m = X.shape
    press, total = np.zeros(m), 0.0
    for rows in sequential(n, blocks):
        rest = np.delete(X, rows, axis=0)
        mean, scale = standardise(rest, names)
        P = np.linalg.svd((rest - mean) / scale, full_matrices=False)[2].T
        Z = (X[rows] - mean) / scale
        total += float(np.sum(Z**2))
        left = np.sum(Z**2) - np.cumsum(np.sum((Z @ P) ** 2, axis=0))
        press += np.maximum(left, 0.0)
    return 1.0 - press / total


@dataclass(frozen=True)
class Removed:
    """Samples in a row that were removed.

    Attributes:
        first, last: rows.
        why: ``T2``, ``Q`` or ``T2 and Q``: which limit was exceeded.
        variable: the one that contributes most to the largest excess.
    """

    first: int
    last: int
    why: str
    variable: str


def outliers(model: PrincipalComponents, X: np.ndarray) -> np.ndarray:
    """(n,), samples beyond one of the two limits."""
    return (model.t2(X) > model.t2_limit) | (model.q(X) > model.q_limit)


def removals(
    model: PrincipalComponents, X: np.ndarray, names: list[str], group: np.ndarray
) -> list[Removed]:
    """The samples beyond the limits, those in a row of one group (n,) together."""
    t2, q = model.t2(X) / model.t2_limit, model.q(X) / model.q_limit
    bad = np.flatnonzero((t2 > 1.0) | (q > 1.0))
    if not bad.size:
        return []
    cuts = np.flatnonzero((np.diff(bad) > 1) | (group[bad][1:] != group[bad][:-1])) + 1
    found = []
    P = model.loadings[:, : model.kept]
    for rows in np.split(bad, cuts):
        by_t2, by_q = bool((t2[rows] > 1.0).any()), bool((q[rows] > 1.0).any())
        worst = rows[np.argmax(np.maximum(t2[rows], q[rows]))]
        z = (X[worst] - model.mean) / model.scale
        part = z * (P @ (z @ P / model.variance[: model.kept]))  # contributions to T2
        if q[worst] >= t2[worst]:
            part = (z - P @ (z @ P)) ** 2
        why = "T2 and Q" if by_t2 and by_q else "T2" if by_t2 else "Q"
        found.append(Removed(int(rows[0]), int(rows[-1]), why, names[int(part.argmax())]))
    return found
