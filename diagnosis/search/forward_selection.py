"""Forward selection: the effect that is missing first, then the next, until nothing more is sure.

Each step scores every effect by block-cross-validated MAP regression, refines the best by Gauss-Newton,
and accepts the first if it is beyond chance and does no harm in runs that it was not fitted to. The
model then takes the effect in, so that the next step starts from a model that is right so far; what was
found is refined along with each candidate. With a second effect in, each effect is searched again, and
removed if nothing brings in its place what an effect must bring.

Values of each run explain more than one for all, and foretell nothing of other runs: they stand back
where an effect with one value foretells runs that it has not seen better.

One of two causes, alone, may well do harm where the other acts most: an effect that explains much and
harms is kept on trial for one step, and stays if it and the next do no harm together.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from fmus.ship import Ship

from ..execution.progress import Advance
from ..predictors import Model, WeakWindows
from ..predictors.ship_model import parameter_and_run
from ..predictors.weak_form import commanded
from .conclusion import AcceptedEffect, Selection
from .effect_evidence import nearest_share
from .findings import MOST_REPORTED, Finding, Findings, Ranked
from .gram import charge_of
from .map_regression import Scored, first_share
from .nonlinear.profile import profiled
from .nonlinear.waves import find_waves
from .prior import MEASURED, NominalPrior, Prior
from .refinement import (
    CandidateStart,
    RefinedModel,
    TrainingSet,
    has_values_of_runs,
    nuisance_of,
    refine,
    refit,
)
from .shortlist import (
    NEW,
    MadeCandidates,
    Ranking,
    Shortlist,
    leads,
    of_one_value,
    rank,
    reweighted,
    scored_alone,
    weighted,
)
from .significance import better, beyond_chance, harmful, matters, worse


class ForwardSelection:
    """Block-cross-validated forward selection of MAP regressions with Gauss-Newton refinement."""

    name = "selection"

    def fit(
        self, runs: Sequence[WeakWindows], model: Model, prior: Prior, advance: Advance, seed: int
    ) -> Findings:
        """The effects that a model lacks, see :class:`.methods.Method`."""
        rng = np.random.default_rng(seed)
        done = search(runs, prior, model, advance, rng)
        spectral = next((e for e in model.ship.effects.values() if e.search.by == "spectrum"), None)
        if spectral is None:
            return done.findings()
        advance("waves")
        for w in runs:  # the windows of a long run need room
            w.memory.clear()
        peak = find_waves([w.smoothed for w in runs], done.model, rng)
        if peak is None:
            return done.findings()
        # The model stays as it is.
        values = {"wave_peak": peak.peak - model.value("wave_peak"), "wave_force": peak.force}
        waves = Finding(spectral.id, values, {}, peak.confidence, [], peak.share, peak.share, model)
        ranked = Ranked(waves.id, 0.0, peak.share)

        def with_waves(ids: Sequence[str] | None = None) -> Findings:
            found = done.findings(ids)
            if ids is not None and waves.id not in ids:
                return found
            effects, ranking = [waves, *found.effects], [ranked, *found.ranking]
            found = replace(found, effects=effects, ranking=ranking, refit=with_waves)
            if len(effects) > 1:
                return found
            # Without another effect the coefficients are those of the first model, and none is suspect.
            folds, of_runs = ([model] * len(each) for each in (found.fold_models, found.run_models))
            return replace(found, suspects=[], fold_models=folds, run_models=of_runs)

        return with_waves()


def search(
    data: Sequence[WeakWindows], prior: Prior, start: Model, advance: Advance, rng: np.random.Generator
) -> Selection:
    """All effects that a regression finds; arguments as of :class:`.methods.Method`."""
    belief = NominalPrior.of(start, prior, MEASURED)
    t, at = TrainingSet(data, None, belief), RefinedModel.at(start, belief)
    lacking = t.error(at)
    shows = partial(matters, lacking, command=commanded(data, start))
    made: MadeCandidates = {}
    ranked: list[Ranked] = []
    accepted: list[AcceptedEffect] = []
    gone: set[str] = set()  # effects that others have made superfluous
    before: tuple[TrainingSet, RefinedModel] | None = None  # an effect that is on trial
    for _ in range(MOST_REPORTED):  # those that give way count, else all come and go where none explains
        turn = f"effect {len(accepted) + 1}"
        advance(f"{turn}: every effect as a candidate")
        ranking = rank(t, at, gone | {p.id for p in accepted}, made, of_each_run=True)
        advance(f"{turn}: the best candidates refined")
        weighed = reweighted(t, at, ranking)
        if weighed is None:
            t = t if t.sigma is not None else replace(t, sigma=ranking.table.sigma)
            break
        if better_with_one_value(weighed[2]):
            of_all = of_one_value(ranking.candidates, start.ship)
            alike = weighted(t, ranking.table.sigma, ranking.base, ranking.nuisance, of_all)
            weighed = reweighted(t, at, alike) or weighed
        t, ranking, best = weighed
        total = float(np.sum((lacking * t.weight) ** 2))
        first = best.scored[0]
        without = best.winner.without(best.starts[first.candidate].values)
        left = best.refined[first.candidate].left
        # As well fitted as the candidates are: what other coefficients give is not an effect's.
        alone = refit(t, at, ranking.nuisance).estimate
        nothing = scored_alone(t, alone)
        ranked = ranked or in_one_order(ranking, best, nothing)
        if not (shows(t.error(without), left) and beyond_chance(nothing, first, total)):
            break
        harms = harmful(nothing if before is None else scored_alone(t, before[1]), first)
        if harms and before is not None:
            break
        before = (t, alone) if harms else None
        accepted.append(accepted_effect(ranking, best, rng, nothing))
        at = best.winner
        del ranking, best  # of a long run there is no room for two
        if len(accepted) > 1 and before is None:
            at, accepted, removed = searched_again(t, at, accepted, made, advance, rng)
            gone |= removed
    if before is not None:
        t, at = before
        del accepted[-1]
    at = refit(t, at, nuisance_of(t, at, t.error(at))).estimate
    for k, p in enumerate(accepted):
        at, p = pooled_over_runs(t, at, p)
        at, intervals = profiled(t, at, p)
        accepted[k] = replace(p, intervals={**p.intervals, **intervals})
    return Selection(t, at, accepted, ranked, lacking, NominalPrior.of(start, prior))


def better_with_one_value(best: Shortlist) -> bool:
    """Whether the first has values of each run, and one with one value foretells unseen runs better."""
    first, *others = best.scored
    of_runs = [
        has_values_of_runs(best.winner.start.ship, best.starts[s.candidate].values) for s in best.scored
    ]
    return of_runs[0] and any(
        not alone and worse(first.runs, s.runs, first.prior - s.prior)
        for s, alone in zip(others, of_runs[1:], strict=True)
    )


def pooled_over_runs(
    t: TrainingSet, at: RefinedModel, p: AcceptedEffect
) -> tuple[RefinedModel, AcceptedEffect]:
    """An effect with one value for all runs, if values of each are no better, by the charge of each.

    When it was accepted other effects and coefficients were still wrong, and differ between runs.
    """
    if not has_values_of_runs(at.start.ship, p.names):
        return at, p
    parameters = dict.fromkeys(parameter_and_run(n)[0] for n in p.names)
    each = {n: [at.values[x] for x in p.names if parameter_and_run(x)[0] == n] for n in parameters}
    of_all = {n: float(np.mean(values)) for n, values in each.items()}
    beside = at.without(p.names)
    begin = CandidateStart(of_all, [*of_all], np.zeros((len(of_all), len(of_all))))
    refined = refine(t, beside, nuisance_of(t, beside, t.error(beside)), begin)
    found = refined.estimate.fitting(begin.precision)
    charge = charge_of(t.blocks[:, 0].size) * (len(p.names) - len(of_all))
    if scored_alone(t, found).score > scored_alone(t, at).score + charge:
        return at, p
    return found, replace(p, names=tuple(of_all))


def searched_again(
    t: TrainingSet,
    at: RefinedModel,
    accepted: Sequence[AcceptedEffect],
    made: MadeCandidates,
    advance: Advance,
    rng: np.random.Generator,
) -> tuple[RefinedModel, list[AcceptedEffect], set[str]]:
    """Each effect is taken out, and its place searched again beside the others that have changed.

    What came first had to stand for all that was missing: a wrong one, or a free curve where a simple
    law does, gives way to what is better beside the others, or to nothing where that does as well.

    Returns:
        The model, the effects in it, and the ids of those that gave way to nothing.
    """
    found, gone = list(accepted), set[str]()
    due = [*range(len(found) - 1)]  # effects of which something beside them has changed
    for _ in range(2 * len(due)):  # more often, effects that are all wrong only change places
        if not due:
            break
        k = due.pop(0)
        advance(f"effect {k + 1}: its place searched again")
        others = [p for p in found if p is not found[k]]
        beside = at.without(found[k].names)
        nuisance = nuisance_of(t, beside, t.error(beside))
        beside = refit(t, beside, nuisance).estimate
        nuisance = replace(nuisance, offset=beside.theta(beside.fitted))
        of_runs = has_values_of_runs(at.start.ship, found[k].names)
        ranking = rank(t, beside, {p.id for p in others}, made, nuisance, of_runs)
        if leads(t, ranking, found[k].id):
            continue
        weighed = reweighted(t, beside, ranking, found[k].id)
        if weighed is None:
            continue
        again, ranking, best = weighed
        beside = refit(again, beside, ranking.nuisance).estimate
        nothing = scored_alone(again, beside)
        if nothing.score - best.scored[0].score < NEW:
            gone.add(found.pop(k).id)
            t, at, due = again, beside, [*range(len(found))]
            continue
        chosen = better(found[k].id, best, at.start.ship)
        if chosen is not None:
            taken = accepted_effect(ranking, best, rng, nothing, chosen)
            taken = taken_over(taken, found[k], at.start.ship)
            found[k] = replace(taken, beside=[p.id for p in others])
            t, at = again, best.of(chosen)
            due = [(k + j) % len(found) for j in range(1, len(found))]
        elif found[k].id in (order := [best.ids[s.candidate] for s in best.scored]):
            now = accepted_effect(ranking, best, rng, nothing, order.index(found[k].id))
            found[k] = replace(found[k], weights=now.weights, nearest=now.nearest)
    return at, found, gone


def taken_over(new: AcceptedEffect, old: AcceptedEffect, ship: Ship) -> AcceptedEffect:
    """An effect in the place of another; a free curve stood for any law, a law for another cause."""
    had = {*old.instead_of} if ship.effects[old.id].search.smooth else {*old.instead_of, old.id}
    return replace(new, instead_of=tuple(sorted(had - {new.id})))


def scored_by_id(ranking: Ranking, best: Shortlist) -> list[tuple[str, Scored]]:
    """The scores of all candidates with their ids: the shortlist, as refined, then the others."""
    refined = [(best.ids[s.candidate], s) for s in best.scored]
    every = ((ranking.candidates[s.candidate].effect.id, s) for s in ranking.order)
    return [*refined, *((name, s) for name, s in every if name not in best.ids)]


def accepted_effect(
    ranking: Ranking, best: Shortlist, rng: np.random.Generator, nothing: Scored, chosen: int = 0
) -> AcceptedEffect:
    """A candidate of a shortlist, by its place in the order, as an effect that was found.

    Others that are not in the shortlist may be as good but for a single block. ``nothing`` is the score
    without any.
    """
    first = best.scored[chosen].candidate
    names, scored = zip(*scored_by_id(ranking, best), strict=True)
    shares = first_share(scored, rng).tolist()
    losses = [float(s.blocks.sum()) for s in best.scored]
    own = losses.pop(chosen)
    nearest = nearest_share(own, losses, float(nothing.blocks.sum()))
    return AcceptedEffect(
        best.ids[first],
        tuple(best.starts[first].values),
        best.refined[first].intervals,
        dict(zip(names, shares, strict=True)),
        nearest,
    )


def in_one_order(ranking: Ranking, best: Shortlist, nothing: Scored) -> list[Ranked]:
    """Every candidate in order, those of the shortlist as refined; ``nothing``: coefficients alone."""
    in_order = sorted(scored_by_id(ranking, best), key=lambda named: named[1].score)
    first, alone = in_order[0][1], float(nothing.blocks.sum())

    def ranked(name: str, s: Scored) -> Ranked:
        d, left = s.blocks - first.blocks, float(s.blocks.sum())
        q2, beyond, std = 1.0 - left / ranking.size, 1.0 - left / alone, np.sqrt(d.size) * d.std()
        return Ranked(name, s.score, q2, beyond, s.score - first.score, float(std))

    return [ranked(name, s) for name, s in in_order]
