"""What an identification finds, whatever its method."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ..execution.short_text import ShortRepr
from ..predictors import Model
from ..predictors.prediction import FAR_OFF
from ..predictors.ship_model import parameter_and_run
from .effect_evidence import EffectEvidence
from .prior import NominalPrior

if TYPE_CHECKING:
    from .refinement import RefinedModel


# 1, effects, disturbances or forces, the clearest: with more, no one acts on the last; chosen
MOST_REPORTED = 6


@dataclass(frozen=True, eq=False)
class Ranked:
    """A candidate in the order of its score.

    Attributes:
        id: of the effect.
        score: cross-validated loss; lower is better.
        q2: cross-validated share of the model error that it explains with the nominal coefficients.
        beyond: share of what those coefficients leave, alone, that it explains; NaN: not known.
        behind, behind_std: its score less that of the first, and the standard error of that difference,
            paired over blocks; NaN: not known.
    """

    id: str
    score: float
    q2: float
    beyond: float = np.nan
    behind: float = np.nan
    behind_std: float = np.nan


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


@dataclass(frozen=True, eq=False, repr=False)
class Finding(ShortRepr):
    """One effect that was found.

    Attributes:
        id: of the effect.
        values: its parameters as additions to the nominal ones; named ``parameter@run`` if of one run.
        ci95: interval of each that is fitted, at the final step.
        confidence: probability that it is a true cause: what its method says, NaN where that says none;
            of a finding with evidence it is set by the verdict.
        alike: indistinguishable effects, the other ids of the smallest set with 95 % of the probability,
            by the weights that its confidence comes from; the most likely first.
        q2: cross-validated share of the model error that is explained, with all found before.
        share: cross-validated share of the model error that this finding explains.
        model: with this and all earlier findings.
        evidence: what the confidence is made of; None where a method has none.
        together: probability that it or one of ``alike`` is a true cause; else as ``confidence``.
        doubt: what speaks against it in addition to the evidence, as a part of a sentence.
        set_evidence: what ``together`` is made of; None where a method has none.
        instead_of: ids that had its place until other findings were there.
        beside: ids of these findings, of which some may be rejected later.
        modulation: the likeliest force in proportion to a channel in its place, see :mod:`.rivals`;
            empty: there is none.
    """

    id: str
    values: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    confidence: float
    alike: Sequence[str]
    q2: float
    share: float
    model: Model = field(default_factory=Model)
    evidence: EffectEvidence | None = None
    together: float = np.nan
    doubt: str = ""
    set_evidence: EffectEvidence | None = None
    instead_of: Sequence[str] = ()
    beside: Sequence[str] = ()
    modulation: str = ""

    @property
    def of_runs(self) -> list[str]:
        """The runs in which alone it holds, such as times of failures; none: it holds in all."""
        runs = (parameter_and_run(name)[1] for name in self.values)
        return [*dict.fromkeys(run for run in runs if run)]


@dataclass(frozen=True, eq=False, repr=False)
class Findings(ShortRepr):
    """The result of a method.

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
        fold_models: the model fitted without each fold of the training runs, see
            :func:`.gram.block_folds`; empty where a method has none.
        refit: the findings with some of the effects only, everything else fitted anew; None where a
            method cannot.
        estimate: the most likely parameters, from which a fit to predictions begins; None where a method
            has no such.
        searched: the prior of the coefficients in which its offsets are.
        run_models: as ``fold_models``, but each of two runs is a fold.
    """

    effects: Sequence[Finding] = field(default_factory=list)
    ranking: Sequence[Ranked] = field(default_factory=list)
    model: Model = field(default_factory=Model)
    suspects: Sequence[Suspect] = field(default_factory=list)
    sigma: np.ndarray = field(default_factory=lambda: np.ones(3))
    refitted: Model | None = None
    moved: Mapping[str, float] = field(default_factory=dict)
    fold_models: Sequence[Model] = ()
    refit: "Callable[[Sequence[str]], Findings] | None" = None
    estimate: "RefinedModel | None" = None
    searched: NominalPrior | None = None
    run_models: Sequence[Model] = ()

    @property
    def plausible(self) -> bool:
        """Whether no nominal coefficient is FAR_OFF prior standard deviations or more off."""
        return all(abs(z) <= FAR_OFF for z in self.moved.values())

    def plausible_by(self, prior: NominalPrior) -> bool:
        """The same by another prior than that of the search, which is a tenth for all."""
        if self.searched is None or self.estimate is None:
            return self.plausible
        offset = prior.rescaled(self.estimate.offset, self.searched)
        return bool((np.abs(offset) <= FAR_OFF).all())
