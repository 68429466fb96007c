"""What runs say about rival hypotheses: linear Gaussian models by their Gram matrices alone.

All hypotheses share one vector of parameters: the nuisance parameters of all, and those of each effect.
A hypothesis has some of them. Data y = X z + e with unit noise count by G = X^T X and b = X^T y, which
add up over runs; the Gram matrix of a planned run needs no measurement. Everything is fitted anew on old
and new data together, so that the criteria have the nuisance parameters projected out.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations

import numpy as np
from scipy.special import logit, ndtr

from cosim import InputError
from cosim.errors import nearest

from ..runs.run_constants import DIGITS, LEVEL

# nats, log odds of a cause that alone is the set with the probability LEVEL; the aim of a design
ODDS = float(logit(LEVEL))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A possible cause: ids of its effects, and which of all parameters it has.

    Attributes:
        ids: of its effects; none: the coefficients alone.
        columns: (s,), indices of its parameters.
        own: (o,), those of them that are not nuisance parameters.
    """

    ids: tuple[str, ...]
    columns: np.ndarray
    own: np.ndarray

    @property
    def name(self) -> str:
        return " + ".join(self.ids) or "coefficients alone"


@dataclass(frozen=True, eq=False)
class HypothesisEstimate:
    """Parameters of a hypothesis by some data: mean (p,), zero where it has none, covariance (s, s)."""

    mean: np.ndarray
    covariance: np.ndarray


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What is known before a run that is planned.

    Attributes:
        hypotheses: the candidate causes.
        weights: (h,), their probabilities; together 1.
        G, b: (p, p) and (p,), of all data so far, in units of the noise.
        precision: (p, p), prior precision.
        prior: (p,), prior mean.
        listed: probability that one of the hypotheses holds, by the diagnosis.
    """

    hypotheses: Sequence[Hypothesis]
    weights: np.ndarray
    G: np.ndarray
    b: np.ndarray
    precision: np.ndarray
    prior: np.ndarray
    listed: float

    def plus(self, G: np.ndarray) -> "Knowledge":
        """The knowledge after a planned run whose data agree with what is expected."""
        mean = sum(w * e.mean for w, e in zip(self.weights, self.estimates, strict=True))
        return replace(self, G=self.G + G, b=self.b + G @ mean)

    @cached_property
    def estimates(self) -> list[HypothesisEstimate]:
        """Of each hypothesis, by the data so far."""
        return [self.estimate(h) for h in self.hypotheses]

    def estimate(self, h: Hypothesis) -> HypothesisEstimate:
        """The parameters of a hypothesis by the data so far."""
        s = h.columns
        P = self.precision[np.ix_(s, s)]
        C = _inverse(self.G[np.ix_(s, s)] + P)
        mean = np.zeros(self.prior.size)
        mean[s] = C @ (self.b[s] + P @ self.prior[s])
        return HypothesisEstimate(mean, C)

    @cached_property
    def log_evidence(self) -> np.ndarray:
        """(h,), log probability of the data so far by each hypothesis, but for a constant [nats]."""
        found = []
        for h, e in zip(self.hypotheses, self.estimates, strict=True):
            s, m = h.columns, e.mean[h.columns]
            P, G, off = self.precision[np.ix_(s, s)], self.G[np.ix_(s, s)], m - self.prior[s]
            misfit = m @ G @ m - 2.0 * self.b[s] @ m + off @ P @ off
            found.append(0.5 * (np.linalg.slogdet(P)[1] + np.linalg.slogdet(e.covariance)[1] - misfit))
        return np.array(found)


def _inverse(A: np.ndarray) -> np.ndarray:
    """The inverse of a symmetric positive definite matrix, scaled to a unit diagonal for its sake."""
    scale = 1.0 / np.sqrt(np.diag(A))
    return np.linalg.inv(A * scale * scale[:, None]) * scale * scale[:, None]


def projected(k: Knowledge, i: int, j: int, z: np.ndarray, G: np.ndarray) -> float:
    """Squared distance of hypothesis j from the data that i gives, all of j's parameters refitted.

    With d = z - z_j it is min over z_j of d^T G d + (z_j - mu)^T P (z_j - mu): of the Fisher information
    the Schur complement of what j has. In units of the noise's variance, [1].

    Args:
        k: the hypotheses and the prior.
        i, j: numbers of the hypotheses.
        z: (p,), parameters by which i is true; of them its own count.
        G: (p, p), Gram matrix of old and new data together.
    """
    own, s = k.hypotheses[i].own, k.hypotheses[j].columns
    true = np.zeros(z.size)
    true[own] = z[own]
    P, mu = k.precision[np.ix_(s, s)], k.prior[s]
    image = G @ true
    fitted = _inverse(G[np.ix_(s, s)] + P) @ (image[s] + P @ mu)
    d = true.copy()
    d[s] -= fitted
    return float(d @ G @ d + (fitted - mu) @ P @ (fitted - mu))


@dataclass(frozen=True, eq=False)
class Prediction:
    """What hypotheses predict of a planned run, in coordinates of unit noise.

    Attributes:
        mean: (h, r).
        covariance: (h, r, r), noise included.
    """

    mean: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(cls, k: Knowledge, G: np.ndarray) -> "Prediction":
        """The predictions of a run with the Gram matrix G (p, p).

        Of all data of the run only the coordinates in the span of its regressors differ between
        hypotheses; G = L L^T has these.
        """
        values, vectors = np.linalg.eigh(G)
        kept = values > DIGITS * max(values[-1], np.finfo(float).tiny)
        L = (vectors[:, kept] * np.sqrt(values[kept])).T
        mean = np.array([L @ e.mean for e in k.estimates])
        covariances = [
            L[:, h.columns] @ e.covariance @ L[:, h.columns].T
            for h, e in zip(k.hypotheses, k.estimates, strict=True)
        ]
        return cls(mean, np.array(covariances) + np.eye(len(L)))

    def log_ratio(self, i: int, j: int) -> tuple[float, float]:
        """Mean and standard deviation of ln p_i(y) - ln p_j(y) where i is true [nats]."""
        d, Vi = self.mean[i] - self.mean[j], self.covariance[i]
        inverse = np.linalg.inv(self.covariance[j])
        M = inverse @ Vi
        logs = np.linalg.slogdet(self.covariance[j])[1] - np.linalg.slogdet(Vi)[1]
        back = inverse @ d
        mean = 0.5 * (np.trace(M) - len(d) + logs + d @ back)
        excess = M - np.eye(len(d))
        return float(mean), float(np.sqrt(max(0.5 * np.trace(excess @ excess) + back @ Vi @ back, 0.0)))


def pairs(k: Knowledge) -> list[tuple[int, int]]:
    """Ordered pairs of different hypotheses: the first is true, the second is its rival."""
    return [*permutations(range(len(k.hypotheses)), 2)]


def box_hill(k: Knowledge, G: np.ndarray) -> float:
    """Upper bound of the expected change of the weights' entropy [nats].

    G. E. P. Box and W. J. Hill, Discrimination among mechanistic models, Technometrics 9, 1967.
    """
    p = Prediction.of(k, G)
    return float(sum(k.weights[i] * k.weights[j] * p.log_ratio(i, j)[0] for i, j in pairs(k)))


def buzzi_ferraris(k: Knowledge, G: np.ndarray) -> float:
    """T of the pair that is separated worst, with the covariance of the predictions [1].

    T = d^T (V_i + V_j)^-1 d + tr(2 R (V_i + V_j)^-1) over the number of coordinates, with the noise R:
    G. Buzzi-Ferraris, P. Forzatti, G. Emig and H. Hofmann, Chemical Engineering Science 39, 1984.
    """
    p, found = Prediction.of(k, G), [np.inf]
    for i, j in pairs(k):
        d, S = p.mean[i] - p.mean[j], np.linalg.inv(p.covariance[i] + p.covariance[j])
        found.append(float(d @ S @ d + 2.0 * np.trace(S)) / max(len(d), 1))
    return min(found)


def d_optimal(k: Knowledge, G: np.ndarray) -> float:
    """Half of the log determinant by which the information of the likeliest hypothesis grows [nats]."""
    k_best = int(np.argmax(k.weights))
    s, C = k.hypotheses[k_best].columns, k.estimates[k_best].covariance
    return float(0.5 * np.linalg.slogdet(np.eye(s.size) + C @ G[np.ix_(s, s)])[1])


def a_optimal(k: Knowledge, G: np.ndarray) -> float:
    """Minus the mean relative variance that a run leaves of the likeliest hypothesis' parameters [1]."""
    k_best = int(np.argmax(k.weights))
    h, before = k.hypotheses[k_best], k.estimates[k_best].covariance
    after = k.plus(G).estimate(h).covariance
    return -float(np.mean(np.diag(after) / np.diag(before)))


def certainty(k: Knowledge, G: np.ndarray) -> float:
    """Probability that a run raises the true hypothesis above LEVEL against its worst rival [1].

    The log ratio of a pair is taken as normal, see :meth:`Prediction.log_ratio`. Hundredths are added,
    by which the search proceeds where this is zero or one everywhere: the mean of 1 - exp(-ratio) over
    all pairs, and by how much the effects' own parameters become narrower (D_s-optimality: A. C.
    Atkinson and A. N. Donev, Optimum Experimental Designs, 1992).
    """
    p, n, after = Prediction.of(k, G), len(k.hypotheses), k.plus(G)
    worst, gain = np.ones(n), 0.0
    for i, j in pairs(k):
        mean, std = p.log_ratio(i, j)
        prior = np.log(max(k.weights[i], DIGITS) / max(k.weights[j], DIGITS))
        worst[i] = min(worst[i], ndtr((mean + prior - ODDS) / max(std, DIGITS)))
        gain -= k.weights[i] * np.expm1(-mean) / max(n - 1, 1)
    narrower = [_own_gain(h, *(x.estimate(h).covariance for x in (k, after))) for h in k.hypotheses]
    return float(k.weights @ worst + 0.01 * gain + 0.01 * (k.weights @ narrower))


def _own_gain(h: Hypothesis, before: np.ndarray, after: np.ndarray) -> float:
    """Mean factor by which the standard deviations of the own parameters fall, as a logarithm [nats]."""
    own = np.isin(h.columns, h.own)
    logs = [np.linalg.slogdet(C[np.ix_(own, own)])[1] for C in (before, after)]
    return float(0.5 * (logs[0] - logs[1]) / max(own.sum(), 1))


Criterion = Callable[[Knowledge, np.ndarray], float]
CRITERIA: Mapping[str, Criterion] = {
    "certainty": certainty,
    "box-hill": box_hill,
    "buzzi-ferraris": buzzi_ferraris,
    "d-optimal": d_optimal,
    "a-optimal": a_optimal,
}


def inseparable(k: Knowledge, grams: Sequence[np.ndarray]) -> list[tuple[int, int]]:
    """Pairs that no planned run separates: on average it leaves the odds of the truth below 95 to 5.

    Even odds before are assumed. A squared distance D gives the log odds D / 2 on average.

    Args:
        k: the hypotheses; of each the parameters by the data so far.
        grams: of all runs that can be carried out.
    """

    def best(i: int, j: int) -> float:
        z = k.estimates[i].mean
        return max((projected(k, i, j, z, k.G + G) for G in grams), default=0.0)

    return [(i, j) for i, j in pairs(k) if i < j and min(best(i, j), best(j, i)) < 2.0 * ODDS]


def check_criterion(name: str) -> None:
    """Refuse what is not a criterion.

    Raises:
        InputError: names the nearest one, and all.
    """
    if name not in CRITERIA:
        raise InputError(f"no criterion '{name}'{nearest(name, CRITERIA)}")
