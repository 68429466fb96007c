"""One step of the search: every effect as a candidate beside the model so far.

All candidates are judged by a fit that is straight in their parameters; the best of them are then moved
to where they fit best and judged again.
"""

from collections.abc import Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from .library import NOMINAL, Candidate, evaluate, library
from .ranking import RIDGE, Judged, Pieces, judge, pieces
from .refining import MOMENT, Point, Problem, Refined, Start, doubts, polished, settled
from .table import Doubt, Table, noise, table

CONTENDERS = 8
# Share of a force that must be its own for data to tell its cause from another, or from those found.
SEPARATION = 0.05
WEIGHINGS = 4
CHANGED = 1.5
# A free shape that can do what a plain effect does is not listed as another explanation of it.
FREE_SHAPE = 5
FLOOR = np.array([1e-3, 1e-3, 3e-4])  # N, N, N m: below, numbers are those of the arithmetic


@dataclass(frozen=True, eq=False)
class Step:
    """All candidates beside a model.

    Attributes:
        base: (K, 3), its model error.
        doubt: what is fitted along.
        wide: all candidates in a table.
        candidates: in the table's order.
        order: the candidates judged, best first.
        nothing: how it stands without any.
    """

    base: np.ndarray
    doubt: Doubt
    wide: Table
    candidates: Sequence[Candidate]
    order: Sequence[Judged]
    nothing: Judged

    @property
    def size(self) -> float:
        """Sum of squares of the model error, in units of the noise."""
        return float(self.wide.total[0, 0])


def candidates(p: Problem, at: Point, known: Set[str]) -> Step:
    """Judge every effect that is not known yet, by a fit that is straight in its parameters."""
    model = at.model(p.prior)
    base = evaluate(p.data, model)
    found = [c for c in library(p.data, model, base) if c.effect.id not in known]
    doubt = doubts(p, at, base)
    straight = [s.columns for c in found for s in c.shapes[:1]]
    sigma = noise(base, np.concatenate([*straight, doubt.columns], axis=2), FLOOR)
    return weighed(p, sigma, base, doubt, found)


def weighed(
    p: Problem, sigma: np.ndarray, base: np.ndarray, doubt: Doubt, found: Sequence[Candidate]
) -> Step:
    """Judge candidates with an error counted in units of sigma (3,) [N, N, N m]."""
    wide = table(base, p.blocks, found, doubt, sigma)
    free = len(doubt.moved) - len(NOMINAL)
    new = [k for k in range(len(found)) if novelty(wide, k, free) >= SEPARATION]
    order = in_order([judge(wide, k, len(found[k].shapes)) for k in new])
    return Step(base, doubt, wide, found, order, judge(wide, -1, 1))


def novelty(t: Table, candidate: int, free: int) -> float:
    """Share of a straight candidate's force that what was found cannot give, set freely; else 1.

    Args:
        t: the table it stands in.
        candidate: its number.
        free: how many parameters of what was found are fitted along, the first of all that are.
    """
    offset, mine = t.place[candidate, 0]
    if free == 0 or offset >= 0 or not mine:
        return 1.0
    its = t.doubt[:free]
    own, gram, across = t.total[mine][:, mine], t.total[its][:, its], t.total[its][:, mine]
    gram = gram + RIDGE * np.diag(np.diag(gram) + 1.0)
    left = np.diag(own - across.T @ np.linalg.solve(gram, across))
    return float(np.max(left / np.maximum(np.diag(own), 1e-12)))


def in_order(judged: Sequence[Judged]) -> list[Judged]:
    """The best first; of two that are the same on any data the one that was declared first."""
    return sorted(judged, key=lambda j: (round(j.score, 2), j.candidate))


@dataclass(frozen=True, eq=False)
class Contest:
    """The best candidates of a step, each where it fits best.

    Attributes:
        ids: of their effects.
        starts, refined: where they started from, and where they came to.
        table: all of them.
        judged: best first; their candidates are indices of the above.
    """

    ids: Sequence[str]
    starts: Sequence[Start]
    refined: Sequence[Refined]
    table: Table
    judged: Sequence[Judged]

    @property
    def winner(self) -> Point:
        """The model with the best of them."""
        best = self.judged[0].candidate
        point = self.refined[best].point
        return replace(point, stiff=np.asarray(block_diag(point.stiff, self.starts[best].stiff)))


def contend(p: Problem, at: Point, step: Step) -> Contest:
    """Move the best candidates to where they fit best and judge them again."""
    best = sorted(step.order[:CONTENDERS], key=lambda j: j.candidate)
    effects = [step.candidates[j.candidate].effect for j in best]
    starts = [start(step, j) for j in best]
    refined = [polished(p, at, step.doubt, s) for s in starts]
    shapes = [settled(r, step.base, at, s) for r, s in zip(refined, starts, strict=True)]
    moved = [Candidate(e, [s]) for e, s in zip(effects, shapes, strict=True)]
    t = table(step.base, p.blocks, moved, step.doubt, step.wide.sigma)
    judged = in_order([judge(t, k, 1) for k in range(len(best))])
    return Contest([e.id for e in effects], starts, refined, t, judged)


def settle(p: Problem, at: Point, step: Step) -> tuple[Problem, Step, Contest]:
    """A contest in which an error counts by what even the best of all leaves over.

    Where no candidate explains the data down to the noise, what is left is no noise, and to weigh it as
    such would move the nominal coefficients to wherever it becomes a little less.

    Args:
        p, at, step: all candidates beside a model.
    """
    least = step.wide.sigma
    p = replace(p, sigma=least)
    contest = contend(p, at, step)
    for _ in range(WEIGHINGS):
        left = contest.refined[contest.judged[0].candidate].left
        sigma = np.maximum(least, np.sqrt(np.mean(left**2, axis=0)))
        change = sigma / step.wide.sigma
        if (change < CHANGED).all() and (change > 1.0 / CHANGED).all():
            break
        p = replace(p, sigma=sigma)
        step = weighed(p, sigma, step.base, step.doubt, step.candidates)
        contest = contend(p, at, step)
    return p, step, contest


def start(step: Step, best: Judged) -> Start:
    """Parameters by the linear fit; those without any data stay out."""
    shape = step.candidates[best.candidate].shapes[best.shape]
    mine = pieces(step.wide, best.candidate, best.shape)
    beta = dict(zip(mine.use.tolist(), mine.fitted(step.wide.total).beta, strict=False))
    columns = step.wide.place[best.candidate, best.shape][1]
    found = {n: float(beta[k]) for n, k in zip(shape.free, columns, strict=True) if k in beta}
    values = {n: shape.given.get(n, 0.0) + found.get(n, 0.0) for n in (*shape.given, *found)}
    live = [n for n in values if n != MOMENT]
    stiff = np.zeros((len(live), len(live))) if shape.stiff is None else shape.stiff
    return Start(values, live, stiff)


def same(t: Table, best: Judged, other: Judged) -> bool:
    """Whether another candidate is within two paired standard errors, or can do what the best does."""
    d = other.blocks - best.blocks
    behind = float(d.sum()) + other.charge - best.charge
    if behind <= 2.0 * float(np.sqrt(len(d)) * d.std()):
        return True
    mine, its = (pieces(t, j.candidate, j.shape) for j in (best, other))
    return its.free < mine.free + FREE_SHAPE and separation(t, mine, its) < SEPARATION


def separation(t: Table, mine: Pieces, its: Pieces) -> float:
    """Share of the best one's force that the other and the nominal coefficients cannot give."""
    force = alone(t, mine)
    force[mine.use[: mine.free]] += mine.fitted(t.total).beta
    nothing = Pieces(force, mine.use[mine.free :], 0, t.doubt_stiff, 0.0 * t.moved[-1, 0], 0)
    other = its._replace(target=force - alone(t, its), moved=0.0 * its.moved)
    costs = [float(f.loss(t.total)) + f.unlikely for f in (x.fitted(t.total) for x in (nothing, other))]
    return costs[1] / max(costs[0], 1e-12)


def alone(t: Table, which: Pieces) -> np.ndarray:
    """(p,), the force of what is given of a candidate, without the coefficients that moved with it."""
    force = -which.target
    force[0] = 0.0
    force[t.doubt] -= which.moved[which.free :] - t.moved[-1, 0]
    return force
