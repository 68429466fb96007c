"""When a thruster gave nothing: penalised segmentation of the model error over time.

With y the model error in units of the noise and c_j what it would be less were the thruster dead during
the cell j of time, the intervals minimise

    min over b of |y - sum_j d_j c_j - Z b|^2 + (o + b)^T Q (o + b)  +  log n for each change point,

d_j being 1 inside of them and 0 elsewhere, and Z, Q, o the nuisance parameters as in
:mod:`.map_regression`. log n is the charge of the Bayesian information criterion for a parameter: of
some n places chance finds one at which the sum falls by 2 log n, no more for an interval's two ends.

With b held and windows taken as independent, dynamic programming gives the least sum (Auger and Lawrence
1989; with a charge for each change Killick, Fearnhead and Eckley 2012). Then b is fitted, and so on; at
the end the change points are moved one by one while the exact sum falls.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import csc_matrix, csr_matrix, diags, vstack

from fmus.effects import Effect

from ..model import Integrals, Model
from ..model.weak_form import EVERY, OVERLAP, WIDTH, thrust_along

# s; by which change points move at the least: a few samples. Longer where there were more than CELLS.
CELL, CELLS = 0.1, 50_000
DECIMALS = 6  # of a time [s], so that it reads as it was meant
MOVES = (20, 5, 1)  # cells by which change points are moved, the coarse first
ROUNDS = 8  # of programming and fitting, and of moves, at the most; three are usual
LIKELY = 3.84  # of cost above the least: the 95 % quantile of chi^2 with one degree of freedom

SETTLED = 0.95  # share of the noise by which it must still fall for another round; chosen
FLOOR = np.array([1e-3, 1e-3, 3e-4])  # N, N, N m: below, numbers are those of the arithmetic
# Share of the time at work of a thruster in which it fails at the most: what is so most of the time is
# the rule and no failure, such as a dead band of small commands; chosen.
EXCEPTION = 0.5
RIDGE = 1e-9  # relative: collinear nuisance parameters share what they explain

Interval = tuple[float, float]
Along = tuple[np.ndarray, np.ndarray, np.ndarray]
Spans = list[tuple[int, int]]  # intervals in cells, the second end not included


@dataclass(frozen=True, eq=False)
class Problem:
    """A model error that intervals without thrust may explain.

    Attributes:
        first, cell: time at which the cells begin, and how long each is [s].
        y: (3 K,), model error.
        columns: (3 K, m), what each cell of a dead thruster adds to it.
        count: m, number of cells.
        bins: (K,), number of the EVERY seconds in which the middle of each window lies.
        along: (3 K, q), nuisance parameters; all three in units of the noise, or of force.
        precision, offset: (q, q) and (q,), of the nuisance parameters.
        most: intervals, at the most.
        work: (m,), share of the time in which the thruster is commanded, in each cell.
    """

    first: float
    cell: float
    y: np.ndarray
    columns: csc_matrix
    count: int
    bins: np.ndarray
    along: np.ndarray
    precision: np.ndarray
    offset: np.ndarray
    most: int
    work: np.ndarray

    def passing(self, spans: Spans) -> bool:
        """Whether the thruster works for at least half of the time for which it is commanded."""
        return sum(float(self.work[a:b].sum()) for a, b in spans) <= EXCEPTION

    @property
    def charge(self) -> float:
        """Of each change point."""
        return float(np.log(self.y.size / OVERLAP))

    def weighted(self, sigma: np.ndarray) -> "Problem":
        """The same in units of the noise sigma (3,)."""
        weight = np.tile(1.0 / sigma / np.sqrt(OVERLAP), self.y.size // 3)
        columns = csc_matrix(diags(weight) @ self.columns)
        return replace(self, y=weight * self.y, columns=columns, along=weight[:, None] * self.along)

    def seconds(self, spans: Spans) -> list[Interval]:
        """Intervals in seconds."""
        at = np.round(self.first + self.cell * np.array(spans).reshape(-1, 2), DECIMALS)
        return [(a, b) for a, b in at.tolist()]

    def cells(self, intervals: Sequence[Interval]) -> Spans:
        """Intervals in cells."""
        edges = np.clip(np.round((np.array(intervals) - self.first) / self.cell), 0, self.count)
        return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]

    def left(self, spans: Spans) -> np.ndarray:
        """(3 K,), model error without what the intervals add to it."""
        dead = np.zeros(self.count)
        for a, b in spans:
            dead[a:b] = 1.0
        return self.y - self.columns @ dead

    def fitted(self, left: np.ndarray) -> tuple[np.ndarray, float]:
        """What the nuisance parameters leave over (3 K,), and the cost with their prior penalty."""
        if not self.offset.size:
            return left, float(left @ left)
        right = self.along.T @ left - self.precision @ self.offset
        b = cho_solve(self._information, right)
        over = left - self.along @ b
        last = self.offset + b
        return over, float(over @ over + last @ self.precision @ last)

    @cached_property
    def _information(self) -> tuple[np.ndarray, bool]:
        H = self.along.T @ self.along + self.precision
        return cho_factor(H + RIDGE * np.diag(np.diag(H) + 1.0))

    def cost(self, spans: Spans) -> float:
        """What is minimised; an end beyond the data is no change point."""
        points = sum(1 + (b < self.count) for _, b in spans)
        return self.fitted(self.left(spans))[1] + self.charge * points


def segmented(p: Problem, start: Spans | None = None) -> Spans:
    """The intervals of least cost, from those of a start or from none."""
    best = moved(p, start or [])
    least = p.cost(best)
    whole = np.asarray(p.columns.sum(axis=1)).ravel()
    for _ in range(ROUNDS):
        left = p.left(best)
        # With b held where it is: the error were there no interval, and what it falls by in each window.
        before = p.fitted(left)[0] + p.y - left
        gain = (2.0 * before * whole - whole**2).reshape(-1, 3).sum(axis=1)
        gained = np.bincount(p.bins, gain, int(p.cell * p.count / EVERY))
        bins = programmed(gained, p.charge, p.most)
        found = moved(p, p.cells([(p.first + EVERY * a, p.first + EVERY * b) for a, b in bins]))
        cost = p.cost(found)
        if cost > least - 1e-6:
            break
        best, least = found, cost
    return best


def intervals(p: Problem) -> Spans:
    """The intervals of least cost where the noise is not known: it is what they leave over.

    Args:
        p: in units of force.
    """
    spans: Spans = []
    sigma = np.full(3, np.inf)
    for _ in range(ROUNDS):
        left = p.fitted(p.left(spans))[0].reshape(-1, 3)
        smaller = np.maximum(np.sqrt(np.square(left).mean(axis=0)), FLOOR)
        if (smaller > SETTLED * sigma).all():
            break
        sigma = np.minimum(smaller, sigma)
        spans = segmented(p.weighted(sigma), spans)
    return spans


def programmed(gain: np.ndarray, charge: float, most: int) -> Spans:
    """Intervals of bins that gain the most, less a charge for each change, by dynamic programming.

    Args:
        gain: (B,), of each bin inside an interval.
        charge: of each change point; the end of the data is none.
        most: intervals, at the most.
    """
    states = 2 * most + 1  # number of changes so far: the thruster is dead in those that are odd
    dead = np.arange(states) % 2
    total = np.full(states, np.inf)
    total[0] = 0.0
    changed = np.zeros((gain.size, states), bool)
    for k, g in enumerate(gain.tolist()):
        after = np.concatenate([[np.inf], total[:-1] + charge])
        changed[k] = after < total
        total = np.minimum(after, total) - g * dead
    state, edges = int(np.argmin(total)), []
    if dead[state]:
        edges.append(gain.size)
    for k in range(gain.size - 1, -1, -1):
        if changed[k, state]:
            edges.append(k)
            state -= 1
    edges = edges[::-1]
    return list(zip(edges[::2], edges[1::2], strict=True))


def around(p: Problem, spans: Spans, k: int, size: int) -> Iterator[Spans]:
    """The intervals with an end of the k-th moved, without it, or with it and the next made one."""
    (a, b), before, after = spans[k], spans[:k], spans[k + 1 :]
    low = before[-1][1] if before else 0
    high = after[0][0] if after else p.count
    for step in (-size, size):
        if low <= a + step < b:
            yield [*before, (a + step, b), *after]
        if a < b + step <= high:
            yield [*before, (a, b + step), *after]
    yield before + after
    if after:
        yield [*before, (a, after[0][1]), *after[1:]]


def moved(p: Problem, spans: Spans) -> Spans:
    """Intervals with change points moved one by one while the cost falls."""
    least = p.cost(spans)
    for size in MOVES:
        for _ in range(ROUNDS):
            before = least
            for k in reversed(range(len(spans))):
                if k < len(spans):
                    cost, trial = min((p.cost(trial), trial) for trial in around(p, spans, k, size))
                    if cost < least:
                        least, spans = cost, trial
            if least == before:
                break
    return spans


def likely(p: Problem, spans: Spans) -> list[Interval]:
    """95 % intervals of all change points [s], start and end in turn, each with the others held."""
    least, found = p.cost(spans) + LIKELY, []
    for k, span in enumerate(spans):
        for end in (0, 1):
            reached = []
            for step in (-1, 1):
                place = span[end]
                for _ in range(MOVES[0]):
                    there = [*span]
                    there[end] = place + step
                    trial = [*spans[:k], (there[0], there[1]), *spans[k + 1 :]]
                    fits = 0 <= there[0] < there[1] <= p.count
                    if not fits or p.cost(trial) > least:
                        break
                    place += step
                reached.append(p.first + p.cell * (place + step))
            found.append((reached[0], reached[1]))
    return found


def problem(
    data: Sequence[Integrals],
    model: Model,
    base: np.ndarray,
    e: Effect,
    along: Along | None = None,
) -> Problem | None:
    """The problem of an effect with intervals, in units of force; None: its thruster is never at work.

    Args:
        data: windows of every run.
        model: without the effect.
        base: (K, 3), its model error.
        e: the effect.
        along: columns (K, 3, q), prior precision and offset of nuisance parameters; None: none.
    """
    first = max(0.0, min(float(w.run.time[0]) for w in data))
    last = max(float(w.run.time[-1]) for w in data) + WIDTH
    cell = max(CELL, (last - first) / CELLS)
    count = int(np.ceil((last - first) / cell))
    start, end = e.search.intervals[0]
    dead = model.plus({start: first - model.value(start), end: last - model.value(end)})
    # A force on each axis as one of the model error, by the inertia: rows are axes of the force.
    turned = np.linalg.solve(model.mass, np.eye(3)).T @ model.reference_mass.T
    parts, work = [], np.zeros(count)
    for w in data:
        lost = thrust_along(w, model) - thrust_along(w, dead)
        place = np.clip(((w.run.time - first) / cell + 1e-6).astype(int), 0, count - 1)
        work += np.bincount(place, np.any(lost != 0.0, axis=1), count)
        where = csr_matrix((np.ones(place.size), (np.arange(place.size), place)), (place.size, count))
        force = [w.held @ diags(-axis) @ where for axis in lost.T]
        by_axis = vstack([sum(f * g for f, g in zip(force, gain, strict=True)) for gain in turned.T])
        rows = np.arange(3 * w.middle.size).reshape(3, -1).T.ravel()  # axes of a window together
        parts.append(by_axis.tocsr()[rows])
    columns = csc_matrix(vstack(parts))
    if not columns.count_nonzero():
        return None
    middles = np.concatenate([w.middle for w in data])
    Z, precision, offset = along or (np.zeros((*base.shape, 0)), np.zeros((0, 0)), np.zeros(0))
    return Problem(
        first,
        cell,
        base.ravel(),
        columns,
        count,
        np.maximum((middles - first) / EVERY, 0.0).astype(int),
        Z.reshape(base.size, -1),
        precision,
        offset,
        len(e.search.intervals),
        work / work.sum(),
    )
