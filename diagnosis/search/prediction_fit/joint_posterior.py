"""What is known of all fitted values together: mean and covariance, by the names of ``model.ssv``."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.sparse.csgraph import connected_components

from ...execution.short_text import ShortRepr
from ...predictors.ship_model import parameter_and_run
from ...runs import Fingerprint
from ..prior import NominalPrior
from .fit import Fitted

TOGETHER = 0.97  # 1, of a correlation, from which on two values are known only together; chosen


@dataclass(frozen=True, eq=False, repr=False)
class JointPosterior(ShortRepr):
    """A normal distribution of parameters of a model.

    Attributes:
        names: ``vessel.NAME``, ``thrusters.NAME`` or ``measurement.NAME``.
        units: of each.
        mean: (q,), total values, SI.
        covariance: (q, q).
    """

    names: Sequence[str]
    units: Sequence[str]
    mean: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(cls, fitted: Fitted, prior: NominalPrior) -> "JointPosterior":
        """The posterior of a fit to predictions."""
        model, names = fitted.estimate.model(prior), [*dict.fromkeys(fitted.names)]
        # A value that an effect and a nominal coefficient are of is their sum.
        parts = np.array([[float(n == of) for of in fitted.names] for n in names]).reshape(
            len(names), -1
        )
        return cls(
            [f"{model.owner(parameter_and_run(n)[0])}.{n}" for n in names],
            [model.declared(n).unit for n in names],
            np.array([model.value(n) for n in names]),
            parts @ fitted.covariance @ parts.T,
        )

    @classmethod
    def nothing(cls) -> "JointPosterior":
        """That of no value at all."""
        return cls([], [], np.zeros(0), np.zeros((0, 0)))

    @property
    def std(self) -> dict[str, float]:
        """Parameter, without its part of the ship -> standard deviation."""
        std = np.sqrt(np.diag(self.covariance)).tolist()
        return {n.partition(".")[2]: s for n, s in zip(self.names, std, strict=True)}

    def shares(self, prior: NominalPrior) -> np.ndarray:
        """(q,), standard deviations of the nominal coefficients over those of their prior."""
        std = self.std
        return np.array([std.get(n, 0.0) / s if s else 0.0 for n, s in prior.std.items()])

    @property
    def correlation(self) -> np.ndarray:
        """(q, q), see :func:`correlation`."""
        return correlation(self.covariance)

    @property
    def together(self) -> list[list[str]]:
        """Groups of values that are known only together, see :func:`together`."""
        return together(self.names, self.covariance)

    def write(
        self,
        path: Path,
        learned_from: Sequence[Fingerprint] = (),
        task: Mapping[str, object] | None = None,
    ) -> None:
        """Write ``posterior.json``, with the runs of which the values were learned.

        Args:
            path: of the file.
            learned_from: these runs.
            task: files and options by which they are read again; None: not known.
        """
        content = {
            "names": list(self.names),
            "units": list(self.units),
            "mean": self.mean.tolist(),
            "covariance": self.covariance.tolist(),
            "learned_from": [f.content() for f in learned_from],
        } | ({} if task is None else {"task": task})
        path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def correlation(covariance: np.ndarray) -> np.ndarray:
    """(q, q), 1 on the diagonal; 0 beside a value that is known exactly."""
    std = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, std, out=np.zeros_like(std), where=std > 0.0)
    found = covariance * scale * scale[:, None]
    np.fill_diagonal(found, 1.0)
    return found


def together(names: Sequence[str], covariance: np.ndarray) -> list[list[str]]:
    """Groups of values that are known only together: chains of correlations above TOGETHER.

    Args:
        names: of the values.
        covariance: (q, q), of these.
    """
    return connected(names, np.abs(correlation(covariance)) > TOGETHER)


def connected(names: Sequence[str], edges: np.ndarray) -> list[list[str]]:
    """Groups of several names that edges (n, n) connect, also by others."""
    count, group = connected_components(edges, directed=False)
    groups = [[n for n, g in zip(names, group, strict=True) if g == k] for k in range(count)]
    return [members for members in groups if len(members) > 1]
