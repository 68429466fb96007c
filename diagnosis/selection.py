"""Forward selection: the effect that is missing first, then the next, until nothing more is sure.

After each finding the model takes the effect in, so that the next search starts from a model that is
right so far; what was found is refitted along with each further candidate.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from .contest import Contest, Step, candidates, same, settle
from .library import NOMINAL, beliefs
from .model import Model
from .ranking import RIDGE, Judged, first_share
from .refining import MOMENT, Point, Problem
from .table import RUN
from .waves import Waves, waves
from .weak import Integrals

WAVES = "waves"
LEAST = 10.0  # twice a log likelihood ratio that chance does not give among so many candidates
GAIN = 0.003
Q2 = 0.05
MOST = 6
REPLICATES = 200
SUSPECT = 4.0


@dataclass(frozen=True, eq=False)
class Ranked:
    """A candidate in the order of its score."""

    id: str
    score: float
    q2: float


@dataclass(frozen=True, eq=False)
class Suspect:
    """A nominal coefficient that is wrong: by how many standard deviations, and what it seems to be."""

    name: str
    z: float
    value: float


@dataclass(frozen=True, eq=False)
class Finding:
    """One effect that was found.

    Attributes:
        id: of the effect.
        values: its parameters as additions to the nominal ones.
        ci95: interval of each that is free, at the final step.
        confidence: share of bootstrap replicates in which it came first.
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
class Learned:
    """What was learned.

    Attributes:
        findings: in order.
        ranking: of the first step.
        model: with all findings.
        suspects: nominal coefficients that are wrong.
        sigma: (3,), noise of each axis [N, N, N m].
    """

    findings: Sequence[Finding] = field(default_factory=list)
    ranking: Sequence[Ranked] = field(default_factory=list)
    model: Model = field(default_factory=Model)
    suspects: Sequence[Suspect] = field(default_factory=list)
    sigma: np.ndarray = field(default_factory=lambda: np.ones(3))


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
    rng = np.random.default_rng(seed)
    start = model or Model()
    learned, likeliest = search(data, prior, start, advance, rng)
    advance("waves")
    for w in data:  # the windows of a long run need room
        w.memory.clear()
    swell = waves([w.smoothed for w in data], likeliest, rng)
    if swell is None:
        return learned
    ranking = [Ranked(WAVES, 0.0, swell.share), *learned.ranking]
    return replace(learned, findings=[of_waves(swell, start), *learned.findings], ranking=ranking)


def search(
    data: Sequence[Integrals],
    prior: float,
    start: Model,
    advance: Callable[[str], None],
    rng: np.random.Generator,
) -> tuple[Learned, Model]:
    """All effects but waves, and the likeliest model with them; arguments as of :func:`learn`."""
    blocks = np.concatenate([RUN * k + w.block for k, w in enumerate(data)])
    p, at = Problem(data, blocks, None, prior), Point(start)
    advance("every effect as a candidate")
    step = candidates(p, at, set())
    lacking = step.base
    ranking: list[Ranked] = []
    findings: list[Finding] = []
    while len(findings) < MOST:
        advance(f"effect {len(findings) + 1}: the best candidates where they fit best")
        p, step, contest = settle(p, at, step)
        total = float(np.sum((lacking * p.weight) ** 2))
        ranking = ranking or ranked(step, contest)
        if not accepted(step.nothing, contest.judged[0], total):
            break
        advance(f"effect {len(findings) + 1}: how sure is it")
        findings.append(finding(step, contest, total, rng))
        at = contest.winner
        findings[-1] = replace(findings[-1], model=at.model(prior))
        advance(f"effect {len(findings) + 1}: every effect as a candidate")
        del step, contest  # of a long run there is no room for two
        step = candidates(p, at, {f.id for f in findings})
    shift, std = posterior(p, at, step)
    names = at.fitted
    ci95 = {n: interval(at.values[n], float(s)) for n, s in zip(names, std, strict=False)}
    for k, f in enumerate(findings):  # as refitted along with the later ones
        values = {n: at.values[n] for n in f.values}
        mine = {n: c for n, c in ci95.items() if n in values}
        findings[k] = replace(f, values=values, ci95=dict(f.ci95) | mine)
    suspects = suspected(prior, shift[len(names) :], std[len(names) :]) if prior > 0.0 else []
    last = at.model(prior) if at.values else start
    likeliest = replace(at, moved=shift[len(names) :]).model(prior)
    return Learned(findings, ranking, last, suspects, np.asarray(p.sigma)), likeliest


def ranked(step: Step, contest: Contest) -> list[Ranked]:
    """Every candidate in order."""
    best = [(contest.ids[j.candidate], j) for j in contest.judged]
    rest = [(step.candidates[j.candidate].effect.id, j) for j in step.order[len(best) :]]
    found = [Ranked(i, j.score, 1.0 - float(j.blocks.sum()) / step.size) for i, j in best + rest]
    return sorted(found, key=lambda r: r.score)


def finding(step: Step, contest: Contest, size: float, rng: np.random.Generator) -> Finding:
    """What is to be said of the best candidate.

    Args:
        step, contest: the step that found it.
        size: sum of squares of the model error at first, in units of the noise.
        rng: for the bootstrap.
    """
    first, *others = contest.judged
    moment = contest.refined[first.candidate].span
    left, before = float(first.blocks.sum()), float(step.nothing.blocks.sum())
    return Finding(
        contest.ids[first.candidate],
        contest.starts[first.candidate].values,
        {} if moment is None else {MOMENT: moment},
        float(first_share(contest.table, contest.judged, REPLICATES, rng)[0]),
        [contest.ids[j.candidate] for j in others if same(contest.table, first, j)],
        1.0 - left / size,
        (before - left) / size,
    )


def of_waves(swell: Waves, start: Model) -> Finding:
    """Waves as a finding: the model stays as it is."""
    values = {"wave_peak": swell.peak, "wave_force": swell.force}
    return Finding(WAVES, values, {}, swell.confidence, [], swell.share, swell.share, start)


def interval(value: float, std: float) -> tuple[float, float]:
    """95 % interval."""
    return value - 1.96 * std, value + 1.96 * std


def posterior(p: Problem, at: Point, step: Step) -> tuple[np.ndarray, np.ndarray]:
    """Where everything that was fitted is (q,), and its standard deviation."""
    doubt, weight = step.doubt, p.weight
    A = np.moveaxis(doubt.columns * weight[:, None], 2, 0).reshape(doubt.moved.size, -1).T
    H = A.T @ A + doubt.stiff
    H += RIDGE * np.diag(np.diag(H) + 1.0)
    delta = np.linalg.solve(H, A.T @ (step.base * weight).reshape(-1) - doubt.stiff @ doubt.moved)
    return doubt.moved + delta, np.sqrt(np.diag(np.linalg.inv(H)))


def suspected(prior: float, shift: np.ndarray, std: np.ndarray) -> list[Suspect]:
    """Nominal coefficients that lie far from what is believed of them, the surest first."""
    found = [
        Suspect(name, float(k / s), NOMINAL[name] + believed * float(k))
        for (name, believed), k, s in zip(beliefs(prior).items(), shift, std, strict=True)
    ]
    return sorted((s for s in found if abs(s.z) > SUSPECT), key=lambda s: -abs(s.z))


def accepted(nothing: Judged, best: Judged, total: float) -> bool:
    """Whether a candidate is more than chance, and helps in runs that it was not fitted to."""
    gain = nothing.score - best.score
    elsewhere = best.runs < nothing.runs
    return (
        elsewhere
        and gain > max(GAIN * nothing.score, LEAST)
        and float(best.blocks.sum()) < (1.0 - Q2) * total
    )
