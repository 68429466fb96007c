"""What others make of the same runs: PySINDy's STLSQ and scikit-learn's PLS.

Both get the model error in weak form and the very columns of the diagnosis' candidates, one for each
coefficient; of an effect that is not straight, the shape that alone explains most. The effect whose
column has the largest standardised coefficient counts as the first. Their settings are chosen by
cross-validation over blocks of time, as it would be done by hand.
"""

import warnings
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from pysindy.optimizers import STLSQ
from sklearn.cross_decomposition import PLSRegression
from sklearn.model_selection import GroupKFold

from diagnosis.library import Shape, evaluate, library
from diagnosis.model import Model
from diagnosis.weak import Integrals

from .truth import WEIGHTS

FAILED = "failed"  # where a library comes to no end
FOLDS = 4
THRESHOLDS = (0.03, 0.1, 0.3)  # of standardised coefficients
COMPONENTS = (1, 2, 3, 5, 8)
Fitted = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


class Features(NamedTuple):
    """Standardised columns (3 K, p), the effect of each, the model error (3 K,), blocks of rows."""

    columns: np.ndarray
    effects: list[str]
    target: np.ndarray
    blocks: np.ndarray


def features(data: Sequence[Integrals]) -> Features:
    """The columns of all candidates on some runs."""
    model = Model()
    base = evaluate(data, model)
    target = (base * WEIGHTS).reshape(-1)
    columns, effects = [], []
    for candidate in library(data, model, base):
        found = max((_flat(s) for s in candidate.shapes), key=lambda c: _alone(c[:, 0], target))
        columns.append(found)
        effects += [candidate.effect.id] * found.shape[1]
    A = np.concatenate(columns, axis=1)
    size = A.std(axis=0)
    kept = size > 1e-9 * target.std()
    blocks = np.repeat(np.concatenate([10_000 * k + w.block for k, w in enumerate(data)]), 3)
    used = [e for e, keep in zip(effects, kept, strict=True) if keep]
    return Features(A[:, kept] / size[kept], used, target / target.std(), blocks)


def _flat(shape: Shape) -> np.ndarray:
    """Columns (3 K, p) of a shape in units of noise, what is given first."""
    given = [] if shape.offset is None else [shape.offset[:, :, None]]
    stacked = np.concatenate([*given, shape.columns], axis=2) * WEIGHTS[:, None]
    return stacked.reshape(-1, stacked.shape[2])


def _alone(column: np.ndarray, target: np.ndarray) -> float:
    """How much of the target a column explains by itself."""
    return abs(float(column @ target)) / max(float(np.linalg.norm(column)), 1e-12)


def firsts(data: Sequence[Integrals]) -> tuple[str, str]:
    """The first effect by PySINDy's STLSQ, and by PLS; FAILED where one comes to no end."""
    f = features(data)
    found = []
    for fitted, settings in ((sparse, THRESHOLDS), (latent, COMPONENTS)):
        try:
            found.append(_first(f, fitted, settings))
        except np.linalg.LinAlgError:
            found.append(FAILED)
    return found[0], found[1]


def sparse(A: np.ndarray, y: np.ndarray, threshold: float) -> np.ndarray:
    """Coefficients by sequentially thresholded least squares (STLSQ) of PySINDy."""
    q, r = np.linalg.qr(A)  # the same least squares with fewer rows
    return np.ravel(STLSQ(threshold=threshold, alpha=1e-3).fit(r, (q.T @ y)[:, None]).coef_)


def latent(A: np.ndarray, y: np.ndarray, components: float) -> np.ndarray:
    """Coefficients by partial least squares (PLSRegression) of scikit-learn."""
    return np.ravel(PLSRegression(int(components), scale=False).fit(A, y).coef_)


def _first(f: Features, fitted: Fitted, settings: Sequence[float]) -> str:
    """The effect with the largest coefficient, by the setting that predicts unseen blocks best."""
    folds = list(GroupKFold(FOLDS).split(f.columns, groups=f.blocks))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "all coefficients eliminated" is an answer
        losses = []
        for s in settings:
            fits = [(b, fitted(f.columns[a], f.target[a], s)) for a, b in folds]
            losses.append(sum(np.sum((f.target[b] - f.columns[b] @ beta) ** 2) for b, beta in fits))
        beta = fitted(f.columns, f.target, settings[int(np.argmin(losses))])
    return f.effects[int(np.argmax(np.abs(beta)))] if beta.any() else "nothing"
