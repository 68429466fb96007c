"""What others make of the same runs: PySINDy's STLSQ and scikit-learn's PLS.

Both get the model error in weak form and the very columns of the diagnosis' candidates, one for each
coefficient and, where an effect is not straight, one for each of its shapes. The effect whose column has
the largest standardised coefficient counts as the first. Their settings are chosen by cross-validation
over blocks of time, as it would be done by hand.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from pysindy.optimizers import STLSQ
from sklearn.cross_decomposition import PLSRegression
from sklearn.model_selection import GroupKFold

from diagnosis.library import evaluate, library
from diagnosis.model import Model
from diagnosis.weak import Integrals

from .truth import WEIGHTS

FOLDS = 5
THRESHOLDS = (0.01, 0.03, 0.1, 0.3)  # of standardised coefficients
COMPONENTS = tuple(range(1, 11))


class Features(NamedTuple):
    """Standardised columns (3 K, p), the effect of each, the model error (3 K,), the block of each row."""

    columns: np.ndarray
    effects: list[str]
    target: np.ndarray
    blocks: np.ndarray


def features(data: Sequence[Integrals]) -> Features:
    """The columns of all candidates on some runs."""
    model = Model()
    base = evaluate(data, model)
    columns, effects = [], []
    for candidate in library(data, model, base):
        for k, shape in enumerate(candidate.shapes):
            given = [] if shape.offset is None else [shape.offset[:, :, None]]
            for part in [*given, *([shape.columns] if k == 0 else [])]:
                columns.append(part)
                effects += [candidate.effect.id] * part.shape[2]
    A = (np.concatenate(columns, axis=2) * WEIGHTS[:, None]).reshape(-1, len(effects))
    y = (base * WEIGHTS).reshape(-1)
    size = A.std(axis=0)
    kept = size > 1e-9 * y.std()
    blocks = np.repeat(np.concatenate([10_000 * k + w.block for k, w in enumerate(data)]), 3)
    used = [e for e, keep in zip(effects, kept, strict=True) if keep]
    return Features(A[:, kept] / size[kept], used, y / y.std(), blocks)


def first_by_sindy(f: Features) -> str:
    """The first effect by sequentially thresholded least squares (STLSQ) of PySINDy."""

    def fitted(A: np.ndarray, y: np.ndarray, threshold: float) -> np.ndarray:
        return np.ravel(STLSQ(threshold=threshold, alpha=1e-3).fit(A, y[:, None]).coef_)

    return _largest(f, fitted, THRESHOLDS)


def first_by_pls(f: Features) -> str:
    """The first effect by partial least squares (PLSRegression) of scikit-learn."""

    def fitted(A: np.ndarray, y: np.ndarray, components: float) -> np.ndarray:
        return np.ravel(PLSRegression(int(components), scale=False).fit(A, y).coef_)

    return _largest(f, fitted, COMPONENTS)


def _largest(
    f: Features, fitted: Callable[[np.ndarray, np.ndarray, float], np.ndarray], settings: Sequence[float]
) -> str:
    """The effect with the largest coefficient, by the setting that predicts unseen blocks best."""
    folds = list(GroupKFold(FOLDS).split(f.columns, groups=f.blocks))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "all coefficients eliminated" is an answer
        losses = [
            sum(
                np.sum((f.target[b] - f.columns[b] @ fitted(f.columns[a], f.target[a], s)) ** 2)
                for a, b in folds
            )
            for s in settings
        ]
        beta = fitted(f.columns, f.target, settings[int(np.argmin(losses))])
    return f.effects[int(np.argmax(np.abs(beta)))] if beta.any() else "none"
