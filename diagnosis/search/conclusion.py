"""The end of a search: what was found, with intervals, shares and evidence, all fitted together."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..predictors import Model
from ..predictors.uncertainty import omega_std
from ..predictors.weak_form import OVERLAP
from ..runs.cleaning import Z95
from .candidates import model_error
from .effect_evidence import EffectEvidence, credible, evidence
from .findings import Finding, Findings, Ranked, Suspect
from .gram import WHOLE_RUNS, Nuisance, block_folds, gram_table
from .map_regression import regression
from .most_likely import beyond, ridge
from .prior import NominalPrior
from .refinement import RefinedModel, TrainingSet, bounded, nuisance_of, refit, weighted_rows
from .rivals import (
    HELD,
    LinearProblem,
    held_forces,
    may_be_modulated,
    modulated_forces,
    probability_beside,
)
from .shortlist import scored_alone


@dataclass(frozen=True)
class AcceptedEffect:
    """An effect that was found, as long as its values still change.

    Attributes:
        id: of the effect.
        names: of its parameters.
        intervals: 95 % interval of each change point [s] and of each parameter that it is not smooth in.
        weights: id -> probability of the effect and of its rivals, of the candidates together 1.
        nearest: see :class:`.effect_evidence.EffectEvidence`.
        instead_of: ids that had its place before others were found.
        beside: ids of these, when it took the place.
    """

    id: str
    names: Sequence[str]
    intervals: Mapping[str, tuple[float, float]]
    weights: Mapping[str, float]
    nearest: float
    instead_of: Sequence[str] = ()
    beside: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Selection:
    """What the selection of effects came to.

    Attributes:
        t: what it was fitted to.
        at: the most likely model.
        accepted: the effects found, in the order of acceptance.
        ranked: candidates of the first step.
        lacking: (K, 3), the first model error.
        stated: prior of the nominal coefficients as the ship's description states it.
    """

    t: TrainingSet
    at: RefinedModel
    accepted: Sequence[AcceptedEffect]
    ranked: Sequence[Ranked]
    lacking: np.ndarray
    stated: NominalPrior

    @property
    def model(self) -> Model:
        """The most likely model."""
        return self.at.model(self.t.prior)

    @cached_property
    def _nuisance(self) -> Nuisance:
        return nuisance_of(self.t, self.at, self.t.error(self.at))

    def findings(self, ids: Sequence[str] | None = None) -> Findings:
        """What was found, or the findings with some of the effects only, the rest fitted anew."""
        kept = [p for p in self.accepted if ids is None or p.id in ids]
        if len(kept) < len(self.accepted):
            gone = {n for p in self.accepted if p not in kept for n in p.names}
            at = self.at.without(gone)
            at = refit(self.t, at, self._of(at)).estimate
            return replace(self, at=at, accepted=kept).findings()
        names, std = self.at.fitted, laplace_std(self.t, self._nuisance)
        nested, shares = self._nested()
        effects = []
        for k, p in enumerate(self.accepted):
            values = {n: self.at.values[n] for n in p.names}
            own = {n: interval(values[n], s) for n, s in zip(names, std, strict=False) if n in values}
            alike = credible(p.id, p.weights)
            own_share, set_share = self._beside_coefficients(p, 1, 1 + len(alike))
            of_set = p.weights[p.id] + sum(p.weights[i] for i in alike)
            listed, modulation = min(self._beside_modulations(p), self._beside_held_commands(p))
            seen = self._evidence(p, p.weights[p.id] * own_share)._replace(listed=listed)
            together = seen._replace(bagged=of_set * set_share)
            q2, ci95 = sum(shares[: k + 1]), own | dict(p.intervals)
            found = Finding(p.id, values, ci95, np.nan, alike, q2, shares[k], nested[k], seen)
            found = replace(found, set_evidence=together, modulation=modulation)
            effects.append(replace(found, instead_of=p.instead_of, beside=p.beside))
        prior, sigma = self.t.prior, np.asarray(self.t.sigma)
        model = self.model if effects else self.at.start
        folds, runs = self._fold_models()
        found = Findings(
            effects, self.ranked, model, [], sigma, None, {}, folds, self.findings, self.at, prior, runs
        )
        if not any(prior.std.values()):
            return found
        return replace(
            found,
            suspects=suspected(prior, self.at.offset, std[len(names) :], self.at.start),
            refitted=None if effects else self.at.without(self.at.values).model(prior),
            moved=dict(zip(prior.mean, self.at.offset.tolist(), strict=True)),
        )

    def _fold_models(self) -> tuple[list[Model], list[Model]]:
        """The model fitted without each fold of the data, by one step about the fit to all.

        Returns:
            By folds as they usually are, and by whole runs where there are two.
        """
        t, fitted = self.t, self.at.fitted
        table = gram_table(t.error(self.at), t.blocks, [], self._nuisance, np.asarray(t.sigma))
        all_of_it = regression(table, -1, 0)

        def without(held: np.ndarray) -> Model:
            change = -all_of_it.fitted(table.total - table.grams[held].sum(axis=0)).left[1:]
            step = dict(zip(fitted, change.tolist(), strict=False))
            return self.at.plus(step, change[len(fitted) :]).model(t.prior)

        usual = [without(held) for held in block_folds(t.data, WHOLE_RUNS)]
        if len(t.data) != WHOLE_RUNS - 1:
            return usual, usual
        return usual, [without(held) for held in block_folds(t.data, WHOLE_RUNS - 1)]

    def _of(self, at: RefinedModel) -> Nuisance:
        """Nuisance parameters of a part of the effects, by slopes beside all of them."""
        names = [*self.at.fitted, *self.t.prior.mean]
        kept = [k for k, n in enumerate(names) if n in at.fitted or k >= len(self.at.fitted)]
        a = self._nuisance
        return Nuisance(a.columns[..., kept], a.precision[kept][:, kept], a.offset[kept], a.unit[kept])

    def _nested(self) -> tuple[list[Model], list[float]]:
        """The models with each effect and those before it, and its share of the first model error.

        That is the fall of the cross-validated sum of squares, from the first model.
        """
        t, models, shares = self.t, [], []
        total = before = float(np.sum((self.lacking * t.weight) ** 2))
        for k in range(len(self.accepted)):
            at, nuisance = self.at, self._nuisance
            later = {n for p in self.accepted[k + 1 :] for n in p.names}
            if later:
                at = at.without(later)
                nuisance = self._of(at)
                at = refit(t, at, nuisance).estimate
                nuisance = replace(nuisance, offset=at.theta(at.fitted))
            left = float(scored_alone(t, at, nuisance).blocks.sum())
            models.append(at.model(t.prior))
            shares.append((before - left) / total)
            before = left
        return models, shares

    def _evidence(self, p: AcceptedEffect, bagged: float) -> EffectEvidence:
        data, model = self.t.data, self.model
        left = model_error(data, model)
        without = model_error(data, self.at.without(p.names).model(self.t.prior))
        std = np.concatenate([omega_std(w, model) for w in data])
        return evidence(bagged, p.nearest, without - left, left, std, self.t.blocks)

    def _beside_modulations(self, p: AcceptedEffect) -> tuple[float, str]:
        """Probability of an effect beside modulated forces in its place, and the likeliest of these."""
        rest = self.at.without(p.names).model(self.t.prior)
        if not may_be_modulated(rest.ship.effects[p.id]):
            return 1.0, ""
        forces = dict(modulated_forces(self.t.data, rest))
        if not forces:
            return 1.0, ""
        columns = weighted_rows(np.stack([*forces.values()], axis=2), self.t.weight)
        columns = columns / np.sqrt(np.mean(columns**2, axis=0))
        problem, charged = self._linear(p.names)
        rivals = problem.beside(columns)
        found = [[r.log_evidence(wider, charged + 1) for r in rivals] for wider in self._widths]
        likeliest = [*forces][int(np.argmax(np.max(found, axis=0)))]
        listed = probability_beside(self._with_all, {0: np.ravel(found).tolist()})
        return listed, likeliest

    def _beside_held_commands(self, p: AcceptedEffect) -> tuple[float, str]:
        """Probability of an outage beside held commands in its intervals, and what these are called."""
        t, outage = self.t, self.model.ship.effects[p.id]
        forces = held_forces(t.data, self.model, outage) if outage.search.intervals else []
        if not forces:
            return 1.0, ""
        problem, charged = self._linear(())
        rival = problem.also_uncertain(weighted_rows(np.stack(forces, axis=2), t.weight))
        ones = np.ones(len(forces))
        found = [rival.log_evidence(np.append(wider, ones), charged) for wider in self._widths]
        return probability_beside(self._with_all, {0: found}), HELD

    def _beside_coefficients(self, p: AcceptedEffect, *ids: int) -> list[float]:
        """Probability of sets of so many ids, with an effect, beside coefficients as stated."""
        absent = {1: [self._rival(p.names)]}
        if len(self.accepted) > 1:
            absent[len(self.accepted)] = [self._without_any]
        present, candidates = self._with_all, len(self.ranked)
        return [probability_beside(present, absent, n / max(candidates, n)) for n in ids]

    @cached_property
    def _with_all(self) -> list[float]:
        """Log evidences with all effects, coefficients known to a tenth and as stated."""
        problem, charged = self._linear(())
        return [problem.log_evidence(wider, charged) for wider in self._widths]

    @property
    def _widths(self) -> tuple[np.ndarray, np.ndarray]:
        """(q,), standard deviations of coefficients known to a tenth and as stated, over the former."""
        return np.ones(self._wider.size), self._wider

    @cached_property
    def _without_any(self) -> float:
        """Log evidence without any effect, coefficients as stated."""
        return self._rival([n for p in self.accepted for n in p.names])

    def _rival(self, gone: Collection[str]) -> float:
        """Log evidence without some parameters, coefficients as stated."""
        problem, charged = self._linear(gone)
        return problem.log_evidence(self._wider, charged)

    @cached_property
    def _wider(self) -> np.ndarray:
        """(q,), stated standard deviation of each coefficient over that of the search; 1: it is 0."""
        pairs = [(self.stated.std[n], std) for n, std in self.t.prior.std.items()]
        return np.array([stated / std if std and stated else 1.0 for stated, std in pairs])

    @cached_property
    def _rows(self) -> np.ndarray:
        """Columns of all fitted values and coefficients as weighted rows, see :func:`.weighted_rows`."""
        return weighted_rows(self._nuisance.columns, self.t.weight)

    def _linear(self, gone: Collection[str]) -> tuple[LinearProblem, int]:
        """The model error without some parameters, and the number of those that are left."""
        t, at = self.t, self.at.without(gone)
        kept = [k for k, n in enumerate(self.at.fitted) if n not in gone]
        first = len(self.at.fitted)
        y = (t.error(at) * t.weight).ravel()
        n = np.log(y.size / OVERLAP)
        problem = LinearProblem(y, self._rows[:, kept], self._rows[:, first:], at.offset, float(n))
        return problem, len(at.values)


def laplace_std(t: TrainingSet, nuisance: Nuisance) -> np.ndarray:
    """(q,), posterior standard deviation of everything fitted, by Laplace's approximation."""
    A = weighted_rows(nuisance.columns, t.weight)
    H = A.T @ A + nuisance.precision
    H += ridge(H, nuisance.unit)
    return np.sqrt(np.diag(np.linalg.inv(H)))


def interval(value: float, std: float) -> tuple[float, float]:
    """95 % interval."""
    return value - Z95 * std, value + Z95 * std


def suspected(prior: NominalPrior, offset: np.ndarray, std: np.ndarray, start: Model) -> list[Suspect]:
    """Nominal coefficients whose posterior excludes what is believed of them, the furthest first.

    Args:
        prior: of all nominal coefficients.
        offset, std: (q,), mean and standard deviation of the posterior, in prior standard deviations.
        start: the initial model, whose parameters have ranges.
    """
    found = [
        Suspect(name, float(k), prior.mean[name] + bounded(start, name, believed * float(k)))
        for (name, believed), k, s in zip(prior.std.items(), offset, std, strict=True)
        if abs(k) > beyond(offset.size) * s
    ]
    return sorted(found, key=lambda s: -abs(s.z))
