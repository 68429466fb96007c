"""What an identification finds, whatever its method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..model import Model


@dataclass(frozen=True, eq=False)
class Ranked:
    """A candidate in the order of its score: cross-validated loss, lower is better, and Q^2."""

    id: str
    score: float
    q2: float


@dataclass(frozen=True, eq=False)
class Suspect:
    """A nominal coefficient that is wrong.

    Attributes:
        name: of the coefficient.
        z: by how many posterior standard deviations.
        value: what it seems to be, SI.
    """

    name: str
    z: float
    value: float


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that was found.

    Attributes:
        id: of the effect.
        values: its parameters as additions to the nominal ones.
        ci95: interval of each that is fitted, at the final step.
        confidence: share of bootstrap replicates in which it came first; NaN where a method has none.
        alike: ids that these data cannot tell from it, itself not among them.
        q2: cross-validated share of the model error that is explained, with all found before.
        share: how much of the cross-validated model error went with this finding.
        model: with this and all earlier findings, as it was then.
    """

    id: str
    values: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    confidence: float
    alike: Sequence[str]
    q2: float
    share: float
    model: Model = field(default_factory=Model)


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Attributes:
        effects: in the order of acceptance.
        ranking: of the first step.
        model: with all effects.
        suspects: nominal coefficients that are wrong.
        sigma: (3,), noise of each axis [N, N, N m].
    """

    effects: Sequence[Finding] = field(default_factory=list)
    ranking: Sequence[Ranked] = field(default_factory=list)
    model: Model = field(default_factory=Model)
    suspects: Sequence[Suspect] = field(default_factory=list)
    sigma: np.ndarray = field(default_factory=lambda: np.ones(3))
