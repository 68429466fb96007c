"""Partial least squares of the model error, 3.1.3 and 7.3, cross-validated over sequential blocks.

    X = Z P_x^T + E_x,  Y = Z P_y^T + E_y,  Z = X W (P_x^T W)^-1,  y = c + B x   (3.10)-(3.11), corrected

Columns are centred and divided by their standard deviations. scikit-learn regresses (NIPALS).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosim import InputError

from .principal_components import BLOCKS, sequential, standardise
from .recipes import Recipe
from .samples import NU, OMEGA, TAU, Samples

AXES = ("X", "Y", "N")


def regression(X: np.ndarray, Y: np.ndarray, factors: int) -> Any:
    """A fitted ``sklearn.cross_decomposition.PLSRegression``.

    Raises:
        InputError: scikit-learn is missing.
    """
    try:
        from sklearn.cross_decomposition import PLSRegression
    except ModuleNotFoundError:
        raise InputError("PLS needs scikit-learn: pip install 'cybership[analysis]'") from None
    return PLSRegression(factors, scale=True).fit(X, Y)


def plain(model: Any) -> tuple[np.ndarray, np.ndarray]:
    """c (p,) and B (p, m) of y = c + B x in the units of the data."""
    B = np.asarray(model.coef_)
    return model.predict(np.zeros((1, B.shape[1]))).reshape(-1), B


def folds(X: np.ndarray, Y: np.ndarray, factors: int, blocks: int = BLOCKS) -> list[Any]:
    """A regression without each of the sequential blocks."""
    return [
        regression(np.delete(X, rows, axis=0), np.delete(Y, rows, axis=0), factors)
        for rows in sequential(X.shape[0], blocks)
    ]


def left_over(X: np.ndarray, Y: np.ndarray, most: int, rest: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Squared error (most, p) on rows of a regression of the rest, by 1 ... most factors.

    The factors of NIPALS do not depend on how many follow, so that one regression with all gives each.
    """
    m = regression(X[rest], Y[rest], most)
    Z, scale = m.transform(X[rows]), Y[rest].std(axis=0, ddof=1)
    guess = np.cumsum(Z.T[:, :, None] * (m.y_loadings_.T * scale)[:, None, :], axis=0)
    return np.sum((Y[rows] - Y[rest].mean(axis=0) - guess) ** 2, axis=1)


def press(X: np.ndarray, Y: np.ndarray, most: int, blocks: int = BLOCKS) -> np.ndarray:
    """Squared error (most, p) of blocks left out, by 1 ... most factors, (3.14)."""
    every = np.arange(X.shape[0])
    parts = sequential(X.shape[0], blocks)
    return sum(
        (left_over(X, Y, most, np.setdiff1d(every, rows), rows) for rows in parts),
        np.zeros((most, Y.shape[1])),
    )


def enough(error: np.ndarray, least: float = 0.01) -> int:
    """The fewest factors whose cross-validated error is within 1 % of the least (chosen)."""
    total = error.sum(axis=1)
    return int(np.argmax(total <= (1.0 + least) * total.min())) + 1


@dataclass(frozen=True, eq=False)
class AxesRegression:
    """The regression of some axes of the model error on one X.

    Attributes:
        axes: places of the axes among X, Y, N.
        factors: number of factors.
        model: scikit-learn's.
        c, B: of y = c + B x.
        std: (p, m), standard deviation of B over the folds.
        sign_changes: (p, m), folds in which the sign is another.
        r2, q2: (p,), explained and cross-validated share of the sum of squares about the mean.
        by_factors, r2_by_factors: (most, p), q2 and r2 of 1 ... most factors.
    """

    axes: tuple[int, ...]
    factors: int
    model: Any
    c: np.ndarray
    B: np.ndarray
    std: np.ndarray
    sign_changes: np.ndarray
    r2: np.ndarray
    q2: np.ndarray
    by_factors: np.ndarray
    r2_by_factors: np.ndarray


@dataclass(frozen=True, eq=False)
class Regressed:
    """A recipe on runs in a row.

    Attributes:
        recipe: that was followed.
        samples: of all runs.
        X: (n, m), the organised columns.
        columns: their names.
        parts: one regression, or one for each axis.
        clipped: state -> share of its values outside of its range; empty without ranges.
    """

    recipe: Recipe
    samples: Samples
    X: np.ndarray
    columns: list[str]
    parts: Sequence[AxesRegression]
    clipped: dict[str, float]

    @property
    def c(self) -> np.ndarray:
        """(3,) [N, N, N m]."""
        return np.concatenate([p.c for p in self.parts])

    @property
    def B(self) -> np.ndarray:
        """(3, m), force by unit of each column."""
        return np.vstack([p.B for p in self.parts])

    @property
    def predicted(self) -> np.ndarray:
        """The model's omega (n, 3) [N, N, N m]."""
        return self.c + self.X @ self.B.T

    def by_axis(self, name: str) -> dict[str, Any]:
        """An attribute of the parts for each axis."""
        found = {}
        for part in self.parts:
            value = getattr(part, name)
            for k, axis in enumerate(part.axes):
                found[AXES[axis]] = value[k] if isinstance(value, np.ndarray) else value
        return found


def fitted(X: np.ndarray, Y: np.ndarray, axes: tuple[int, ...], recipe: Recipe) -> AxesRegression:
    """The regression of some axes."""
    y = Y[:, axes]
    most = min(recipe.factors or recipe.most, np.linalg.matrix_rank(X - X.mean(axis=0)))
    error = press(X, y, most)
    factors = min(recipe.factors or enough(error), most)
    total = np.sum((y - y.mean(axis=0)) ** 2, axis=0)
    m = regression(X, y, factors)
    c, B = plain(m)
    each = np.array([plain(f)[1] for f in folds(X, y, factors)])
    left = left_over(X, y, most, np.arange(len(y)), np.arange(len(y)))
    return AxesRegression(
        axes,
        factors,
        m,
        c,
        B,
        each.std(axis=0, ddof=1),
        np.sum(each * B < 0.0, axis=0),
        1.0 - left[factors - 1] / total,
        1.0 - error[factors - 1] / total,
        1.0 - error / total,
        1.0 - left / total,
    )


def regressed(samples: Samples, recipe: Recipe) -> Regressed:
    """Follow a recipe on samples.

    Raises:
        InputError: scikit-learn is missing, a column is constant, or there are too few samples.
    """
    transformer = recipe.transformer()
    states = dict(zip([*NU, *TAU], samples.x.T, strict=True))
    given = np.column_stack([states[name] for name in recipe.columns])
    standardise(given, list(recipe.columns))
    standardise(samples.omega, list(OMEGA))
    X = transformer.fit_transform(given)
    columns = [str(name) for name in transformer.get_feature_names_out()]
    if recipe.kind != "quadratic":  # a bin that nothing ever lies in says nothing
        seen = X.std(axis=0) > 0.0
        X, columns = X[:, seen], [n for n, s in zip(columns, seen, strict=True) if s]
    if X.shape[0] < 2 * BLOCKS * X.shape[1]:
        raise InputError(f"{X.shape[0]} samples are too few for {X.shape[1]} columns")
    together: list[tuple[int, ...]] = [(0,), (1,), (2,)] if recipe.separate else [(0, 1, 2)]
    parts = [fitted(X, samples.omega, axes, recipe) for axes in together]
    share = getattr(transformer, "clipped_", [])
    clipped = {n: float(x) for n, x in zip(recipe.columns, share, strict=False)}
    return Regressed(recipe, samples, X, columns, parts, clipped)
