"""What an identification finds, whatever its method."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..model import Model
from ..model.ship_model import parameter_and_run
from .confidence import Evidence


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
        z: by how many prior standard deviations.
        value: what it is in the learned model, SI.
    """

    name: str
    z: float
    value: float


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that was found.

    Attributes:
        id: of the effect.
        values: its parameters as additions to the nominal ones; named ``parameter@run`` if of one run.
        ci95: interval of each that is fitted, at the final step.
        confidence: probability that it is a true cause; NaN where a method has none.
        alike: ids that these data cannot tell from it, itself not among them.
        q2: cross-validated share of the model error that is explained, with all found before.
        share: how much of the cross-validated model error went with this finding.
        model: with this and all earlier findings.
        evidence: what the confidence is made of; None where a method has none.
    """

    id: str
    values: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    confidence: float
    alike: Sequence[str]
    q2: float
    share: float
    model: Model = field(default_factory=Model)
    evidence: Evidence | None = None

    @property
    def of_runs(self) -> list[str]:
        """The runs in which alone it holds, such as times of failures; none: it holds in all."""
        runs = (parameter_and_run(name)[1] for name in self.values)
        return [*dict.fromkeys(run for run in runs if run)]


@dataclass(frozen=True, eq=False)
class Findings:
    """What a method found.

    Attributes:
        effects: in the order of acceptance.
        ranking: of the first step.
        model: with all effects; where there are none, the model that it started from.
        suspects: nominal coefficients that are wrong, with values as in ``model``, or, where there is no
            effect, as in ``refitted``.
        sigma: (3,), noise of each axis [N, N, N m].
        refitted: the most likely model without an effect, but other nominal coefficients; None where a
            method does not fit them.
        moved: nominal coefficient -> by how many prior standard deviations the fit moved it.
        left_out: (blocks,), loss of each block by a fit that has not seen its run, or, of one run, the
            block; None where a method has none.
        left_out_at_first: the same of the model that it started from.
        keep: the findings with some of the effects only, everything else fitted anew; None where a
            method cannot.
    """

    effects: Sequence[Finding] = field(default_factory=list)
    ranking: Sequence[Ranked] = field(default_factory=list)
    model: Model = field(default_factory=Model)
    suspects: Sequence[Suspect] = field(default_factory=list)
    sigma: np.ndarray = field(default_factory=lambda: np.ones(3))
    refitted: Model | None = None
    moved: Mapping[str, float] = field(default_factory=dict)
    left_out: np.ndarray | None = None
    left_out_at_first: np.ndarray | None = None
    keep: "Callable[[Sequence[str]], Findings] | None" = None
