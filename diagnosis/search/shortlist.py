"""One step of the forward selection: all effects of the ship as candidates, the best of them refined.

All candidates are scored by a regression that is linear in their parameters; the best of them are then
refined and scored again, with the axes weighted by what even the best leaves over.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from fmus.ship import Ship

from ..execution.parallel import for_each
from ..predictors.uncertainty import FLOOR, independent
from ..predictors.weak_form import ROOM
from ..runs.run_constants import STEPS
from .candidates import (
    SLIGHT,
    Candidate,
    candidates,
    lasts,
    model_error,
)
from .gram import GramTable, Nuisance, gram_table, noise
from .map_regression import Scored, fitted_columns, score
from .most_likely import ridge
from .refinement import (
    CandidateStart,
    Refined,
    RefinedModel,
    TrainingSet,
    as_shape,
    has_values_of_runs,
    nuisance_of,
    refine,
    timed,
)

LENGTH = 8  # 1, of the shortlist: candidates and hypotheses that have a fit of their own; chosen
CHANGED = 1.5  # 1, ratio of an axis' weight from which on candidates are refined anew
# 1, least fall of the score that a candidate must be able to have beside those found. The score is
# twice a log likelihood ratio, and so the signal to noise, a sum of squares. Chance does not give this
# fall among some fifty candidates (2 log 50 = 7.8).
NEW = 10.0
TIE = 2.0  # 1, paired standard errors within which two candidates are indistinguishable; contract

# By the effects of the measurement in the model, the candidates by id.
MadeCandidates = dict[frozenset[str], dict[str, Candidate]]


@dataclass(frozen=True, eq=False)
class Ranking:
    """All candidates beside a model, linear in their parameters.

    Attributes:
        base: (K, 3), the model's error.
        nuisance: parameters that are fitted along.
        table: all candidates.
        candidates: in the table's order.
        order: the candidates scored, best first.
    """

    base: np.ndarray
    nuisance: Nuisance
    table: GramTable
    candidates: Sequence[Candidate]
    order: Sequence[Scored]

    @property
    def size(self) -> float:
        """Sum of squares of the model error, in units of the noise."""
        return float(self.table.total[0, 0])


def rank(
    t: TrainingSet,
    at: RefinedModel,
    known: Set[str],
    made: MadeCandidates | None = None,
    nuisance: Nuisance | None = None,
    of_each_run: bool = False,
) -> Ranking:
    """Score every effect that is not known yet.

    Args:
        t: what is fitted to.
        at: the model so far.
        known: ids of the effects in it.
        made: candidates of earlier rankings, which serve where the measurement is the same; receives
            those of this one. None: there are none.
        nuisance: what is fitted along, by slopes nearby; None: not known.
        of_each_run: whether values may be others in each run.
    """
    model = at.model(t.prior)
    base = model_error(t.data, model)
    measured = frozenset(i for i in known if model.ship.effects[i].kind == "measurement")
    made = {} if made is None else made
    earlier = made.get(measured, {})
    found = candidates(t.data, model, base, known, earlier)
    if sum(s.columns.nbytes for c in found for s in c.shapes) > ROOM * len(t.data):
        made.clear()  # of a long run there is no room for two
    made[measured] = earlier | {c.effect.id: c for c in found if lasts(c.effect, model)}
    nuisance = nuisance_of(t, at, base) if nuisance is None else nuisance
    linear = [s.columns for c in found for s in c.shapes[:1]]
    floor = FLOOR * model.ship.scale.forces
    sigma = noise(base, np.concatenate([*linear, nuisance.columns], axis=2), floor)
    found = found if of_each_run else of_one_value(found, model.ship)
    return weighted(t, sigma, base, nuisance, found)


def of_one_value(found: Sequence[Candidate], ship: Ship) -> list[Candidate]:
    """Candidates without their shapes that have values of each run."""
    return [
        replace(c, shapes=[s for s in c.shapes if not has_values_of_runs(ship, s.fitted)]) for c in found
    ]


def weighted(
    t: TrainingSet, sigma: np.ndarray, base: np.ndarray, nuisance: Nuisance, found: Sequence[Candidate]
) -> Ranking:
    """Score candidates with an error counted in units of sigma (3,) [N, N, N m]."""
    table = gram_table(base, t.blocks, found, nuisance, sigma)
    free = len(nuisance.offset) - t.prior.size
    size = float(table.total[0, 0])
    new = [k for k in range(len(found)) if novelty(table, k, free) * size >= NEW]
    order = in_order([score(table, k, len(found[k].shapes)) for k in new])
    return Ranking(base, nuisance, table, found, order)


def scored_alone(t: TrainingSet, at: RefinedModel, nuisance: Nuisance | None = None) -> Scored:
    """The score of a model without any candidate, by fits to a part of the data, linear about it."""
    base = t.error(at)
    nuisance = nuisance_of(t, at, base) if nuisance is None else nuisance
    return score(gram_table(base, t.blocks, [], nuisance, np.asarray(t.sigma)), -1, 1)


def novelty(t: GramTable, candidate: int, free: int) -> float:
    """Share of a linear candidate's force that what was found cannot give, set freely; else 1.

    Times the sum of squares of the model error, in units of the noise, it is the signal that a
    candidate as large as that error has of its own. The first ``free`` nuisance parameters are those of
    effects that were found.
    """
    entry = t.entries[candidate][0]
    mine = entry.columns
    if free == 0 or entry.given >= 0 or not mine:
        return 1.0
    found = t.nuisance[:free]
    own, gram, across = t.total[mine][:, mine], t.total[found][:, found], t.total[found][:, mine]
    gram = gram + ridge(gram, t.unit[found])
    left = np.diag(own - across.T @ np.linalg.solve(gram, across))
    return float(np.max(left / np.maximum(np.diag(own), SLIGHT * t.unit[mine] ** -2.0)))


def in_order(scored: Sequence[Scored]) -> list[Scored]:
    """The best first; of two that are the same on any data the one that was declared first."""
    return sorted(scored, key=lambda s: (round(s.score, 2), s.candidate))


@dataclass(frozen=True, eq=False)
class Shortlist:
    """The best candidates of a ranking, refined.

    Attributes:
        ids: of their effects.
        starts, refined: what is fitted of them, and where they came to.
        scored: best first; their candidates are indices of the above.
    """

    ids: Sequence[str]
    starts: Sequence[CandidateStart]
    refined: Sequence[Refined]
    scored: Sequence[Scored]

    @property
    def winner(self) -> RefinedModel:
        """The model with the best of them."""
        return self.of(0)

    def of(self, chosen: int) -> RefinedModel:
        """The model with the candidate of a place in the order."""
        best = self.scored[chosen].candidate
        return self.refined[best].estimate.fitting(self.starts[best].precision)


def shortlist(t: TrainingSet, at: RefinedModel, ranking: Ranking, present: str = "") -> Shortlist:
    """Refine the best candidates, and the effect whose place is searched again, and score them again."""
    of = [ranking.candidates[s.candidate].effect.id for s in ranking.order]
    chosen = [s for k, s in enumerate(ranking.order) if k < LENGTH or of[k] == present]
    best = sorted(chosen, key=lambda s: s.candidate)
    effects = [ranking.candidates[s.candidate].effect for s in best]
    starts = [start(at, ranking, s) for s in best]
    refined = for_each(lambda s: refine(t, at, ranking.nuisance, s), starts, [at.start])
    starts = [replace(s, values=r.own(at)) for r, s in zip(refined, starts, strict=True)]
    shapes = [as_shape(t, r, ranking.base, at, s) for r, s in zip(refined, starts, strict=True)]
    found = [Candidate(e, [s]) for e, s in zip(effects, shapes, strict=True)]
    table = gram_table(ranking.base, t.blocks, found, ranking.nuisance, ranking.table.sigma)
    scored = in_order([score(table, k, 1) for k in range(len(best))])
    return Shortlist([e.id for e in effects], starts, refined, scored)


def leads(t: TrainingSet, ranking: Ranking, present: str) -> bool:
    """Whether an effect explains more than every other does, before any is refined.

    By the noise of the training set; by as much as an effect must bring, and without being a free curve,
    to which a simple law that is hardly worse is preferred.
    """
    order = weighted(t, np.asarray(t.sigma), ranking.base, ranking.nuisance, ranking.candidates).order
    if not order or ranking.candidates[order[0].candidate].effect.search.smooth:
        return False
    first = ranking.candidates[order[0].candidate].effect.id == present
    return first and (len(order) < 2 or order[0].score < order[1].score - NEW)


def reweighted(
    t: TrainingSet, at: RefinedModel, ranking: Ranking, present: str = ""
) -> tuple[TrainingSet, Ranking, Shortlist] | None:
    """A shortlist in which an error counts by what even the best candidate leaves over.

    Where no candidate explains the data down to the noise, what is left is no noise, and to weigh it as
    such would move the nominal coefficients to wherever it becomes a little less. It also lasts: where
    it is correlated over more windows than overlap, fewer count as independent, by the same factor on
    all axes (the geometric mean of theirs): that an axis lacks something that lasts is no reason to
    believe the others more. On no axis does it count more than the error before, which a wrong winner
    may have made larger. None: weighed so, no candidate has a signal, and nothing can be distinguished.
    """
    least = ranking.table.sigma
    t = replace(t, sigma=least)
    most = np.sqrt(np.mean(ranking.base**2, axis=0))
    if not ranking.order:
        return None
    found = shortlist(t, at, ranking, present)
    for _ in range(STEPS):
        left = found.refined[found.scored[0].candidate].left
        spoiled = np.sqrt(np.mean(left**2, axis=0))
        lasting = np.exp(np.mean(np.log(independent(t.data, left))))
        sigma = np.maximum(least, np.minimum(spoiled, most)) * np.sqrt(lasting)
        change = sigma / ranking.table.sigma
        if (change < CHANGED).all() and (change > 1.0 / CHANGED).all():
            break
        t = replace(t, sigma=sigma)
        ranking = weighted(t, sigma, ranking.base, ranking.nuisance, ranking.candidates)
        if not ranking.order:
            return None
        found = shortlist(t, at, ranking, present)
    return t, ranking, found


def start(at: RefinedModel, ranking: Ranking, best: Scored) -> CandidateStart:
    """A candidate's parameters by the linear fit; those without any data stay out."""
    shape = ranking.candidates[best.candidate].shapes[best.shape]
    beta = fitted_columns(ranking.table, best.candidate, best.shape)
    columns = ranking.table.entries[best.candidate][best.shape].columns
    found = {n: beta[k] for n, k in zip(shape.fitted, columns, strict=True) if k in beta}
    values = {n: shape.given.get(n, 0.0) + found.get(n, 0.0) for n in (*shape.given, *found)}
    fitted = [n for n in values if timed(at.start.ship, n) is None]
    size = len(fitted)
    precision = np.zeros((size, size)) if shape.precision is None else shape.precision
    return CandidateStart(values, fitted, precision)
