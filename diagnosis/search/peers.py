"""Two published methods behind the same interface: PLS of scikit-learn, and STLSQ of PySINDy.

Both regress the model error in weak form on the columns of the candidates, one for each coefficient; of
an effect with several shapes, on the one that alone explains most. Columns are standardised, axes
weighted by the noise of the pose. The setting of a method is chosen by cross-validation over blocks of
time. A method chooses the effects; their parameters then follow by least squares on the columns of these
effects alone. Neither method has a prior on the nominal coefficients or a confidence.
"""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from sklearn.cross_decomposition import PLSRegression
from sklearn.model_selection import GroupKFold

from cosim import InputError

from ..execution.progress import Advance
from ..predictors import Model, WeakWindows
from ..runs.run_constants import DIGITS
from .candidates import Candidate, CandidateShape, candidates, model_error
from .findings import Finding, Findings, Ranked
from .gram import FOLDS, block_numbers
from .prior import Prior
from .shortlist import LENGTH

THRESHOLDS = (0.03, 0.1, 0.3)  # 1, of standardised coefficients, from nearly all to only the largest


class Features(NamedTuple):
    """Standardised regressors of all candidates.

    Attributes:
        columns, scale: (3 K, p) and (p,), regressors, and what they were divided by.
        owner: (p,), number of the candidate of each.
        parameters: (p,), name of the parameter of each; empty for what a shape gives.
        chosen: candidate -> the shape that stands for it.
        target, target_scale: (3 K,), standardised model error, and what it was divided by.
        blocks: (3 K,), number of the block of each row.
        sigma: (3,), weights' inverse [N, N, N m].
    """

    columns: np.ndarray
    scale: np.ndarray
    owner: np.ndarray
    parameters: Sequence[str]
    chosen: Sequence[tuple[Candidate, CandidateShape]]
    target: np.ndarray
    target_scale: float
    blocks: np.ndarray
    sigma: np.ndarray


def features(data: Sequence[WeakWindows], model: Model) -> Features:
    """The regressors of all candidates on some runs."""
    base = model_error(data, model)
    # The acceleration of pose noise, as a force.
    sigma = np.diag(model.reference_mass) * np.mean([w.smoothed.noise for w in data], axis=0)
    sigma = sigma / sigma[0]
    target = (base / sigma).reshape(-1)
    chosen, columns, units = [], [], []
    names: list[str] = []
    for c in candidates(data, model, base):
        stacked = [_stacked(s, sigma) for s in c.shapes]
        norms = [max(float(np.linalg.norm(x[:, 0])), np.finfo(float).tiny) for x in stacked]
        explained = [abs(x[:, 0] @ target) / norm for x, norm in zip(stacked, norms, strict=True)]
        best = int(np.argmax(explained))
        shape = c.shapes[best]
        chosen.append((c, shape))
        columns.append(stacked[best])
        given = [] if shape.offset is None else [""]
        names += [*given, *shape.fitted]
        units.append(np.concatenate([np.ones(len(given)), shape.unit]))
    owner = np.repeat(np.arange(len(columns)), [x.shape[1] for x in columns])
    A = np.concatenate(columns, axis=1)
    scale, size = A.std(axis=0), float(target.std())
    live = scale * np.concatenate(units) > DIGITS * size
    blocks = np.repeat(np.unique(block_numbers(data), axis=0, return_inverse=True)[1].ravel(), 3)
    used = [n for n, keep in zip(names, live, strict=True) if keep]
    standard = A[:, live] / scale[live]
    return Features(standard, scale[live], owner[live], used, chosen, target / size, size, blocks, sigma)


def _stacked(shape: CandidateShape, sigma: np.ndarray) -> np.ndarray:
    """Columns (3 K, p) of a shape in units of noise, what is given first."""
    given = [] if shape.offset is None else [shape.offset[:, :, None]]
    stacked = np.concatenate([*given, shape.columns], axis=2) / sigma[:, None]
    return stacked.reshape(-1, stacked.shape[2])


class Peer(ABC):
    """Identification by the coefficients of one regression on all candidates.

    Attributes:
        name: of the method.
        settings: that cross-validation chooses from.
        only_first: whether only the effect with the largest coefficient is a finding.
    """

    name = ""
    settings: tuple[float, ...] = ()
    only_first = True

    @abstractmethod
    def coefficients(self, A: np.ndarray, y: np.ndarray, setting: float) -> np.ndarray:
        """Coefficients (p,) of standardised regressors (n, p) for a target (n,)."""

    def fit(
        self, runs: Sequence[WeakWindows], model: Model, prior: Prior, advance: Advance, seed: int
    ) -> Findings:
        """The effects that a model lacks, see :class:`.methods.Method`; prior and seed are not used."""
        advance("every effect as a candidate")
        f = features(runs, model)
        advance(f"{self.name}: cross-validation")
        try:
            beta = self._cross_validated(f)
        except np.linalg.LinAlgError as error:
            raise InputError(f"method '{self.name}' does not converge on these data: {error}") from None
        size = np.zeros(len(f.chosen))
        np.maximum.at(size, f.owner, np.abs(beta))
        order = [int(k) for k in np.argsort(-size, kind="stable")]
        everything = np.ones(f.owner.size, bool)
        ids = [c.effect.id for c, _ in f.chosen]
        ranking = [Ranked(ids[k], -float(size[k]), q2(f, [k], everything)) for k in order]
        accepted = [k for k in order if size[k] > 0.0][: 1 if self.only_first else None]
        used = everything if self.only_first else beta != 0.0
        values = parameters(f, accepted, used)
        found: list[Finding] = []
        before = 0.0
        for n, k in enumerate(accepted, 1):
            model, q = model.plus(values[k]), q2(f, accepted[:n], used)
            found.append(Finding(ids[k], values[k], {}, np.nan, [], q, q - before, model))
            before = q
        return Findings(found, ranking, model, [], f.sigma)

    def _cross_validated(self, f: Features) -> np.ndarray:
        """Coefficients (p,) by the setting that predicts held-out blocks best."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # all coefficients eliminated: a valid result
            losses = []
            for s in self.settings:
                fits = [(b, self.coefficients(f.columns[a], f.target[a], s)) for a, b in folds(f)]
                losses.append(sum(float(np.sum((f.target[b] - f.columns[b] @ x) ** 2)) for b, x in fits))
            return self.coefficients(f.columns, f.target, self.settings[int(np.argmin(losses))])


def folds(f: Features) -> list[tuple[np.ndarray, np.ndarray]]:
    """Rows to fit to and rows held out, by blocks."""
    count = min(FOLDS, len(np.unique(f.blocks)))
    return list(GroupKFold(count).split(f.columns, groups=f.blocks))


def problem(f: Features, effects: Sequence[int], used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns to fit of some candidates, among those that are used (p,), and what they are to explain.

    That is the target (3 K,) less the force that the shapes give.
    """
    of_these = np.isin(f.owner, effects)
    is_fitted = np.array([bool(name) for name in f.parameters])
    given = of_these & ~is_fitted
    target = f.target - f.columns[:, given] @ (f.scale[given] / f.target_scale)
    return np.flatnonzero(of_these & is_fitted & used), target


def parameters(f: Features, effects: Sequence[int], used: np.ndarray) -> dict[int, dict[str, float]]:
    """Candidate -> its parameters in SI, fitted together; arguments of :func:`problem`."""
    columns, target = problem(f, effects, used)
    beta = np.linalg.lstsq(f.columns[:, columns], target, rcond=None)[0]
    found = {k: dict(f.chosen[k][1].given) for k in effects}
    for j, x in zip(map(int, columns), beta * f.target_scale / f.scale[columns], strict=True):
        name, candidate = f.parameters[j], int(f.owner[j])
        found[candidate][name] = found[candidate].get(name, 0.0) + float(x)
    return found


def q2(f: Features, effects: Sequence[int], used: np.ndarray) -> float:
    """Cross-validated share of the model error that candidates explain; arguments of :func:`problem`."""
    columns, target = problem(f, effects, used)
    A = f.columns[:, columns]
    left = 0.0
    for train, held_out in folds(f):
        beta = np.linalg.lstsq(A[train], target[train], rcond=None)[0]
        left += float(np.sum((target[held_out] - A[held_out] @ beta) ** 2))
    return 1.0 - left / float(f.target @ f.target)


class PartialLeastSquares(Peer):
    """Partial least squares (PLSRegression of scikit-learn).

    No coefficient is zero, so only the first effect is a finding.
    """

    name = "pls"
    settings = (*range(1, LENGTH + 1),)  # latent variables

    def coefficients(self, A: np.ndarray, y: np.ndarray, setting: float) -> np.ndarray:
        """See :class:`Peer`."""
        return np.ravel(PLSRegression(int(setting), scale=False).fit(A, y).coef_)


class SparseRegression(Peer):
    """Sequentially thresholded least squares (STLSQ of PySINDy)."""

    name = "sindy"
    settings = THRESHOLDS
    only_first = False

    def __init__(self) -> None:
        from pysindy.optimizers import STLSQ  # takes seconds, and partial least squares does without

        self.optimizer = STLSQ

    def coefficients(self, A: np.ndarray, y: np.ndarray, setting: float) -> np.ndarray:
        """See :class:`Peer`."""
        q, r = np.linalg.qr(A)  # the same least squares with fewer rows
        return np.ravel(self.optimizer(threshold=setting).fit(r, (q.T @ y)[:, None]).coef_)
