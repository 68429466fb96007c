"""Forward selection: the effect that is missing first, then the next, until nothing more is sure.

Each step scores every effect by block-cross-validated MAP regression, refines the best by Gauss-Newton,
and accepts the first if it is beyond chance and does no harm in runs that it was not fitted to. The
model then takes the effect in, so that the next step starts from a model that is right so far; what was
found is refined along with each candidate. With a second effect in, each effect is searched again.

One of two causes, alone, may well do harm where the other acts most: an effect that explains much and
harms is kept on trial for one step, and stays if it and the next do no harm together.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..execution.progress import Advance
from ..predictors import Model, WeakWindows
from ..predictors.weak_form import commanded
from ..runs.run_constants import STEPS
from .conclusion import AcceptedEffect, Selection
from .findings import MOST_REPORTED, Finding, Findings, Ranked
from .map_regression import Scored, first_share
from .nonlinear.profile import profiled
from .nonlinear.waves import find_waves
from .prior import MEASURED, NominalPrior, Prior
from .refinement import RefinedModel, TrainingSet, nuisance_of, refit
from .shortlist import (
    MadeCandidates,
    Ranking,
    Shortlist,
    further_effects,
    leads,
    rank,
    reweighted,
    scored_alone,
)
from .significance import better, beyond_chance, harmful, matters


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
            return replace(found, effects=effects, ranking=ranking, refit=with_waves)

        return with_waves()


def search(
    data: Sequence[WeakWindows], prior: Prior, start: Model, advance: Advance, rng: np.random.Generator
) -> Selection:
    """All effects that a regression finds; arguments as of :class:`.methods.Method`."""
    belief = NominalPrior.of(start, prior, MEASURED)
    t, at = TrainingSet(data, None, belief), RefinedModel.at(start, belief)
    advance("every effect as a candidate")
    made: MadeCandidates = {}
    ranking = rank(t, at, set(), made)
    likely = further_effects(ranking, start)
    lacking, command = ranking.base, commanded(data, start)
    ranked: list[Ranked] = []
    accepted: list[AcceptedEffect] = []
    before: tuple[TrainingSet, RefinedModel] | None = None  # an effect that is on trial
    while len(accepted) < MOST_REPORTED:
        advance(f"{_in_turn(len(accepted) + 1, likely)}: the best candidates refined")
        weighed = reweighted(t, at, ranking)
        if weighed is None:
            t = t if t.sigma is not None else replace(t, sigma=ranking.table.sigma)
            break
        t, ranking, best = weighed
        total = float(np.sum((lacking * t.weight) ** 2))
        first = best.scored[0]
        without = best.winner.without(best.starts[first.candidate].values)
        left = best.refined[first.candidate].left
        # As well fitted as the candidates are: what other coefficients give is not an effect's.
        alone = refit(t, at, ranking.nuisance).estimate
        nothing = scored_alone(t, alone)
        ranked = ranked or in_one_order(ranking, best, nothing)
        shows = matters(lacking, t.error(without), left, command)
        if not (shows and beyond_chance(nothing, first, total)):
            break
        harms = harmful(nothing if before is None else scored_alone(t, before[1]), first)
        if harms and before is not None:
            break
        before = (t, alone) if harms else None
        accepted.append(accepted_effect(best, rng))
        at = best.winner
        likely = min(len(accepted) - 1 + further_effects(ranking, start), MOST_REPORTED)
        del ranking, best  # of a long run there is no room for two
        if len(accepted) > 1 and before is None:
            at, accepted = searched_again(t, at, accepted, made, advance, rng)
        advance(f"{_in_turn(len(accepted) + 1, likely)}: every effect as a candidate")
        ranking = rank(t, at, {p.id for p in accepted}, made)
    if before is not None:
        t, at = before
        del accepted[-1]
    at = refit(t, at, nuisance_of(t, at, t.error(at))).estimate
    for k, p in enumerate(accepted):
        at, intervals = profiled(t, at, p)
        accepted[k] = replace(p, intervals={**p.intervals, **intervals})
    return Selection(t, at, accepted, ranked, lacking, NominalPrior.of(start, prior))


def _in_turn(number: int, likely: int) -> str:
    """The effect that is searched, and how many there may be."""
    return f"effect {number} of about {max(number, likely)}"


def searched_again(
    t: TrainingSet,
    at: RefinedModel,
    accepted: Sequence[AcceptedEffect],
    made: MadeCandidates,
    advance: Advance,
    rng: np.random.Generator,
) -> tuple[RefinedModel, list[AcceptedEffect]]:
    """Each effect but the last found is taken out, and its place searched again beside the others.

    What came first had to stand for all that was missing: a wrong one, or a free curve where a simple
    law does, gives way to what is better beside the others.
    """
    found = list(accepted)
    count = len(found) - 1
    due = [*range(count)]  # effects of which something beside them has changed
    for _ in range(STEPS * count):
        if not due:
            break
        k = due.pop(0)
        advance(f"effect {k + 1}: its place searched again")
        others = [p for p in found if p is not found[k]]
        beside = at.without(found[k].names)
        nuisance = nuisance_of(t, beside, t.error(beside))
        beside = refit(t, beside, nuisance).estimate
        theta = [*[beside.values[n] for n in beside.fitted], *beside.offset]
        nuisance = replace(nuisance, offset=np.array(theta))
        ranking = rank(t, beside, {p.id for p in others}, made, nuisance)
        if leads(t, ranking, found[k].id):
            continue
        weighed = reweighted(t, beside, ranking)
        chosen = weighed and better(found[k].id, weighed[-1], at.start.ship)
        if weighed is not None and chosen is not None:
            t, _, best = weighed
            found[k] = accepted_effect(best, rng, chosen)
            at = best.of(chosen)
            due = [(k + j) % count for j in range(1, count)]
    return at, found


def accepted_effect(best: Shortlist, rng: np.random.Generator, chosen: int = 0) -> AcceptedEffect:
    """A candidate of a shortlist, by its place in the order, as an effect that was found."""
    first = best.scored[chosen].candidate
    shares = first_share(best.scored, rng).tolist()
    return AcceptedEffect(
        best.ids[first],
        tuple(best.starts[first].values),
        best.refined[first].intervals,
        {best.ids[s.candidate]: share for s, share in zip(best.scored, shares, strict=True)},
    )


def in_one_order(ranking: Ranking, best: Shortlist, nothing: Scored) -> list[Ranked]:
    """Every candidate in order, those of the shortlist as refined; ``nothing``: coefficients alone."""
    refined = [(best.ids[s.candidate], s) for s in best.scored]
    rest = [(ranking.candidates[s.candidate].effect.id, s) for s in ranking.order[len(refined) :]]
    in_order = sorted(refined + rest, key=lambda named: named[1].score)
    first, alone = in_order[0][1], float(nothing.blocks.sum())

    def ranked(name: str, s: Scored) -> Ranked:
        d, left = s.blocks - first.blocks, float(s.blocks.sum())
        q2, beyond, std = 1.0 - left / ranking.size, 1.0 - left / alone, np.sqrt(d.size) * d.std()
        return Ranked(name, s.score, q2, beyond, s.score - first.score, float(std))

    return [ranked(name, s) for name, s in in_order]
