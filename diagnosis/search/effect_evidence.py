"""Evidence for a finding, from which :mod:`diagnosis.verdict.confidence` makes its confidence.

A share of wins among candidates says nothing of causes that no candidate has. What does:

- bagged: the probability of the id beside the other candidates, averaged over blocks drawn anew;
- left: what is left on the effect's axes beyond the noise, as a share of what the effect explains there.
  Where a true cause is found, nothing is left but what another cause makes;
- varies: relative standard deviation between blocks of the factor by which the effect would fit best.
  The parameters of a true cause are constants; those of a stand-in change with the motion.

These two are root mean squares beyond what noise gives, so that neither grows with its level.

- nearest: what the candidate that imitates the effect best leaves of what the effect explains. Where
  something is left of the effect, too, it tells how near a cause would have to be that no candidate has.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..predictors.uncertainty import NOISE_TOLERANCE
from ..runs.run_constants import LEVEL


class EffectEvidence(NamedTuple):
    """What speaks for a finding.

    Attributes:
        bagged: probability of the id beside the other candidates, 0...1.
        left: RMS of what is left beyond noise, over that of the effect's force, on its axes.
        varies: relative standard deviation of the effect's size between blocks, beyond noise.
        nearest: share of the squared error that the effect explains, which the best other candidate in
            its place leaves.
        remains: as ``left``, beyond the noise as it is stated, without a tolerance: a residual that is
            significant may be as small as the noise, and as large as the effect.
        listed: probability of a force beside those of actuators in proportion to another channel, see
            :mod:`.rivals`.
    """

    bagged: float
    left: float
    varies: float
    nearest: float
    remains: float
    listed: float = 1.0


def with_unknown_cause(left: float, nearest: float) -> float:
    """Probability of an effect beside causes that no candidate has.

    Unknown causes are taken to lie as close to the effect as the candidates do, of which one is within
    the distance of the nearest. As many unknown ones as known ones are then expected within the distance
    that the effect leaves, in proportion to the squared error; at most one counts.

    Args:
        left: squared error that the effect leaves, as a share of what it explains.
        nearest: the same of the nearest other candidate in its place.
    """
    return 1.0 / (1.0 + left / max(left, nearest)) if left else 1.0


def nearest_share(own: float, others: Sequence[float], nothing: float) -> float:
    """Share of what an effect explains, which the best other candidate leaves.

    Args:
        own, others: cross-validated losses with the effect, and with each candidate in its place.
        nothing: that without any.
    """
    left, gained = min(others, default=np.inf) - own, nothing - own
    return float(np.clip(left / gained, 0.0, 1.0)) if gained > 0.0 else 1.0


def credible(own: str, weights: Mapping[str, float]) -> list[str]:
    """The other ids of the smallest set that holds one and has the probability LEVEL.

    Args:
        own: the id.
        weights: id -> probability, its own included; together 1.

    Returns:
        The most likely first; empty where the id has that probability alone.
    """
    others = sorted((i for i in weights if i != own), key=lambda i: -weights[i])
    before = weights[own] + np.cumsum([0.0, *(weights[i] for i in others)])
    return [i for i, sum_so_far in zip(others, before, strict=False) if sum_so_far < LEVEL]


def evidence(
    bagged: float,
    nearest: float,
    force: np.ndarray,
    left: np.ndarray,
    std: np.ndarray,
    blocks: np.ndarray,
) -> EffectEvidence:
    """Evidence of a finding.

    Args:
        bagged, nearest: see :class:`EffectEvidence`.
        force: (K, 3), of the effect [N, N, N m].
        left: (K, 3), the model error with all that was found.
        std: (K, 3), its standard deviation by the noise of the measurement.
        blocks: (K, ...), which block each window is in.
    """
    own, noise = np.sum(force**2, axis=0), np.sum(std**2, axis=0)
    # An axis counts by how far the effect acts on it, seen through the noise.
    weight = own / noise

    def beyond(tolerance: float) -> float:
        """RMS of what is left beyond the noise, over that of the force."""
        more = np.maximum(np.sum(left**2, axis=0) - tolerance**2 * noise, 0.0)
        shares = np.divide(more, own, out=np.zeros(3), where=own > 0.0)
        return float(np.sqrt(weight @ shares / max(weight.sum(), np.finfo(float).tiny)))

    doubted = NOISE_TOLERANCE * std
    varies = variation(force / doubted, left / doubted, blocks)
    return EffectEvidence(bagged, beyond(NOISE_TOLERANCE), varies, nearest, beyond(1.0))


def variation(force: np.ndarray, left: np.ndarray, blocks: np.ndarray) -> float:
    """Relative standard deviation between blocks of the factor by which a force would fit best.

    The moment estimator of the variance between studies (R. DerSimonian and N. Laird, Meta-analysis in
    clinical trials, Controlled Clinical Trials 7, 1986).

    Args:
        force: (K, 3), of the effect, in units of the noise.
        left: (K, 3), the model error with it, in the same units.
        blocks: (K, ...), which block each window is in.
    """
    number = np.unique(blocks, axis=0, return_inverse=True)[1].ravel()
    weight = np.bincount(number, np.sum(force**2, axis=1))
    product = np.bincount(number, np.sum(force * left, axis=1))
    used = weight > 0.0
    w, x = weight[used], product[used] / weight[used]
    if w.size < 2:
        return 0.0
    spread = float(w @ (x - (w @ x) / w.sum()) ** 2)
    free = w.sum() - (w @ w) / w.sum()
    return float(np.sqrt(max(spread - (w.size - 1), 0.0) / free))
