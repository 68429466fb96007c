"""A model near the best: effects and nominal coefficients moved together by Gauss-Newton steps.

The slopes by the nominal coefficients hardly change on the way and are taken once; those of an effect
are taken anew at each step.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from fmus.declare import Variable
from fmus.effects import EFFECTS

from .library import NOMINAL, Shape, beliefs, evaluate, moments_apart
from .model import Model
from .ranking import RIDGE
from .table import OVERLAP, Doubt
from .weak import Integrals

ROUNDS = 5
SMALL = 1e-3
ENOUGH = 0.05  # of cost, below which no further step is taken
# A moment cannot be refined by slopes: it is searched around, with these steps [s].
MOMENT = "bow_failure_time"
MOMENT_STEPS = (1.0, 0.2)
LIKELY = 3.84  # of cost, above the least: what 95 % of the time is less
DECLARED: dict[str, Variable] = {p.name: p for e in EFFECTS.values() for p in e.parameters}


@dataclass(frozen=True, eq=False)
class Problem:
    """What a model is fitted to.

    Attributes:
        data: windows of every run.
        blocks: (K,), number of the block of each window.
        sigma: (3,), noise of each axis [N, N, N m]; None as long as it is not known.
        prior: relative standard deviation believed of every nominal coefficient.
    """

    data: Sequence[Integrals]
    blocks: np.ndarray
    sigma: np.ndarray | None
    prior: float

    @property
    def weight(self) -> np.ndarray:
        """(3,), what an error counts on each axis."""
        return 1.0 / np.asarray(self.sigma) / np.sqrt(OVERLAP)


@dataclass(frozen=True, eq=False)
class Point:
    """A model on the way, and how far it is from the one that is believed.

    Attributes:
        start: the model that the user gave.
        values: parameters of the effects that were found, as additions.
        moved: nominal coefficients, each in standard deviations of what is believed of it.
        stiff: how unlikely the values are by themselves, a quadratic form.
    """

    start: Model
    values: Mapping[str, float] = field(default_factory=dict)
    moved: np.ndarray = field(default_factory=lambda: np.zeros(len(NOMINAL)))
    stiff: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))

    def model(self, prior: float) -> Model:
        """The model with all of it."""
        return self.start.plus(self.values).plus(shifts(self.moved, prior))

    @property
    def fitted(self) -> list[str]:
        """Those values that are fitted by slopes."""
        return [n for n in self.values if n != MOMENT]

    def plus(self, values: Mapping[str, float], moved: np.ndarray) -> "Point":
        """The point further on."""
        together = {n: self.values.get(n, 0.0) + values.get(n, 0.0) for n in (*self.values, *values)}
        within = {n: bounded(n, v) for n, v in together.items()}
        return Point(self.start, within, self.moved + moved, self.stiff)


def shifts(moved: np.ndarray, prior: float) -> dict[str, float]:
    """Nominal coefficients' additions, in SI."""
    return {
        name: std * float(k)
        for (name, std), k in zip(beliefs(prior).items(), moved, strict=True)
        if k != 0.0
    }


def bounded(name: str, value: float) -> float:
    """A parameter of an effect within its range."""
    limits = DECLARED[name].range if name in DECLARED else None
    if limits is None:
        return value
    low, high = limits.min, limits.max
    return min(max(value, -np.inf if low is None else low), np.inf if high is None else high)


def slope(p: Problem, model: Model, left: np.ndarray, name: str, scale: float) -> np.ndarray:
    """Force (K, 3) that the model gains by one unit of a parameter."""
    small = SMALL * max(abs(scale), 1e-2)
    return (left - evaluate(p.data, model.plus({name: small}))) / small


def doubts(p: Problem, at: Point, base: np.ndarray) -> Doubt:
    """What is fitted along with every candidate: found effects freely, nominal coefficients in doubt.

    Args:
        at: the model so far.
        base: its model error (K, 3).
    """
    model = at.model(p.prior)
    own = at.fitted
    columns = [slope(p, model, base, n, at.values[n]) for n in own]
    for n, std in beliefs(p.prior).items():
        columns.append(std * slope(p, model, base, n, NOMINAL[n]) if std else np.zeros_like(base))
    stiff = np.asarray(block_diag(at.stiff, np.eye(len(NOMINAL))))
    moved = np.array([*[at.values[n] for n in own], *at.moved])
    return Doubt(np.stack(columns, axis=2), stiff, moved)


@dataclass(frozen=True, eq=False)
class Start:
    """A candidate's parameters to start from.

    Attributes:
        values: parameter -> value.
        live: those that may move.
        stiff: how unlikely these are by themselves, a quadratic form.
    """

    values: Mapping[str, float]
    live: Sequence[str]
    stiff: np.ndarray


@dataclass(frozen=True, eq=False)
class Refined:
    """A candidate at its best.

    Attributes:
        point: the model with it.
        left: (K, 3), its model error.
        columns: (K, 3, p), slopes by the parameters that were fitted.
        cost: loss and unlikeliness together.
        span: 95 % interval of a moment [s]; None without one.
    """

    point: Point
    left: np.ndarray
    columns: np.ndarray
    cost: float
    span: tuple[float, float] | None = None


def refine(p: Problem, at: Point, doubt: Doubt, begin: Start) -> Refined:
    """Move an effect, the effects found before and the nominal coefficients to their best.

    Args:
        p: what is fitted.
        at: the model so far.
        doubt: what is fitted along, from :func:`doubts`.
        begin: the new effect.
    """
    own = at.fitted
    moving = [*begin.live, *own]
    stiff = np.asarray(block_diag(begin.stiff, doubt.stiff))
    weight = p.weight

    def measure(point: Point) -> Refined:
        model = point.model(p.prior)
        left = evaluate(p.data, model)
        columns = [slope(p, model, left, n, point.values[n]) for n in begin.live]
        stacked = np.stack(columns, axis=2) if columns else np.zeros((*left.shape, 0))
        m = where(point)
        cost = float(((left * weight) ** 2).sum() + m @ stiff @ m)
        return Refined(point, left, stacked, cost)

    def where(point: Point) -> np.ndarray:
        return np.array([*[point.values[n] for n in moving], *point.moved])

    best = measure(at.plus(begin.values, np.zeros(len(NOMINAL))))
    for _ in range(ROUNDS):
        columns = np.concatenate([best.columns, doubt.columns], axis=2)
        A = np.moveaxis(columns * weight[:, None], 2, 0).reshape(columns.shape[2], -1).T
        H = A.T @ A + stiff
        H += RIDGE * np.diag(np.diag(H) + 1.0)
        right = A.T @ (best.left * weight).reshape(-1) - stiff @ where(best.point)
        delta = np.linalg.solve(H, right)
        for share in (1.0, 0.5, 0.25):
            step = dict(zip(moving, (share * delta).tolist(), strict=False))
            further = measure(best.point.plus(step, share * delta[len(moving) :]))
            if further.cost < best.cost:
                break
        gained = best.cost - further.cost
        if gained > 0.0:
            best = further
        if gained < ENOUGH:
            break
    return best


def moment(p: Problem, at: Point, doubt: Doubt, begin: Start) -> Refined:
    """The failure's time, searched around a first guess [s]."""

    def best(of: Sequence[Refined]) -> Refined:
        return min(of, key=lambda r: r.cost)

    def tried(time: float) -> Refined:
        return refine(p, at, doubt, replace(begin, values={MOMENT: max(time, MOMENT_STEPS[-1])}))

    all_tried = [tried(begin.values[MOMENT])]
    coarse = moments_apart(p.data) / 5.0
    for size in (coarse, *MOMENT_STEPS) if coarse > MOMENT_STEPS[0] else MOMENT_STEPS:
        middle = best(all_tried).point.values[MOMENT]
        all_tried += [tried(middle + k * size) for k in range(-5, 6)]
    found = best(all_tried)
    likely = [r.point.values[MOMENT] for r in all_tried if r.cost < found.cost + LIKELY]
    reach = MOMENT_STEPS[-1]
    return replace(found, span=(min(likely) - reach, max(likely) + reach))


def polished(p: Problem, at: Point, doubt: Doubt, begin: Start) -> Refined:
    """A candidate at its best, from the parameters of its linear fit."""
    return (moment if MOMENT in begin.values else refine)(p, at, doubt, begin)


def settled(r: Refined, base: np.ndarray, at: Point, begin: Start) -> Shape:
    """A refined candidate as a shape of the library, seen from the model ``at`` with error ``base``."""
    given = {n: v for n, v in r.point.values.items() if n not in at.values}
    own = [r.point.values[n] for n in at.fitted]
    moved = np.array([*own, *r.point.moved])
    return Shape(given, list(begin.live), base - r.left, r.columns, moved, begin.stiff)
