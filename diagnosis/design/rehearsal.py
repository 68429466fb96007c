"""What ``learn`` would report after a planned run, by its own scores on simulated outcomes.

An outcome has the measured error of the old runs, and a drawn one of the planned run: a hypothesis by
its weight, parameters from their posterior, and noise that lasts as in the old runs. It is judged as
``learn`` judges: next to the nearest of all effects of the ship, with a charge for each parameter, a
bootstrap over blocks, what is left and what varies, and the caps of the confidence.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..assessment.covariates import AXES
from ..assessment.residual.remainder import remaining
from ..predictors import WeakWindows
from ..predictors.uncertainty import omega_std
from ..predictors.weak_form import OVERLAP
from ..runs.cleaning import Z95
from ..runs.run_constants import LEVEL
from ..search.candidates import Candidate, CandidateShape, candidates, model_error
from ..search.effect_evidence import EffectEvidence, evidence, nearest_share
from ..search.findings import Finding
from ..search.gram import GramTable, Nuisance, block_numbers, gram_table
from ..search.map_regression import first_share, regression, score
from ..search.most_likely import ridge
from ..search.shortlist import LENGTH
from ..verdict.confidence import Doubts, confidence_of, doubt_of_data, probability
from .hypotheses import Space, block_of
from .information import Hypothesis, Knowledge
from .spread import MEMBERS

CAPPED = "The confidence of any finding of these runs stays at most 50 %: {}."
LEFT = "{} leaves a significant residual in {} in the runs so far, which limits its confidence."
UNLISTED = "A listed candidate is the cause with a probability of {:.0%}, by the diagnosis so far."


# 1, noise on each axis of overlapping windows where that of one that counts is 1
NOISE = np.repeat(1.0 / np.sqrt(OVERLAP), len(AXES))


class RowsOfRuns(NamedTuple):
    """Windows of runs, forces in units of the noise that counts for one window.

    Attributes:
        y: (K, 3), error of the initial model.
        X: (K, 3, p), columns of all parameters of a space.
        std: (K, 3), noise of the measurement.
        blocks: (K, 2), run and block of each window.
    """

    y: np.ndarray
    X: np.ndarray
    std: np.ndarray
    blocks: np.ndarray


@dataclass(frozen=True, eq=False)
class Rehearsal:
    """What is known before a run, and all effects that ``learn`` will compare.

    Attributes:
        data: measured runs.
        space: the parameters of the hypotheses.
        k: the hypotheses.
    """

    data: Sequence[WeakWindows]
    space: Space
    k: Knowledge

    @cached_property
    def wide(self) -> Space:
        """The parameters of the hypotheses, then those of all other effects of the ship."""
        start, known = self.space.start, dict(self.space.blocks)
        base = model_error(self.data, start)
        for c in candidates(self.data, start, base, known.keys()):
            if not c.effect.search.times:
                known[c.effect.id] = block_of(start, c.shapes, base, self.space.sigma)
        return replace(self.space, blocks=known)

    @cached_property
    def measured(self) -> RowsOfRuns:
        """The old runs."""
        return self.rows(self.data)

    def rows(self, data: Sequence[WeakWindows]) -> RowsOfRuns:
        """Runs in units of the noise."""
        start, sigma = self.space.start, self.space.sigma
        y, std = model_error(data, start), np.concatenate([omega_std(w, start) for w in data])
        return RowsOfRuns(y / sigma, self.wide.columns(data), std / sigma, block_numbers(data))

    @cached_property
    def residual(self) -> list[set[str]]:
        """Of each hypothesis the axes on which it leaves a significant residual in the old runs."""
        each = zip(self.k.hypotheses, self.k.estimates, strict=True)
        models = [self.space.model(h, e.mean) for h, e in each]
        left = [remaining(self.data, self.space.initial, model) for model in models]
        return [{name for name, axis in axes.items() if axis.significant} for axes in left]

    @cached_property
    def listed(self) -> float:
        """Probability that a candidate is the cause, by the diagnosis and what the likeliest leaves."""
        h, old = self.k.hypotheses[int(np.argmax(self.k.weights))], self.measured
        trials = [RehearsedEffect.of(self.wide, old, old.y, h, i) for i in h.ids]
        return min((probability(t.judged(old.y)[0]) for t in trials), default=1.0) * self.k.listed

    @property
    def doubts(self) -> list[str]:
        """What keeps the confidence below LEVEL after any run, a line each."""
        effects, text = self.space.start.ship.effects, doubt_of_data(self.data)
        found = [CAPPED.format(text)] if text else []
        for h, axes in zip(self.k.hypotheses, self.residual, strict=True):
            if any(axes & set(effects[i].axis) for i in h.ids):
                found.append(LEFT.format(h.name, ", ".join(sorted(axes))))
        return found if self.listed >= LEVEL else [*found, UNLISTED.format(self.listed)]

    def sure(self, planned: Sequence[WeakWindows], seed: int, draws: int = MEMBERS) -> float:
        """Probability that the true hypothesis has LEVEL or more after planned runs [1]."""
        return float(self.listed * np.mean(self.confidences(planned, seed, draws) >= LEVEL))

    def confidences(self, planned: Sequence[WeakWindows], seed: int, draws: int = MEMBERS) -> np.ndarray:
        """(draws,), least confidence in an effect of the true hypothesis after planned runs [1]."""
        old, new = self.measured, self.rows(planned)
        both = RowsOfRuns(*(np.concatenate(pair) for pair in zip(old, new, strict=True)))
        both.blocks[len(old.y) :, 0] += len(self.data)
        rng, doubt, start = np.random.default_rng(seed), doubt_of_data(self.data), self.space.start
        drawn = rng.choice(len(self.k.weights), draws, p=self.k.weights)
        found = []
        for n in np.unique(drawn):
            h, e = self.k.hypotheses[n], self.k.estimates[n]
            X, mean = new.X[..., h.columns], e.mean[h.columns]
            like = np.concatenate([old.y, X @ mean])
            trials = [RehearsedEffect.of(self.wide, both, like, h, i) for i in h.ids]
            count = int(np.sum(drawn == n))
            for z in rng.multivariate_normal(mean, e.covariance, count, method="eigh"):
                y = np.concatenate([old.y, X @ z + self._noise(len(X), rng)])
                findings = [t.finding(y, rng) for t in trials]
                own = [confidence_of(f, start, Doubts(self.residual[n], doubt)).own for f in findings]
                found.append(min(own, default=0.0))
        return np.array(found)

    def _noise(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """(count, 3), noise of which as many windows as in the old runs count as one."""
        found = np.empty((count, 3))
        for axis, n in enumerate(np.round(self.space.lasting).astype(int)):
            white = rng.standard_normal(count + n - 1)
            found[:, axis] = np.convolve(white, np.full(n, 1.0 / n), "valid")
        return found


@dataclass(frozen=True, eq=False)
class RehearsedEffect:
    """An effect of a hypothesis next to its nearest rivals.

    Attributes:
        rivals: the effect first.
        nuisance: parameters that are fitted along, those of the hypothesis' other effects among them.
        known: (K, 3), force that these effects give at their point.
        rows: windows.
        steps: unit of each parameter of the effect, SI.
    """

    rivals: Sequence[Candidate]
    nuisance: Nuisance
    known: np.ndarray
    rows: RowsOfRuns
    steps: Sequence[float]

    @classmethod
    def of(
        cls, s: Space, rows: RowsOfRuns, like: np.ndarray, h: Hypothesis, effect: str
    ) -> "RehearsedEffect":
        """Choose the rivals of one effect of a hypothesis by a model error (K, 3) that is expected."""
        q, places = len(s.nuisance), s.places()
        others = [i for i in h.ids if i != effect]
        shapes = {i: _shape(s, i, rows.X[..., places[i]]) for i in s.blocks}
        columns = [rows.X[..., :q], *(shapes[i].columns for i in others)]
        unit = np.concatenate([np.ones(q), *(shapes[i].unit for i in others)])
        precision = np.diag((np.arange(unit.size) < q).astype(float))
        offset = np.concatenate([s.offset, np.zeros(unit.size - q)])
        nuisance = Nuisance(np.concatenate(columns, axis=2), precision, offset, unit)
        known = sum((rows.X[..., places[i][0]] for i in others), np.zeros_like(like))
        effects = s.start.ship.effects
        every = [Candidate(effects[i], [shapes[i]]) for i in (effect, *(shapes.keys() - h.ids))]
        table = gram_table(like - known, rows.blocks, every, nuisance, NOISE)
        order = sorted(range(1, len(every)), key=lambda c: (_charged(table, c), every[c].effect.id))
        chosen = [every[c] for c in (0, *order[: LENGTH - 1])]
        return cls(chosen, nuisance, known, rows, s.blocks[effect].steps)

    def finding(self, y: np.ndarray, rng: np.random.Generator) -> Finding:
        """The effect as it is found for a model error (K, 3), with its evidence."""
        table = gram_table(y - self.known, self.rows.blocks, self.rivals, self.nuisance, NOISE)
        each = [score(table, c, 1) for c in (*range(len(self.rivals)), -1)]  # -1: none of them
        share = float(first_share(each, rng)[0])
        seen, values, std = self.judged(y)
        ci95 = {n: (x - Z95 * std[n], x + Z95 * std[n]) for n, x in values.items() if n in std}
        own, *others, nothing = (float(s.blocks.sum()) for s in each)
        seen = seen._replace(bagged=share, nearest=nearest_share(own, others, nothing))
        name = self.rivals[0].effect.id
        return Finding(name, values, ci95, share, [], 0.0, 0.0, evidence=seen, set_evidence=seen)

    def judged(self, y: np.ndarray) -> tuple[EffectEvidence, dict[str, float], dict[str, float]]:
        """Evidence of the effect without rivals, its values, and their standard deviations, SI."""
        y, s, nuisance = y - self.known, self.rivals[0].shapes[0], self.nuisance
        table = gram_table(y, self.rows.blocks, self.rivals[:1], nuisance, NOISE)
        given = [] if s.offset is None else [s.offset[..., None]]
        A = np.concatenate([y[..., None], *given, s.columns, nuisance.columns], axis=2)
        r = regression(table, 0, 0)
        fit, own = r.fitted(table.total), r.use[: r.free]
        force = A[..., own] @ fit.beta + (0.0 if s.offset is None else s.offset)
        seen = evidence(1.0, 1.0, force, A[..., fit.used] @ fit.left, self.rows.std, self.rows.blocks)
        H = table.total[np.ix_(r.use, r.use)] + r.precision
        std = np.sqrt(np.diag(np.linalg.inv(H + ridge(H, table.unit[r.use]))))
        values, deviations = dict(s.given), {}
        for place, x, deviation in zip(own, fit.beta, std, strict=False):
            n = int(place) - 1 - len(given)
            name, step = s.fitted[n], self.steps[n]
            values[name] = values.get(name, 0.0) + float(x) * step
            deviations[name] = float(deviation) * step
        return seen, values, deviations


def _charged(t: GramTable, c: int) -> float:
    """Loss of a candidate fitted to all data, with what it is charged."""
    r = regression(t, c, 0)
    fit = r.fitted(t.total)
    return float(fit.loss(t.total) + fit.penalty + r.size(t.total) * t.per_parameter)


def _shape(s: Space, effect: str, columns: np.ndarray) -> CandidateShape:
    """An effect by its columns (K, 3, 1 + p) of a space."""
    b = s.blocks[effect]
    unit = np.array([s.start.unit(n) for n in b.names]) / np.array(b.steps)
    offset = columns[..., 0] if b.given else None
    return CandidateShape(b.given, b.names, offset, columns[..., 1:], unit, precision=b.precision)
