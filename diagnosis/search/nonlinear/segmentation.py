"""When a thruster gave nothing: penalised segmentation of the model error over time.

With y the model error in units of the noise and c_j what it would be less were the thruster dead during
the cell j of time, the intervals minimise

    min over b of |y - sum_j d_j c_j - Z b|^2 + (o + b)^T Q (o + b)  +  log n for each change point,

d_j being 1 inside of them and 0 elsewhere, and Z, Q, o the nuisance parameters as in
:mod:`.map_regression`. log n is the charge of the Bayesian information criterion for a parameter: of
some n places chance finds one at which the sum falls by 2 log n, no more for an interval's two ends.

With b held and windows taken as independent, dynamic programming gives the least sum (Auger and Lawrence
1989; with a charge for each change Killick, Fearnhead and Eckley 2012). Then b is fitted, and so on; at
the end the change points are moved one by one while the exact sum falls, at last by parts of a cell.

Each run has intervals of its own: its cells follow those of the run before, and no interval lies in two.
"""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.sparse import block_diag, csc_matrix, csr_matrix, diags, vstack

from fmus.effects import Effect
from fmus.scale import Scale

from ...predictors import Model, WeakWindows
from ...predictors.ship_model import of_run
from ...predictors.uncertainty import FLOOR
from ...predictors.weak_form import EVERY, OVERLAP, WIDTH, thrust_along
from ...runs.cleaning import BRIEF, Z95
from ...runs.run_constants import DIGITS, STEPS
from ..most_likely import ENOUGH, ridge
from .interval_sums import IntervalSums

Interval = tuple[float, float]
NuisanceParts = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]
Spans = list[tuple[float, float]]  # intervals in cells, the second end not included


class RunCells(NamedTuple):
    """The cells of one run.

    Attributes:
        run: its name.
        first: time at which the cells begin [s].
        start, end: the first cell, and that after the last.
        names: start and end of each interval that it may have; of one that lasts the end is empty.
    """

    run: str
    first: float
    start: int
    end: int
    names: Sequence[tuple[str, str]]


@dataclass(frozen=True, eq=False)
class SegmentationProblem:
    """A model error that intervals without thrust may explain.

    Attributes:
        sections: of the runs.
        lasting: whether an interval has no end but that of its run.
        cell: how long each cell is [s], by which change points move at the least: a few samples.
        y: (3 K,), model error.
        columns: (3 K, m), what each cell of a dead thruster adds to it.
        middles: (K,), cell, and part of it, in which the middle of each window lies.
        nuisance: (3 K, q), nuisance parameters; all three in units of the noise, or of force.
        precision, offset, unit: (q, q), (q,) and (q,), of the nuisance parameters.
        work: (m,), share of the run's time in which the thruster is commanded, in each cell.
        scale: of the ship.
    """

    sections: Sequence[RunCells]
    lasting: bool
    cell: float
    y: np.ndarray
    columns: csc_matrix
    middles: np.ndarray
    nuisance: np.ndarray
    precision: np.ndarray
    offset: np.ndarray
    unit: np.ndarray
    work: np.ndarray
    scale: Scale

    def passing(self, spans: Spans) -> bool:
        """Whether in each run the thruster works for at least half of the time of its commands.

        What is so most of the time is no failure, but the rule, such as a dead band of small commands.
        """
        dead: dict[str, float] = defaultdict(float)
        for a, b in spans:
            dead[self.section(a).run] += float(self.dead([(a, b)]) @ self.work)
        return self.lasting or all(2.0 * share <= 1.0 for share in dead.values())

    def without_end(self, spans: Spans) -> bool:
        """Whether there is one interval in each run at the most, and it lasts to the end of the run."""
        runs = [self.section(a).run for a, _ in spans]
        return len(set(runs)) == len(runs) and all(b == self.section(a).end for a, b in spans)

    def section(self, cell: float) -> RunCells:
        """The section that a cell lies in."""
        return next(s for s in self.sections if cell < s.end)

    @property
    def moves(self) -> list[int]:
        """Cells by which change points are moved: a window's width, the distance of windows, one."""
        return [round(step * self.scale.time / self.cell) for step in (WIDTH, EVERY)] + [1]

    @property
    def charge(self) -> float:
        """Of each change point."""
        return float(np.log(self.y.size / OVERLAP))

    def weighted(self, sigma: np.ndarray) -> "SegmentationProblem":
        """The same in units of the noise sigma (3,)."""
        weight = np.tile(1.0 / sigma / np.sqrt(OVERLAP), self.y.size // 3)
        columns = csc_matrix(diags(weight) @ self.columns)
        nuisance = weight[:, None] * self.nuisance
        return replace(self, y=weight * self.y, columns=columns, nuisance=nuisance)

    def keys(self, spans: Spans) -> list[tuple[str, str]]:
        """Names of the values that are start and end of each interval; of an end that is none: empty."""
        used: Counter[str] = Counter()
        found = []
        for a, _ in spans:
            s = self.section(a)
            start, end = s.names[used[s.run]]
            found.append((of_run(start, s.run), end and of_run(end, s.run)))
            used[s.run] += 1
        return found

    def seconds(self, s: RunCells, cell: float) -> float:
        """Time [s] in a run; where 0 would mean that an effect never begins, a cell later."""
        time = float(f"{s.first + self.cell * (cell - s.start):f}")  # so that it reads as it was meant
        return max(time, self.cell) if self.lasting else time

    def values(self, spans: Spans) -> dict[str, float]:
        """Intervals as values [s] of the effect's parameters, each in its run."""
        return {
            key: self.seconds(self.section(span[0]), cell)
            for span, pair in zip(spans, self.keys(spans), strict=True)
            for cell, key in zip(span, pair, strict=True)
            if key
        }

    def spans(self, values: Mapping[str, float]) -> Spans:
        """The intervals among the values [s] of the effect's parameters."""
        found = []
        for s in self.sections:
            for start, end in ((of_run(a, s.run), of_run(b, s.run)) for a, b in s.names):
                if start in values:
                    times = values[start], values.get(end, np.inf)
                    a, b = (min((t - s.first) / self.cell, s.end - s.start) for t in times)
                    found.append((s.start + max(a, 0.0), s.start + b))
        return found

    def dead(self, spans: Spans) -> np.ndarray:
        """(m,), the part of each cell that lies in the intervals."""
        found, cells = np.zeros(self.work.size), np.arange(self.work.size)
        for a, b in spans:
            found += np.clip(np.minimum(b, cells + 1.0) - np.maximum(a, cells), 0.0, 1.0)
        return found

    def left(self, spans: Spans) -> np.ndarray:
        """(3 K,), model error without what the intervals add to it."""
        return self.y - self.columns @ self.dead(spans)

    def fitted(self, left: np.ndarray) -> np.ndarray:
        """What the nuisance parameters leave over (3 K,)."""
        if not self.offset.size:
            return left
        return left - self.nuisance @ self._likeliest(self.nuisance.T @ left)

    def _likeliest(self, along: np.ndarray) -> np.ndarray:
        """b (q,), by the products (q,) of Z with what is left of the model error."""
        return cho_solve(self._information, along - self.precision @ self.offset)

    @cached_property
    def _gram(self) -> np.ndarray:
        """(q, q), of the nuisance parameters, without their prior."""
        return np.asarray(self.nuisance.T @ self.nuisance)

    @cached_property
    def _information(self) -> tuple[np.ndarray, bool]:
        H = self._gram + self.precision
        return cho_factor(H + ridge(H, self.unit))

    @cached_property
    def _sums(self) -> IntervalSums:
        """Of what intervals add to the model error, with its products (q + 1, m) with Z and y."""
        return IntervalSums(self.columns, np.vstack([self.nuisance.T, self.y]) @ self.columns)

    @cached_property
    def _whole(self) -> tuple[np.ndarray, float]:
        """Of the model error without intervals: its products (q,) with Z, and its sum of squares."""
        return self.nuisance.T @ self.y, float(self.y @ self.y)

    def cost(self, spans: Spans) -> float:
        """What is minimised; an end beyond the data of a run is no change point."""
        points = sum(1 + (b < self.section(a).end) for a, b in spans)
        if (cells := whole_cells(spans)) == spans:
            (along, whole), given = self._whole, self._sums.linear(cells)
            along = along - given[:-1]
            square = whole - 2.0 * given[-1] + self._sums.square(cells)
        else:
            left = self.left(spans)
            along, square = self.nuisance.T @ left, left @ left
        cost = float(square) + self.charge * points
        if not self.offset.size:
            return cost
        b = self._likeliest(along)
        last = self.offset + b
        return cost - float(2.0 * b @ along - b @ self._gram @ b - last @ self.precision @ last)


def whole_cells(spans: Spans) -> list[tuple[int, int]]:
    """The intervals with change points at the nearest ends of cells."""
    return [(round(a), round(b)) for a, b in spans]


def segmented(p: SegmentationProblem, start: Spans | None = None) -> Spans:
    """The intervals of least cost, from those of a start or from none."""
    best = moved(p, [*whole_cells(start or [])])
    least = p.cost(best)
    whole = np.asarray(p.columns.sum(axis=1)).ravel()
    for _ in range(STEPS):
        left = p.left(best)
        # With b held where it is: the error were there no interval, and what it falls by in each window.
        before = p.fitted(left) + p.y - left
        gain = (2.0 * before * whole - whole**2).reshape(-1, 3).sum(axis=1)
        found = moved(p, [span for s in p.sections for span in programmed_in(p, s, gain)])
        cost = p.cost(found)
        if cost > least - ENOUGH:
            break
        best, least = found, cost
    return sharpened(p, best)


def sharpened(p: SegmentationProblem, spans: Spans) -> Spans:
    """Intervals with change points moved within the cells beside them, where that lowers the cost."""
    for _ in range(STEPS):  # those of one interval may depend on each other
        before = spans
        for k, pair in enumerate(spans):
            section = p.section(pair[0])
            for side, place in enumerate(pair):
                if place not in (section.start, section.end):
                    spans = _sharpened(p, spans, k, side)
        if p.cost(before) - p.cost(spans) < ENOUGH:
            break
    return spans


def _sharpened(p: SegmentationProblem, spans: Spans, k: int, side: int) -> Spans:
    """Intervals with one change point where a parabola is least: within a cell the cost is one."""

    def moved_to(x: float) -> Spans:
        a, b = spans[k]
        return [*spans[:k], (a, x) if side else (x, b), *spans[k + 1 :]]

    place, trials = spans[k][side], [spans]
    for low in (np.ceil(place) - 1.0, np.floor(place)):
        first, middle, last = (p.cost(moved_to(low + part)) for part in (0.0, 0.5, 1.0))
        bent = first - 2.0 * middle + last
        if bent > 0.0:
            least = low + min(max(0.5 + 0.25 * (first - last) / bent, 0.0), 1.0)
            trials.append(moved_to(float(least)))
    return min((t for t in trials if t[k][0] < t[k][1]), key=p.cost)


def programmed_in(p: SegmentationProblem, s: RunCells, gain: np.ndarray) -> Iterator[tuple[int, int]]:
    """The intervals of one run that gain the most, by what each window (K,) gains inside of one."""
    size = EVERY * p.scale.time / p.cell  # cells in a bin
    inside = (p.middles >= s.start) & (p.middles < s.end)
    place = ((p.middles[inside] - s.start) / size + 1e-6).astype(int)
    gained = np.bincount(place, gain[inside], int((s.end - s.start) / size))
    for a, b in programmed(gained, p.charge, len(s.names), p.lasting):
        yield s.start + round(a * size), s.end if b == gained.size else s.start + round(b * size)


def intervals(p: SegmentationProblem) -> Spans:
    """The intervals of least cost where the noise is not known: it is what they leave over.

    Args:
        p: in units of force.
    """
    spans: Spans = []
    for _ in range(STEPS):
        left = p.fitted(p.left(spans)).reshape(-1, 3)
        sigma = np.maximum(np.sqrt(np.square(left).mean(axis=0)), FLOOR * p.scale.forces)
        before, spans = spans, segmented(p.weighted(sigma), spans)
        if whole_cells(spans) == whole_cells(before):
            break
    return spans


def programmed(gain: np.ndarray, charge: float, most: int, lasting: bool) -> Spans:
    """Intervals of bins that gain (B,) the most, less a charge for each change, by dynamic programming.

    There are so many at the most. The end of the data is no change; those that last have no other end.
    """
    # A state is the number of changes so far: the thruster is dead in those that are odd.
    states = 1 + most * (2 - lasting)
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


def around(p: SegmentationProblem, spans: Spans, k: int, size: int) -> Iterator[Spans]:
    """The intervals with an end of the k-th moved, without it, or with it and the next made one."""
    (a, b), before, after = spans[k], spans[:k], spans[k + 1 :]
    section = p.section(a)
    low = max(section.start, before[-1][1] if before else 0)
    high = min(section.end, after[0][0] if after else section.end)
    for step in (-size, size):
        if low <= a + step < b:
            yield [*before, (a + step, b), *after]
        if a < b + step <= high and not p.lasting:
            yield [*before, (a, b + step), *after]
    yield before + after
    if after and after[0][1] <= section.end:
        yield [*before, (a, after[0][1]), *after[1:]]


def moved(p: SegmentationProblem, spans: Spans) -> Spans:
    """Intervals with change points moved one by one while the cost falls."""
    least = p.cost(spans)
    for size in p.moves:
        for _ in range(STEPS):
            before = least
            for k in reversed(range(len(spans))):
                if k < len(spans):
                    cost, trial = min((p.cost(trial), trial) for trial in around(p, spans, k, size))
                    if cost < least:
                        least, spans = cost, trial
            if least == before:
                break
    return spans


def likely(p: SegmentationProblem, spans: Spans) -> dict[str, Interval]:
    """95 % intervals of all change points [s] by their names, each with the others held."""
    least, found = p.cost(spans) + Z95**2, {}
    for k, (span, pair) in enumerate(zip(spans, p.keys(spans), strict=True)):
        section = p.section(span[0])
        for end, key in enumerate(pair):
            reached = []
            for step in (-1, 1) if key else ():
                there = [*span]
                for _ in range(p.moves[0]):
                    there[end] += step
                    a, b = there
                    inside = section.start <= a < b <= section.end
                    if not inside or p.cost([*spans[:k], (a, b), *spans[k + 1 :]]) > least:
                        break
                reached.append(p.seconds(section, there[end]))
            if key:
                found[key] = (reached[0], reached[1])
    return found


def problem(
    data: Sequence[WeakWindows],
    model: Model,
    base: np.ndarray,
    e: Effect,
    nuisance: NuisanceParts | None = None,
) -> SegmentationProblem | None:
    """The problem of an effect with intervals, in units of force; None: its thruster is never at work.

    Args:
        data: windows of every run.
        model, base: without the effect, and its model error (K, 3).
        e: the effect.
        nuisance: columns (K, 3, q), prior precision, offset and unit of nuisance parameters; None: none.
    """
    ends = [(max(0.0, float(w.run.time[0])), float(w.run.time[-1]) + w.width) for w in data]
    scale = model.ship.scale
    cell = BRIEF * scale.time  # by which change points move: a fifth of the distance of windows
    counts = [int(np.ceil((last - first) / cell)) for first, last in ends]
    # A force on each axis as one of the model error, by the inertia: rows are axes of the force.
    turned = np.linalg.solve(model.mass, np.eye(3)).T @ model.reference_mass.T
    sections: list[RunCells] = []
    parts, work, middles = [], [], []
    for w, (first, last), count in zip(data, ends, counts, strict=True):
        whole = dict(zip(e.search.intervals[0], (max(first, cell), last), strict=True))
        named = {of_run(n, w.run.name): time for n, time in whole.items() if n}
        dead = model.plus({n: time - model.value(n) for n, time in named.items()})
        lost = thrust_along(w, model) - thrust_along(w, dead)
        where = shares_of_rows((w.run.time - first) / cell, count)
        worked = where.T @ np.any(lost != 0.0, axis=1)
        work.append(worked / max(worked.sum(), 1.0))
        force = [w.held @ diags(-axis) @ where for axis in lost.T]
        by_axis = vstack([sum(f * g for f, g in zip(force, gain, strict=True)) for gain in turned.T])
        rows = np.arange(3 * w.middle.size).reshape(3, -1).T.ravel()  # axes of a window together
        parts.append(by_axis.tocsr()[rows])
        start = sections[-1].end if sections else 0
        free = [pair for pair in e.search.intervals if not any(_set(model, n, w) for n in pair)]
        sections.append(RunCells(w.run.name, first, start, start + count, free))
        middles.append(start + np.clip((w.middle - first) / cell, 0.0, count - 1e-6))
    columns = csc_matrix(block_diag(parts))
    if not columns.count_nonzero():
        return None
    none = np.zeros((*base.shape, 0)), np.zeros((0, 0)), np.zeros(0), np.zeros(0)
    Z, precision, offset, unit = nuisance or none
    lasting, middle = not e.search.intervals[0][1], np.concatenate(middles)
    y, Z, time = base.ravel(), Z.reshape(base.size, -1), np.concatenate(work)
    parts = sections, lasting, cell, y, columns, middle, Z, precision, offset, unit, time, scale
    return SegmentationProblem(*parts)


def shares_of_rows(place: np.ndarray, count: int) -> csr_matrix:
    """(n, count), share of the time from each row to the next that lies in each cell.

    Args:
        place: (n,), of the rows in cells; what is before the first cell or after the last counts there.
        count: of the cells.
    """
    ends = np.append(place, place[-1] + np.median(np.diff(place)))
    first = np.floor(ends[:-1] + DIGITS).astype(int)
    many = np.maximum(np.ceil(ends[1:] - DIGITS).astype(int) - first, 1)
    row = np.repeat(np.arange(place.size), many)
    cell = first[row] + np.arange(row.size) - np.repeat(np.cumsum(many) - many, many)
    inside = np.minimum(ends[row + 1], cell + 1.0) - np.maximum(ends[row], cell)
    parts = inside / np.diff(ends)[row]
    return csr_matrix((parts, (row, np.clip(cell, 0, count - 1))), (place.size, count))


def _set(model: Model, name: str, w: WeakWindows) -> bool:
    """Whether a model has a value of a parameter in a run."""
    return bool(name) and model.value(of_run(name, w.run.name)) != model.declared(name).start
