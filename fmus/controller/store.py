"""Memory of concurrent learning: which samples are kept, and sums over them, 4.1.3.

A sample is considered where its regressors have moved by ``store_change`` from the last one that was
(line 5 of Algorithms 1 and 2, corrected). The sums are formed anew when the store changes and kept, so
that a step between costs one product with them.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..declare import FIXED, POSITIVE, Range
from ..frames import rotate_to_earth
from ..hull import Triple
from ..ops import Condition, Number, T, choose, fmax, fmin, kernel, put, when, where
from .eigen import dot, exceed, smallest, tridiagonal
from .parametrisation import Parametrisation, Regressors

Grams = tuple[tuple[tuple[Number, ...], ...], ...]  # of each axis, a symmetric matrix

SIZE = 20
NEVER = 1e300


class StoreOptions(NamedTuple):
    """What is stored, and how stored errors are used."""

    store_change: Annotated[float, "1", "change of Phi between stored samples, delta", POSITIVE] = 0.015
    age_limit: Annotated[float, "s", "samples are forgotten after this time; 0: never", POSITIVE] = 0.0
    stale: Annotated[float, "1", "1: errors as they were when stored", FIXED, Range(0.0, 1.0)] = 0.0
    rank_tolerance: Annotated[float, "1", "singular values above this count for the rank", POSITIVE] = (
        0.01
    )
    # Footnote 1 of 4.1.4 prints 0.1, for stale errors. With errors formed anew 1 learns faster.
    store_weight: Annotated[float, "1", "weight of the sum over the store, rho", POSITIVE] = 1.0


class StoredSample(NamedTuple):
    """A stored sample; ``target`` is y, or eps as it was with ``stale`` = 1."""

    filled: Number
    time: Number
    psi: Number
    target: Triple
    F: Regressors


class Sums(NamedTuple):
    """Over all rows: count, smallest eigenvalue of sum F^T F, times of the oldest and the newest row,
    sum F^T target, f f^T of each axis, sum R target, and sum F^T R^T (zero while omega_n is off)."""

    count: Any
    least: Number
    oldest: Number
    newest: Number
    projected: tuple[Number, ...]
    grams: Grams
    turned: Triple
    cross: tuple[Triple, ...]


class Store(NamedTuple):
    rows: tuple[StoredSample, ...]
    last: Regressors
    sums: Sums


# (model, rows, sums over them, new row) -> rows
Storage = Callable[
    [Parametrisation, tuple[StoredSample, ...], Sums, StoredSample], tuple[StoredSample, ...]
]


def window(
    model: Parametrisation, rows: tuple[StoredSample, ...], sums: Sums, row: StoredSample
) -> tuple[StoredSample, ...]:
    """Algorithm 1: a queue."""
    return (row, *rows[:-1])


def singular(
    model: Parametrisation, rows: tuple[StoredSample, ...], sums: Sums, row: StoredSample
) -> tuple[StoredSample, ...]:
    """Algorithm 2, corrected: fill up, then exchange the row that raises the smallest singular value of
    the stacked regressors most, on strict increase."""
    free: Number = -1.0
    for k in reversed(range(SIZE)):
        free = where(rows[k].filled < 0.5, float(k), free)
    return when(
        free >= 0.0,
        lambda: put(rows, free, row),
        lambda: put(rows, _worst(model, rows, sums, row), row),
    )


def _worst(
    model: Parametrisation, rows: tuple[StoredSample, ...], sums: Sums, row: StoredSample
) -> Number:
    """Index of the row to exchange, -1 if none; an eigenvalue is only sought where it beats the best."""
    best, index = sums.least, -1.0
    gained = _added(sums.grams, row.F, 1.0)
    for k, old in enumerate(rows):
        matrices = [tridiagonal(m) for m in model.matrices(_added(gained, old.F, -1.0))]
        value = when(
            exceed(matrices, best),
            lambda matrices=matrices, best=best: smallest(matrices, best),
            lambda best=best: best,
        )
        index = where(value > best, float(k), index)
        best = value
    return index


def _added(grams: Grams, F: Regressors, sign: float) -> Grams:
    """The information of each axis with that of a sample added or taken away."""
    return _plus(grams, [[[sign * a * b for b in f] for a in f] for f in F])


def empty_row(F: Regressors) -> StoredSample:
    return StoredSample(0.0, 0.0, 0.0, (0.0, 0.0, 0.0), tuple([tuple([0.0] * len(f)) for f in F]))  # pyright: ignore


def empty_store(model: Parametrisation) -> Store:
    F: Any = tuple([tuple([0.0] * len(indices)) for indices in model.pattern])
    rows = (empty_row(F),) * SIZE
    return Store(rows, F, summed(False, rows, model))


@kernel
def summed(omega_on: Condition, rows: tuple[StoredSample, ...], model: Parametrisation) -> Sums:
    """All sums anew; an empty row is zero and adds nothing."""
    count, oldest, newest = 0.0, NEVER, 0.0
    projected: tuple[Number, ...] = (0.0,) * len(model.coefficients)
    for row in rows:
        count = count + row.filled
        oldest = fmin(oldest, where(row.filled > 0.5, row.time, NEVER))
        newest = fmax(newest, row.time)
        projected = plus(projected, model.project(row.F, row.target))
    grams = tuple([_gram([row.F[axis] for row in rows]) for axis in range(3)])
    least = smallest([tridiagonal(m) for m in model.matrices(grams)])
    cross: tuple[Triple, ...] = ((0.0, 0.0, 0.0),) * len(model.coefficients)
    turned, cross = when(
        omega_on,
        lambda: _earth_fixed(model, rows),
        lambda: ((0.0, 0.0, 0.0), cross),
    )
    return Sums(count, fmax(least, 0.0), oldest, newest, projected, grams, turned, cross)


def plus(a: T, b: T) -> T:
    """A nested tuple of numbers plus others in the same shape."""
    return _plus(a, b)


def _plus(a: Any, b: Any) -> Any:
    if isinstance(a, tuple):
        return tuple([_plus(x, y) for x, y in zip(a, b, strict=True)])
    return a + b


def times(factor: Number, a: T) -> T:
    """A nested tuple of numbers times a factor, in its own classes."""
    return _times(factor, a)


def _times(factor: Number, a: Any) -> Any:
    if not isinstance(a, tuple):
        return factor * a
    items = [_times(factor, x) for x in a]
    return type(a)._make(items) if hasattr(a, "_make") else tuple(items)  # pyright: ignore


def _gram(samples: list[tuple[Number, ...]]) -> tuple[tuple[Number, ...], ...]:
    """Sum of f f^T, symmetric."""
    columns = list(zip(*samples, strict=True))
    half = [[dot(a, columns[j]) for j in range(i + 1)] for i, a in enumerate(columns)]
    size = range(len(columns))
    return tuple([tuple([half[max(i, j)][min(i, j)] for j in size]) for i in size])


def _earth_fixed(
    model: Parametrisation, rows: tuple[StoredSample, ...]
) -> tuple[Triple, tuple[Triple, ...]]:
    """Sum of R target, and sum of F^T R^T."""
    turned: Triple = (0.0, 0.0, 0.0)
    cross: tuple[Triple, ...] = ((0.0, 0.0, 0.0),) * len(model.coefficients)
    for row in rows:
        X, Y, N = row.target
        turned = plus(turned, (*rotate_to_earth(row.psi, X, Y), N))
        cross = plus(cross, model.turned(row.F, row.psi))
    return turned, cross


def moved(F: Regressors, last: Regressors, change: Number) -> Condition:
    """True where the regressors differ by at least ``change`` in the Frobenius norm."""
    square = 0.0
    for a, b in zip(F, last, strict=True):
        for x, y in zip(a, b, strict=True):
            square = square + (x - y) * (x - y)
    return square >= change * change


def offer(
    model: Parametrisation,
    storage: Storage,
    store: Store,
    row: StoredSample,
    usable: Condition,
    now: Number,
    p: StoreOptions,
    omega_on: Condition,
) -> Store:
    """The store after a step.

    Args:
        model: what is learned.
        storage: how a sample finds its place.
        store: before.
        row: the sample of this step.
        usable: False where it must not be stored.
        now: time [s] that ages are counted from.
        p: options.
        omega_on: True where an earth-fixed force is learned.
    """
    considered = usable & moved(row.F, store.last, p.store_change)
    expired = (p.age_limit > 0.0) & (now - store.sums.oldest > p.age_limit)

    def revised() -> Store:
        nothing = empty_row(row.F)
        kept = tuple(
            [choose((p.age_limit > 0.0) & (now - r.time > p.age_limit), nothing, r) for r in store.rows]
        )
        rows = when(considered, lambda: storage(model, kept, store.sums, row), lambda: kept)
        last = choose(considered, row.F, store.last)
        return Store(rows, last, summed(omega_on, rows, model))

    return when(considered | expired, revised, lambda: store)
