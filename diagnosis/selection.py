"""Forward selection: the effect that is missing first, then the next, until nothing more is sure.

After each finding the model takes the effect in, with its parameters refined by Gauss-Newton steps on
the model error itself, so that the next search starts from a model that is right so far.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from .library import Candidate, doubts, evaluate, library
from .model import Model
from .ranking import OVERLAP, Judged, Table, first_share, fit, judge, pieces, table
from .weak import Integrals

GAIN = 0.05
LEAST = 10.0  # twice a log likelihood ratio that chance does not give among so many candidates
Q2 = 0.1
MOST = 4
REPLICATES = 200
SEPARATION = 0.05
ROUNDS = 4
# A moment cannot be refined by slopes.
STEPWISE = ("bow_failure_time",)
FLOOR = np.array([1e-3, 1e-3, 3e-4])  # N, N, N m: below, numbers are those of the arithmetic


@dataclass(frozen=True, eq=False)
class Ranked:
    """A candidate in the order of its score."""

    id: str
    score: float
    q2: float


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that was found.

    Attributes:
        id: of the effect.
        values: its parameters as additions to the nominal ones.
        ci95: interval of each that is free, at the final step.
        confidence: share of bootstrap replicates in which it came first.
        alike: ids that these data cannot tell from it, itself not among them.
        q2: cross-validated share of the model error that is explained.
        model: with this and all earlier findings.
        share: cross-validated share of the first model error's sum of squares that this one explains.
    """

    id: str
    values: Mapping[str, float]
    ci95: Mapping[str, tuple[float, float]]
    confidence: float
    alike: Sequence[str]
    q2: float
    model: Model = field(default_factory=Model)
    share: float = 0.0


@dataclass(frozen=True, eq=False)
class Suspect:
    """A nominal coefficient that is likely wrong.

    Attributes:
        name: of the coefficient.
        z: standard deviations of its prior by which the data move it.
        value: the new total.
    """

    name: str
    z: float
    value: float


@dataclass(frozen=True, eq=False)
class Learned:
    """What was learned.

    Attributes:
        findings: in the order of acceptance.
        ranking: of the first step.
        model: that has all findings.
        suspects: nominal coefficients that are likely wrong.
        sigma: (3,), noise of each axis at the first step [N, N, N m].
    """

    findings: Sequence[Finding] = field(default_factory=list)
    ranking: Sequence[Ranked] = field(default_factory=list)
    model: Model = field(default_factory=Model)
    suspects: Sequence[Suspect] = field(default_factory=list)
    sigma: np.ndarray = field(default_factory=FLOOR.copy)


def learn(
    data: Sequence[Integrals],
    prior: float,
    model: Model | None = None,
    advance: Callable[[str], None] = lambda _: None,
    seed: int = 0,
) -> Learned:
    """Find the effects that the model lacks.

    Args:
        data: windows of every training run.
        prior: relative standard deviation believed of every nominal coefficient.
        model: to start from; the nominal one by default.
        advance: told what is being done.
        seed: of the bootstrap.
    """
    model = model or Model()
    blocks = np.concatenate([10_000 * k + w.block for k, w in enumerate(data)])
    rng = np.random.default_rng(seed)
    findings: list[Finding] = []
    first: list[Ranked] = []
    left, sigma = 1.0, FLOOR
    for step in range(MOST):
        advance(f"step {step + 1}: every effect as a candidate")
        base = evaluate(data, model)
        done = {f.id for f in findings}
        candidates = [c for c in library(data, model, base) if c.effect.id not in done]
        t = table(base, blocks, candidates, doubts(data, base, model, prior), FLOOR)
        ranked = sorted(
            (judge(t, k, len(c.shapes)) for k, c in enumerate(candidates)), key=lambda j: j.score
        )
        if step == 0:
            sigma = t.sigma
            total = float(t.grams[:, 0, 0].sum())
            first = [
                Ranked(candidates[j.candidate].effect.id, j.score, 1.0 - j.blocks.sum() / total)
                for j in ranked
            ]
        best = ranked[0]
        if not accepted(t, judge(t, -1, 1), best):
            break
        advance(f"step {step + 1}: how sure is it")
        confidence = first_share(t, ranked[:10], REPLICATES, rng)[0]
        found = candidates[best.candidate]
        values, std = refine(data, model, start_values(t, found, best), t.sigma, prior)
        ci95 = {n: (values[n] - 1.96 * s, values[n] + 1.96 * s) for n, s in std.items()}
        alike = [candidates[j.candidate].effect.id for j in ranked[1:] if same(t, best, j)]
        q2 = explained(t, best)
        model = model.plus(values)
        share, left = left * q2, left * (1.0 - q2)
        findings.append(
            Finding(found.effect.id, values, ci95, float(confidence), alike, q2, model, share)
        )
    return Learned(findings, first, model, sigma=sigma)


def explained(t: Table, j: Judged) -> float:
    """Q2 = 1 - PRESS/SS, about zero."""
    return 1.0 - float(j.blocks.sum()) / float(t.grams[:, 0, 0].sum())


def accepted(t: Table, nothing: Judged, best: Judged) -> bool:
    """Whether a candidate is more than chance and more than the nominal coefficients' doubt."""
    gain = nothing.score - best.score
    return gain > max(GAIN * nothing.score, LEAST) and explained(t, best) > Q2


def same(t: Table, best: Judged, other: Judged) -> bool:
    """Whether another candidate is within two paired standard errors, or can do what the best does."""
    d = other.blocks - best.blocks
    behind = float(d.sum()) + other.charge - best.charge
    if behind <= 2.0 * float(np.sqrt(len(d)) * d.std()):
        return True
    return separation(t, best, other) < SEPARATION


def separation(t: Table, best: Judged, other: Judged) -> float:
    """Share of the best one's force that the other and the nominal coefficients cannot give."""
    mine, its = (pieces(t, j.candidate, j.shape) for j in (best, other))
    force = -mine.target
    force[mine.free] += mine.fitted(t.total, t.nuisance).beta
    force[0] = 0.0
    given = its.target.copy()
    given[0] = 0.0
    alone = fit(t.total, force, [], t.nuisance)
    with_other = fit(t.total, force + given, its.free, t.nuisance)
    costs = [float(f.loss(t.total)) + f.unlikely for f in (alone, with_other)]
    return costs[1] / max(costs[0], 1e-12)


class Refined(NamedTuple):
    """Parameters of an effect, and the standard deviation of those that were fitted."""

    values: dict[str, float]
    std: dict[str, float]


def start_values(t: Table, candidate: Candidate, best: Judged) -> Refined:
    """Parameters by the linear fit; those without any data stay out."""
    shape = candidate.shapes[best.shape]
    mine = pieces(t, best.candidate, best.shape)
    beta = dict(zip(mine.free, mine.fitted(t.total, t.nuisance).beta, strict=True))
    columns = t.place[best.candidate, best.shape][1]
    found = {n: float(beta[k]) for n, k in zip(shape.free, columns, strict=True) if k in beta}
    bent = {name: 0.0 for name in shape.given if name not in STEPWISE}
    return Refined(dict(shape.given) | found, dict.fromkeys(found, 0.0) | bent)


def refine(
    data: Sequence[Integrals], model: Model, begin: Refined, sigma: np.ndarray, prior: float
) -> Refined:
    """Gauss-Newton steps on the model error, with the nominal coefficients in doubt.

    Args:
        data, model: the runs and the model without the effect.
        begin: parameters to start from; those in ``std`` are fitted.
        sigma: (3,), noise of each axis.
        prior: relative standard deviation of the nominal coefficients.
    """
    values, live = dict(begin.values), list(begin.std)
    if not live:
        return begin
    scale = 1.0 / sigma / np.sqrt(OVERLAP)
    std = np.zeros(len(live))
    for _ in range(ROUNDS):
        now = model.plus(values)
        left = evaluate(data, now)
        slopes = []
        for name in live:
            small = 1e-3 * max(abs(values[name]), 1e-2)
            moved = evaluate(data, model.plus(values | {name: values[name] + small}))
            slopes.append((left - moved) / small)
        A = np.concatenate([np.stack(slopes, axis=2), doubts(data, left, now, prior)], axis=2)
        A = np.moveaxis(A * scale[:, None], 2, 0).reshape(A.shape[2], -1).T
        H = A.T @ A
        ridge = np.ones(len(H))
        ridge[: len(live)] = 1e-9 * np.diag(H)[: len(live)]
        H += np.diag(ridge)
        delta = np.linalg.solve(H, A.T @ (left * scale).reshape(-1))[: len(live)]
        std = np.sqrt(np.diag(np.linalg.inv(H))[: len(live)])
        values |= {n: values[n] + float(d) for n, d in zip(live, delta, strict=True)}
        if (np.abs(delta) < 0.1 * std).all():
            break
    return Refined(values, dict(zip(live, std.tolist(), strict=True)))
