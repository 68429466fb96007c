"""How states are organised as columns for a regression, 3.2: transformers for scikit-learn's pipelines.

Columns of a state over its range, Table 1 (the y limits there are swapped; corrected):

- :class:`QuadraticExtension`: products |a| b beside the states themselves, Table 3.3 and (7.14);
- :class:`NominalBins`: 1 in the bin that the state lies in, else 0, (3.18), corrected;
- :class:`ContinuousNominal`: resolution + 1 triangles that sum to one, (3.19)-(3.20), corrected.

They learn nothing of the response: fitting them before a cross-validation leaks nothing.
"""

from collections.abc import Mapping, Sequence
from itertools import combinations_with_replacement
from typing import Any, NamedTuple

import numpy as np

from cosim import InputError


class StateRange(NamedTuple):
    """Range and resolution of a state, Table 1."""

    low: float
    high: float
    resolution: int


TABLE_1: Mapping[str, StateRange] = {
    "x": StateRange(3.5, 6.5, 10),
    "y": StateRange(-2.5, 2.5, 10),
    "psi": StateRange(-np.pi, np.pi, 10),
    "u": StateRange(-0.02, 0.3, 10),
    "v": StateRange(-0.15, 0.15, 10),
    "r": StateRange(-0.4, 0.4, 10),
    "u_dot": StateRange(-0.02, 0.1, 5),
    "v_dot": StateRange(-0.02, 0.02, 5),
    "r_dot": StateRange(-0.1, 0.1, 3),
    "tau_X": StateRange(-1.2, 1.2, 5),
    "tau_Y": StateRange(-3.8, 3.8, 5),
    "tau_N": StateRange(-2.0, 2.0, 5),
}

try:
    from sklearn.base import BaseEstimator, TransformerMixin
except ModuleNotFoundError:
    raise InputError("PLS needs scikit-learn: pip install 'cybership[analysis]'") from None


class QuadraticExtension(TransformerMixin, BaseEstimator):
    """States and their products |a| b.

    Of two states of the extension, a before b, there is |a| b; of (v, r) also |r| v, as in (7.14).

    Args:
        names: of the columns that are given.
        extended: those whose products are added.
        left_out: products that are not, as ``|v|r``.
    """

    def __init__(
        self, names: Sequence[str], extended: Sequence[str] = (), left_out: Sequence[str] = ()
    ) -> None:
        self.names = names
        self.extended = extended
        self.left_out = left_out

    @property
    def products(self) -> list[tuple[str, str]]:
        """(a, b) of each product |a| b."""
        pairs = list(combinations_with_replacement(self.extended, 2))
        if "v" in self.extended and "r" in self.extended:
            pairs.append(("r", "v"))
        return [(a, b) for a, b in pairs if f"|{a}|{b}" not in self.left_out]

    def fit(self, X: np.ndarray, y: Any = None) -> "QuadraticExtension":
        """Nothing to fit but the number of columns."""
        self.n_features_in_ = X.shape[1]
        return self

    def transform(self, X: np.ndarray) -> np.ndarray:
        """The columns, then the products."""
        column = dict(zip(self.names, np.asarray(X, float).T, strict=True))
        added = [np.abs(column[a]) * column[b] for a, b in self.products]
        return np.column_stack([*column.values(), *added])

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Names of the columns that come out."""
        return np.array([*self.names, *(f"|{a}|{b}" for a, b in self.products)], dtype=object)


class _Ranged(TransformerMixin, BaseEstimator):
    """States over their ranges; outside they are clipped.

    Args:
        names: of the columns, which are states of the ranges.
        ranges: state -> range and resolution.
    """

    def __init__(self, names: Sequence[str], ranges: Mapping[str, StateRange] = TABLE_1) -> None:
        self.names = names
        self.ranges = ranges

    def fit(self, X: np.ndarray, y: Any = None) -> "_Ranged":
        """The share of values (m,) outside of each range: ``clipped_``."""
        self.n_features_in_ = X.shape[1]
        limits = [self.ranges[n] for n in self.names]
        self.clipped_ = np.array(
            [float(np.mean((x < s.low) | (x > s.high))) for x, s in zip(X.T, limits, strict=True)]
        )
        return self

    def transform(self, X: np.ndarray) -> np.ndarray:
        """The columns of all states side by side."""
        return np.hstack(
            [
                self.basis(x, self.ranges[n])
                for n, x in zip(self.names, np.asarray(X, float).T, strict=True)
            ]
        )

    def get_feature_names_out(self, input_features: Any = None) -> np.ndarray:
        """Each state's name with the middle of its bin, or the node of its triangle."""
        found = [f"{n}={c:.4g}" for n in self.names for c in self.centres(self.ranges[n])]
        return np.array(found, dtype=object)

    @staticmethod
    def centres(s: StateRange) -> np.ndarray:
        """Middles of the bins, or nodes of the triangles."""
        raise NotImplementedError

    @staticmethod
    def basis(x: np.ndarray, s: StateRange) -> np.ndarray:
        """Values of one state (n,) as columns (n, k)."""
        raise NotImplementedError


class NominalBins(_Ranged):
    """One column for each of ``resolution`` bins, 1 where the state lies in it, (3.18), corrected."""

    @staticmethod
    def centres(s: StateRange) -> np.ndarray:
        edges = np.linspace(s.low, s.high, s.resolution + 1)
        return 0.5 * (edges[1:] + edges[:-1])

    @staticmethod
    def basis(x: np.ndarray, s: StateRange) -> np.ndarray:
        place = np.floor((x - s.low) / (s.high - s.low) * s.resolution)
        number = np.clip(place, 0, s.resolution - 1).astype(int)
        return np.eye(s.resolution)[number]


class ContinuousNominal(_Ranged):
    """Triangles max(1 - |x - c| / h, 0) on ``resolution`` + 1 nodes, h apart, (3.19)-(3.20)."""

    @staticmethod
    def centres(s: StateRange) -> np.ndarray:
        return np.linspace(s.low, s.high, s.resolution + 1)

    @staticmethod
    def basis(x: np.ndarray, s: StateRange) -> np.ndarray:
        h = (s.high - s.low) / s.resolution
        inside = np.clip(x, s.low, s.high)[:, None]
        nodes = ContinuousNominal.centres(s)
        return np.maximum(1.0 - np.abs(inside - nodes) / h, 0.0)
