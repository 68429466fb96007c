"""Cluster-robust means of correlated samples, and Welch's test between two of them.

Samples within a cluster may be correlated in any way, clusters are independent.

K. Y. Liang and S. L. Zeger, Longitudinal data analysis using generalized linear models, Biometrika 73
(1986); B. L. Welch, The generalization of "Student's" problem, Biometrika 34 (1947).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import stdtr


class ClusterMean(NamedTuple):
    """A mean over clusters, the cluster-robust variance of that mean, and its degrees of freedom."""

    mean: float
    variance: float
    dof: int


def numbered(runs: Sequence[np.ndarray]) -> np.ndarray:
    """(K,), numbers of clusters over all runs, from those (K_i,) within each run."""
    return np.unique(np.concatenate([k + 1j * n for k, n in enumerate(runs)]), return_inverse=True)[1]


def cluster_mean(total: np.ndarray, count: np.ndarray) -> ClusterMean:
    """Mean of all samples, with its cluster-robust (sandwich) variance.

    With sum s_g and number n_g of the samples of cluster g, n = sum n_g, and G clusters that have any::

        mean = sum s_g / n,    variance = G / (G - 1) sum (s_g - n_g mean)^2 / n^2,    dof = G - 1

    Args:
        total: (clusters,), sum of the samples of each.
        count: (clusters,), number of samples of each; a cluster without samples does not count.
    """
    filled = count > 0
    n, clusters = float(count.sum()), int(filled.sum())
    mean = float(total.sum()) / max(n, 1.0)
    residual = total[filled] - count[filled] * mean
    variance = float(residual @ residual) / max(n, 1.0) ** 2 * clusters / max(clusters - 1, 1)
    return ClusterMean(mean, variance, clusters - 1)


def welch_p_value(a: ClusterMean, b: ClusterMean) -> float:
    """One-sided p-value of Welch's test that the expectation of a is not above that of b.

    Returns:
        A probability; 1 where a mean has no degree of freedom or neither has a variance.
    """
    variance = a.variance + b.variance
    if a.dof < 1 or b.dof < 1 or variance <= 0.0:
        return 1.0
    dof = variance**2 / (a.variance**2 / a.dof + b.variance**2 / b.dof)  # Satterthwaite
    return float(stdtr(dof, (b.mean - a.mean) / np.sqrt(variance)))
