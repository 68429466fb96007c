"""The rival of every effect: other nominal coefficients, as uncertain as the ship's description states.

The search takes each coefficient as known to a tenth, see :mod:`.prior`. A ship whose coefficients are
all off by what its description allows differs by more, and a single effect may imitate that. So models
are compared in which the coefficients are known to a tenth, or as stated, at even odds:

    with the effects, known to a tenth       with the effects, as stated
    without one of them, as stated           without any, as stated

The evidence of each is that of a linear Gaussian model (Laplace's approximation), in which an effect's
parameters have the prior that one sample would give (unit information: log n for each, R. E. Kass and
L. Wasserman, Journal of the American Statistical Association 90, 1995). Where all other coefficients
turn out to be right within a tenth, wide priors cost their Occam factors, and the effect stays.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import expit, logsumexp

from .most_likely import ridge


class LinearProblem(NamedTuple):
    """A model error that effects and coefficients are fitted to, linear about an estimate.

    Attributes:
        y: (n,), model error of the estimate, in units of the noise.
        effects: (n, p), columns of the effects' parameters.
        coefficients: (n, q), columns of the coefficients, in prior standard deviations.
        offset: (q,), how far each coefficient already is from its prior mean.
        per_parameter: log of the number of samples.
    """

    y: np.ndarray
    effects: np.ndarray
    coefficients: np.ndarray
    offset: np.ndarray
    per_parameter: float

    def log_evidence(self, wider: np.ndarray, charged: int) -> float:
        """Logarithm of the evidence, but for a constant that all models of one noise share.

        Args:
            wider: (q,), prior standard deviation of each coefficient, in those of its column.
            charged: number of parameters of the effects, those that have no column included.
        """
        A = np.concatenate([self.effects, self.coefficients], axis=1)
        p = self.effects.shape[1]
        precision = np.concatenate([np.zeros(p), wider**-2.0])
        offset = np.concatenate([np.zeros(p), self.offset])
        H = A.T @ A + np.diag(precision)
        H += ridge(H)
        step = np.linalg.solve(H, A.T @ self.y - precision * offset)
        loss = np.sum((self.y - A @ step) ** 2) + np.sum(precision * (offset + step) ** 2)
        occam = np.linalg.slogdet(H)[1] - np.linalg.slogdet(H[:p, :p])[1] + 2.0 * np.sum(np.log(wider))
        return float(-0.5 * (loss + occam + charged * self.per_parameter))


def probability_beside_coefficients(
    present: Sequence[float], absent: Mapping[int, Sequence[float]], prior: float
) -> float:
    """Probability of an effect, or of one of a set, beside models without it.

    Args:
        present: log evidences of models with all effects.
        absent: number of effects that are left out -> log evidences of models without them.
        prior: odds of one effect before the data: of a missing effect they are even, shared by all
            candidates (J. G. Scott and J. O. Berger, Annals of Statistics 38, 2010).
    """
    without = [e - k * np.log(prior) for k, models in absent.items() for e in models]
    odds = logsumexp(present) - np.log(len(present)) - logsumexp(without) + np.log(len(without))
    return float(expit(odds))
