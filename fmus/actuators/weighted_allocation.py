"""Allocation: commands of a ship's actuators that give a force, and what they can give."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

from ..declare import Fields
from ..hull import Triple
from ..ops import Number, clip, where
from ..ship_description import Description
from .actuation import actuators, flow_at, law_of, ordered, within
from .actuator import Actuator
from .law import Flow

PASSES = 2  # of the allocation: what the first one clips is asked of the others
TINY = 1e-9  # share by which a matrix that has no inverse gets one
NOTHING = 1e-30  # N2, in place of zero where no actuator can push


class ForceComponent(NamedTuple):
    """A force that an actuator can be asked for: whose it is, and along which axis of the ship."""

    actuator: Actuator
    along: str


@cache
def components(ship: Description) -> tuple[ForceComponent, ...]:
    """The forces that a ship's actuators can be asked for."""
    return tuple([ForceComponent(a, axis) for a in actuators(ship) for axis in a.law.components])


@cache
def axes(ship: Description) -> tuple[int, ...]:
    """The axes of tau (0: X, 1: Y, 2: N) that a ship can be asked for.

    An axis that comes with others, as sway does with the turn of a single rudder, is left out.
    """
    columns = [
        _column(c, c.actuator.part.number("x"), c.actuator.part.number("y")) for c in components(ship)
    ]
    found: list[int] = []
    apart: list[list[float]] = []  # rows of the axes found, each without its part along those before
    for k in (0, 2, 1):
        row = rest = [float(column[k]) for column in columns]
        for other in apart:
            share = _dot(rest, other) / _dot(other, other)
            rest = [x - share * y for x, y in zip(rest, other, strict=True)]
        if _dot(rest, rest) > TINY * _dot(row, row):
            found.append(k)
            apart.append(rest)
    return tuple(sorted(found))


def _dot(a: Sequence[float], b: Sequence[float]) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _column(c: ForceComponent, x: Number, y: Number) -> Triple:
    """tau [N, N, N m] of one newton along a component."""
    return (1.0, 0.0, -y) if c.along == "X" else (0.0, 1.0, x)


def allocate(
    ship: Description, tau: Sequence[Number], nu: Triple, values: Sequence[Fields], apart: bool = False
) -> tuple[Number, ...]:
    """Commands that give a force as nearly as the actuators can, within limits.

    As many components of forces as axes follow exactly, and are clipped to their limits. More of them
    are found by weighted least squares: each is weighed by what its actuator can give, and what a limit
    cuts off is asked of the others (redistributed pseudo-inverse: Johansen and Fossen 2013, Automatica
    49, section 2.2). An axis that the ship cannot give is not asked for.

    Args:
        ship: its actuators.
        tau: force to give [N, N, N m].
        nu: u, v, r [m/s, m/s, rad/s], by which a rudder's force goes.
        values: parameters of each actuator in the controller's model.
        apart: whether each unit has commands of its own, which are alike then.

    Returns:
        The commands, within their limits.
    """
    asked, parts = axes(ship), components(ship)
    every = [law_of(a, own) for a, own in zip(actuators(ship), values, strict=True)]
    columns, spans = [], []
    for c in parts:
        p, x, y = every[c.actuator.k]
        column = _column(c, x, y)
        columns.append([column[k] for k in asked])
        low, high = c.actuator.law.reach(flow_at(*nu, x, y), p)[c.actuator.law.components.index(c.along)]
        count = _units(c.actuator, apart)
        spans.append((count * low, count * high) if count > 1 else (low, high))
    wanted = [tau[k] for k in asked]
    if len(parts) == len(asked):
        exact = _eliminated([[*row] for row in zip(*columns, strict=True)], wanted, _order(ship))
        found = [clip(f, low, high) for f, (low, high) in zip(exact, spans, strict=True)]
    else:
        found = _shared(columns, spans, wanted)
    commands: list[Number] = []
    for a in ordered(ship):
        p, x, y = every[a.k]
        count = _units(a, apart)
        own = tuple(
            [f / count if count > 1 else f for f, c in zip(found, parts, strict=True) if c.actuator is a]
        )
        if own:
            given = a.law.commanded(own, flow_at(*nu, x, y), p)
        else:
            given = tuple([0.0 * tau[0]] * len(a.law.commands))
        commands += [*within(a, given, p)] * count
    return tuple(commands)


def _units(a: Actuator, apart: bool) -> int:
    """How many sets of commands an actuator has."""
    return len(a.sides) if apart else 1


@cache
def _order(ship: Description) -> tuple[tuple[int, int], ...]:
    """(axis, component) of each step of the elimination, by the largest number of the description."""
    asked, parts = axes(ship), components(ship)
    columns = [_column(c, c.actuator.part.number("x"), c.actuator.part.number("y")) for c in parts]
    rows = [[float(column[k]) for column in columns] for k in asked]
    found: list[tuple[int, int]] = []
    for _ in rows:
        done = {i for i, _ in found}, {j for _, j in found}
        free = [
            (i, j)
            for i in range(len(rows))
            for j in range(len(parts))
            if i not in done[0] and j not in done[1]
        ]
        i, j = max(free, key=lambda at: abs(rows[at[0]][at[1]]))
        found.append((i, j))
        for k in {k for k, _ in free} - {i}:
            share = rows[k][j] / rows[i][j]
            rows[k] = [x - share * y for x, y in zip(rows[k], rows[i], strict=True)]
    return tuple(found)


def solution(ship: Description, tau: Sequence[Number], values: Sequence[Fields]) -> Triple:
    """The forces [N] of as many components as axes that give a force exactly, whatever their limits."""
    every = [law_of(a, own) for a, own in zip(actuators(ship), values, strict=True)]
    columns = [_column(c, *every[c.actuator.k][1:]) for c in components(ship)]
    asked = axes(ship)
    rows = [[c[k] for c in columns] for k in asked]
    found = _eliminated(rows, [tau[k] for k in asked], _order(ship))
    return found[0], found[1], found[2]


def _eliminated(
    rows: list[list[Number]], wanted: Sequence[Number], order: Sequence[tuple[int, int]]
) -> list[Number]:
    """f of B f = tau for the rows of a square B, by elimination in an order of pivots."""
    right = list(wanted)
    for k, (i, j) in enumerate(order):
        rows[i][j] = where(rows[i][j] == 0.0, NOTHING, rows[i][j])
        for m, _ in order[k + 1 :]:
            share = rows[m][j] / rows[i][j]
            rows[m] = [x - share * y for x, y in zip(rows[m], rows[i], strict=True)]
            right[m] = right[m] - share * right[i]
    found: list[Number] = [0.0] * len(right)
    for k, (i, j) in reversed([*enumerate(order)]):
        known = sum_of([rows[i][other] * found[other] for _, other in order[k + 1 :]])
        found[j] = (right[i] - known) / rows[i][j]
    return found


def _shared(
    columns: Sequence[Sequence[Number]],
    spans: Sequence[tuple[Number, Number]],
    wanted: Sequence[Number],
) -> list[Number]:
    """Forces within their spans that give what is wanted as nearly as they can."""
    weights = [0.25 * (high - low) * (high - low) for low, high in spans]
    found: list[Number] = [0.0] * len(columns)
    for _ in range(PASSES):
        left = list(wanted)
        for f, column in zip(found, columns, strict=True):
            left = [rest - f * b for rest, b in zip(left, column, strict=True)]
        more = _least(columns, weights, left)
        asked = [f + g for f, g in zip(found, more, strict=True)]
        found = [clip(w, low, high) for w, (low, high) in zip(asked, spans, strict=True)]
        weights = [
            where(abs(w - f) > 0.0, 0.0, weight)
            for w, f, weight in zip(asked, found, weights, strict=True)
        ]
    return found


def _least(
    columns: Sequence[Sequence[Number]], weights: Sequence[Number], wanted: Sequence[Number]
) -> list[Number]:
    """f = W B' (B W B' + e I)^-1 tau for the columns of B, by elimination."""
    n = range(len(wanted))
    rows = [
        [sum_of([w * b[i] * b[j] for w, b in zip(weights, columns, strict=True)]) for j in n] for i in n
    ]
    rows = [
        [x * (1.0 + TINY) + NOTHING if i == j else x for j, x in enumerate(row)]
        for i, row in enumerate(rows)
    ]
    right = _eliminated(rows, wanted, [(k, k) for k in n])
    return [w * sum_of([b[i] * right[i] for i in n]) for w, b in zip(weights, columns, strict=True)]


def sum_of(values: Sequence[Number]) -> Number:
    """The sum of some numbers, one after the other: ``sum`` compensates floats from Python 3.12 on."""
    found: Number = 0.0
    for x in values:
        found = found + x
    return found


def largest(ship: Description, values: Sequence[Fields], apart: bool = False) -> Triple:
    """The largest force and moment on each axis [N, N, N m], of all actuators at rest together."""
    found = [0.0, 0.0, 0.0]
    for c in components(ship):
        p, x, y = law_of(c.actuator, values[c.actuator.k])
        low, high = c.actuator.law.reach(Flow(), p)[c.actuator.law.components.index(c.along)]
        for axis, part in enumerate(_column(c, x, y)):
            found[axis] += _units(c.actuator, apart) * abs(part) * max(-low, high)
    return found[0], found[1], found[2]
