"""Forward selection: the effect that is missing first, then the next, until nothing more is sure.

Each step scores every effect by block-cross-validated MAP regression, refines the best by Gauss-Newton,
and accepts the first if it is beyond chance and helps in runs that it was not fitted to. The model then
takes the effect in, so that the next step starts from a model that is right so far; what was found is
refined along with each further candidate.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from fmus.effects import Effect

from ..model import Integrals, Model
from .findings import Finding, Findings, Ranked, Suspect
from .gram import RUN
from .map_regression import RIDGE, Scored, first_share
from .prior import NominalPrior
from .refinement import Estimate, TrainingSet
from .shortlist import Ranking, Shortlist, alike, rank, reweighted
from .waves import Waves, find_waves

# Of acceptance: fall of the score, which is twice a log likelihood ratio. Chance does not give 10 among
# some fifty candidates (2 log 50 = 7.8), and what is less than 0.3 % of the error changes no prediction.
LEAST_FALL, LEAST_SHARE = 10.0, 0.003
LEAST_Q2 = 0.05  # cross-validated share of the model error that must be explained; chosen
MOST_EFFECTS = 6  # chosen: with more, no one acts on the last
REPLICATES = 200  # of the bootstrap: the standard error of a share is 3.5 % at the most
SUSPECT = 4.0  # posterior standard deviations; among thirty coefficients chance gives it in 0.2 %
NORMAL_95 = 1.96


class ForwardSelection:
    """Block-cross-validated forward selection of MAP regressions with Gauss-Newton refinement."""

    name = "selection"

    def fit(
        self,
        runs: Sequence[Integrals],
        model: Model,
        prior: float,
        advance: Callable[[str], None],
        seed: int,
    ) -> Findings:
        """The effects that a model lacks, see :class:`.methods.Method`."""
        rng = np.random.default_rng(seed)
        found, likeliest = search(runs, prior, model, advance, rng)
        spectral = [e for e in model.ship.effects.values() if e.search.by == "spectrum"]
        if not spectral:
            return found
        advance("waves")
        for w in runs:  # the windows of a long run need room
            w.memory.clear()
        peak = find_waves([w.smoothed for w in runs], likeliest, rng)
        if peak is None:
            return found
        ranking = [Ranked(spectral[0].id, 0.0, peak.share), *found.ranking]
        effects = [of_waves(spectral[0], peak, model), *found.effects]
        return replace(found, effects=effects, ranking=ranking)


def search(
    data: Sequence[Integrals],
    prior: float,
    start: Model,
    advance: Callable[[str], None],
    rng: np.random.Generator,
) -> tuple[Findings, Model]:
    """All effects that a regression finds, and the most likely model with them.

    Args:
        data: windows of every training run.
        prior: relative standard deviation believed of every nominal coefficient.
        start: model to start from.
        advance: receives the name of each step.
        rng: for the bootstrap.
    """
    blocks = np.concatenate([RUN * k + w.block for k, w in enumerate(data)])
    belief = NominalPrior.of(start, prior)
    t, at = TrainingSet(data, blocks, None, belief), Estimate.at(start, belief)
    advance("every effect as a candidate")
    ranking = rank(t, at, set())
    lacking = ranking.base
    ranked: list[Ranked] = []
    findings: list[Finding] = []
    while len(findings) < MOST_EFFECTS:
        advance(f"effect {len(findings) + 1}: the best candidates refined")
        t, ranking, best = reweighted(t, at, ranking)
        total = float(np.sum((lacking * t.weight) ** 2))
        ranked = ranked or in_one_order(ranking, best)
        if not accepted(ranking.nothing, best.scored[0], total):
            break
        advance(f"effect {len(findings) + 1}: how sure is it")
        findings.append(finding(ranking, best, total, rng))
        at = best.winner
        findings[-1] = replace(findings[-1], model=at.model(belief))
        advance(f"effect {len(findings) + 1}: every effect as a candidate")
        del ranking, best  # of a long run there is no room for two
        ranking = rank(t, at, {f.id for f in findings})
    offset, std = posterior(t, at, ranking)
    names = at.fitted
    ci95 = {n: interval(at.values[n], float(s)) for n, s in zip(names, std, strict=False)}
    for k, f in enumerate(findings):  # as refined along with the later ones
        values = {n: at.values[n] for n in f.values}
        own = {n: c for n, c in ci95.items() if n in values}
        findings[k] = replace(f, values=values, ci95=dict(f.ci95) | own)
    suspects = suspected(belief, offset[len(names) :], std[len(names) :]) if prior > 0.0 else []
    last = at.model(belief) if at.values else start
    likeliest = replace(at, offset=offset[len(names) :]).model(belief)
    return Findings(findings, ranked, last, suspects, np.asarray(t.sigma)), likeliest


def in_one_order(ranking: Ranking, best: Shortlist) -> list[Ranked]:
    """Every candidate in order, those of the shortlist as refined."""
    refined = [(best.ids[s.candidate], s) for s in best.scored]
    rest = [(ranking.candidates[s.candidate].effect.id, s) for s in ranking.order[len(refined) :]]
    found = [Ranked(i, s.score, 1.0 - float(s.blocks.sum()) / ranking.size) for i, s in refined + rest]
    return sorted(found, key=lambda r: r.score)


def finding(ranking: Ranking, best: Shortlist, size: float, rng: np.random.Generator) -> Finding:
    """The best candidate as a finding.

    Args:
        ranking, best: the step that found it.
        size: sum of squares of the first model error, in units of the noise.
        rng: for the bootstrap.
    """
    first, *others = best.scored
    left, before = float(first.blocks.sum()), float(ranking.nothing.blocks.sum())
    return Finding(
        best.ids[first.candidate],
        best.starts[first.candidate].values,
        best.refined[first.candidate].intervals,
        float(first_share(best.table, best.scored, REPLICATES, rng)[0]),
        [best.ids[s.candidate] for s in others if alike(best.table, first, s)],
        1.0 - left / size,
        (before - left) / size,
    )


def of_waves(e: Effect, found: Waves, start: Model) -> Finding:
    """Waves as a finding: the model stays as it is."""
    values = {"wave_peak": found.peak - start.value("wave_peak"), "wave_force": found.force}
    return Finding(e.id, values, {}, found.confidence, [], found.share, found.share, start)


def interval(value: float, std: float) -> tuple[float, float]:
    """95 % interval."""
    return value - NORMAL_95 * std, value + NORMAL_95 * std


def posterior(t: TrainingSet, at: Estimate, ranking: Ranking) -> tuple[np.ndarray, np.ndarray]:
    """Mean (q,) of everything that was fitted, and its standard deviation."""
    along, weight = ranking.nuisance, t.weight
    A = np.moveaxis(along.columns * weight[:, None], 2, 0).reshape(along.offset.size, -1).T
    H = A.T @ A + along.precision
    H += RIDGE * np.diag(np.diag(H) + 1.0)
    right = A.T @ (ranking.base * weight).reshape(-1) - along.precision @ along.offset
    delta = np.linalg.solve(H, right)
    return along.offset + delta, np.sqrt(np.diag(np.linalg.inv(H)))


def suspected(prior: NominalPrior, offset: np.ndarray, std: np.ndarray) -> list[Suspect]:
    """Nominal coefficients whose posterior excludes what is believed of them, the surest first."""
    found = [
        Suspect(name, float(k / s), prior.mean[name] + believed * float(k))
        for (name, believed), k, s in zip(prior.std.items(), offset, std, strict=True)
    ]
    return sorted((s for s in found if abs(s.z) > SUSPECT), key=lambda s: -abs(s.z))


def accepted(nothing: Scored, best: Scored, total: float) -> bool:
    """Whether a candidate is beyond chance, and helps in runs that it was not fitted to."""
    fall = nothing.score - best.score
    return (
        best.runs < nothing.runs
        and fall > max(LEAST_SHARE * nothing.score, LEAST_FALL)
        and float(best.blocks.sum()) < (1.0 - LEAST_Q2) * total
    )
