"""The actuators of a described ship: their parameters, their force, and what each is asked for."""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

from ..declare import Known, Range, Variable, group_of, variables
from ..effects import Running, Thrust
from ..hull import Triple
from ..ops import Number, clip, fmax, where, wrap
from ..ship_description import Description
from . import azimuth_leg as azimuth_leg  # registers laws, as the next two do
from . import force_table as force_table  # registers its laws
from . import laws as laws
from . import standard_method as standard_method
from .failings import Actuator, goes_round
from .law import Flow, Law
from .response import Layout, Prepared, total

PASSES = 2  # of the allocation: what the first one clips is asked of the others
TINY = 1e-9  # share by which a matrix that has no inverse gets one
NOTHING = 1e-30  # N2, in place of zero where no actuator can push


@cache
def actuators(ship: Description) -> tuple[Actuator, ...]:
    """The actuators of a ship, each with its law and the place of its commands."""
    found: list[Actuator] = []
    places: dict[str, int] = {}
    first = 0
    names = [part.name for part in ship.actuators]
    for k, part in enumerate(ship.actuators):
        law = Law.known[part.law]
        order = part.order or part.name
        leads = order not in places
        own = places.setdefault(order, first)
        behind = names.index(part.behind) if part.behind else None
        round_ = goes_round(part, law)
        found.append(Actuator(k, own, part, law, ship.scale, round_, leads, behind))
        first += len(law.commands) if leads else 0
    return tuple(found)


@cache
def ordered(ship: Description) -> tuple[Actuator, ...]:
    """The actuators of a ship with commands of their own, or the first with those that others share."""
    return tuple(a for a in actuators(ship) if a.leads)


@cache
def command_units(ship: Description) -> dict[str, str]:
    """``ACTUATOR.COMMAND`` of every command of a ship, and its unit."""
    return {f"{a.order}.{c.name}": c.unit for a in ordered(ship) for c in a.law.commands}


def command_names(ship: Description) -> tuple[str, ...]:
    """``ACTUATOR.COMMAND`` of every command of a ship."""
    return tuple(command_units(ship))


def variable(command: str) -> str:
    """The name that a command has among the variables of an FMU."""
    return command.replace(".", "_")


def parameters(a: Actuator, prefix: str, known: bool) -> type[Any]:
    """Parameters of an actuator: those of its law, and its place.

    Args:
        a: the actuator.
        prefix: of their names.
        known: whether they are of the real ship, with where their values come from.
    """
    name, title = a.part.name, a.part.title
    place = [
        Variable("x", "m", "place, forward of the body origin", 0.0, Range(), False),
        Variable("y", "m", "place, to starboard", 0.0, Range(), False),
    ]
    given = {v.name: v for v in a.part.values}
    found: list[Variable] = []
    for v in [*variables(a.law.Parameters), *place]:
        start, fit = v.start, None
        if v.name in given:
            value = given[v.name]
            start = value.value
            fits = start != 0.0 and value.share > 0.0 and v.name not in a.law.limiting
            if known and fits:
                fit = Known("place" if v.name in ("x", "y") else "thrust", value.origin, value.share)
        text = f"{title}: {v.description}"
        found.append(Variable(f"{prefix}{name}_{v.name}", v.unit, text, start, v.range, False, fit))
    return group_of(f"{prefix}{name}", found)


def law_of(a: Actuator, values: Any) -> tuple[Number, Number, Number]:
    """Parameters of an actuator's law, and its place x, y [m, m]."""
    *own, x, y = values
    return a.law.Parameters._make(own), x, y


def within(a: Actuator, commands: Sequence[Number], p: Any) -> tuple[Number, ...]:
    """Commands brought within their limits."""
    each = zip(commands, a.law.limits(p), a.round, strict=True)
    return tuple([clip(wrap(c) if angle else c, low, high) for c, (low, high), angle in each])


def flow_at(u: Number, v: Number, r: Number, x: Number, y: Number) -> Flow:
    """Velocity of a place on the ship."""
    return Flow(u - y * r, v + x * r, u, v, r)


def water_at(
    ship: Description,
    a: Actuator,
    every: Sequence[tuple[Any, Number, Number]],
    commands: Sequence[Number],
    nu: Triple,
) -> Flow:
    """What an actuator meets: the velocity of its place, and the race that it works in.

    Args:
        ship: whose actuator it is.
        a: the actuator.
        every: of each actuator of the ship, what :func:`law_of` gives.
        commands: of all of them.
        nu: u, v, r [m/s, m/s, rad/s].
    """
    _, x, y = every[a.k]
    flow = flow_at(*nu, x, y)
    if a.behind is None:
        return flow
    b = actuators(ship)[a.behind]
    p, x, y = every[b.k]
    given = within(b, commands[b.commands], p)
    return flow._replace(race=b.law.race(given, flow_at(*nu, x, y), p))


def forces(ship: Description, commands: Sequence[Number], nu: Triple, values: Any) -> Thrust:
    """The force of each actuator, nothing wrong with it.

    Args:
        ship: its actuators.
        commands: of all of them.
        nu: u, v, r [m/s, m/s, rad/s].
        values: parameters of each actuator.
    """
    X, Y, xs, ys = [], [], [], []
    every = [law_of(a, own) for a, own in zip(actuators(ship), values, strict=True)]
    for a, (p, x, y) in zip(actuators(ship), every, strict=True):
        flow = water_at(ship, a, every, commands, nu)
        f_x, f_y = a.law.force(within(a, commands[a.commands], p), flow, p)
        X.append(f_x)
        Y.append(f_y)
        xs.append(a.law.acts_at(x, p))
        ys.append(y)
    return Thrust(tuple(X), tuple(Y), tuple(xs), tuple(ys), (1.0,) * len(X))


@cache
def measurable(ship: Description) -> dict[str, str]:
    """``ACTUATOR.OUTPUT`` of all that can be measured of a ship's actuators, and its unit."""
    return {
        f"{a.part.name}.{name}": unit
        for a in actuators(ship)
        for name, unit in a.law.measured(a.part).items()
    }


def output(ship: Description, name: str, commands: Sequence[Number], nu: Triple, values: Any) -> Number:
    """What is measured of an actuator beside its commands.

    Args:
        ship: its actuators.
        name: ``ACTUATOR.OUTPUT``, such as ``propeller.thrust``.
        commands: of all of them.
        nu: u, v, r [m/s, m/s, rad/s].
        values: parameters of each actuator.
    """
    of, what = name.split(".")
    every = [law_of(a, own) for a, own in zip(actuators(ship), values, strict=True)]
    a = next(a for a in actuators(ship) if a.part.name == of)
    p, _, _ = every[a.k]
    flow = water_at(ship, a, every, commands, nu)
    return a.law.output(what, within(a, commands[a.commands], p), flow, p)


class Component(NamedTuple):
    """A force that an actuator can be asked for: whose it is, and along which axis of the ship."""

    actuator: Actuator
    along: str


@cache
def components(ship: Description) -> tuple[Component, ...]:
    """The forces that a ship's actuators can be asked for."""
    return tuple([Component(a, axis) for a in actuators(ship) for axis in a.law.components])


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


def _column(c: Component, x: Number, y: Number) -> Triple:
    """tau [N, N, N m] of one newton along a component."""
    return (1.0, 0.0, -y) if c.along == "X" else (0.0, 1.0, x)


def allocate(ship: Description, tau: Sequence[Number], nu: Triple, values: Any) -> tuple[Number, ...]:
    """Commands that give a force as nearly as the actuators can: weighted least squares within limits.

    Each force is weighed by what its actuator can give; what a limit cuts off is asked of the others
    (redistributed pseudo-inverse: Johansen and Fossen 2013, Automatica 49, section 2.2). An axis that
    the ship cannot give is not asked for.

    Args:
        ship: its actuators.
        tau: force to give [N, N, N m].
        nu: u, v, r [m/s, m/s, rad/s], by which a rudder's force goes.
        values: what the allocation believes of each actuator.

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
        span = c.actuator.law.reach(flow_at(*nu, x, y), p)
        spans.append(span[c.actuator.law.components.index(c.along)])
    weights = [0.25 * (high - low) * (high - low) for low, high in spans]
    found: list[Any] = [0.0 * tau[0]] * len(parts)
    for _ in range(PASSES):
        left = [tau[k] for k in asked]
        for f, column in zip(found, columns, strict=True):
            left = [rest - f * b for rest, b in zip(left, column, strict=True)]
        more = _least(columns, weights, left)
        wanted = [f + g for f, g in zip(found, more, strict=True)]
        found = [clip(w, low, high) for w, (low, high) in zip(wanted, spans, strict=True)]
        weights = [
            where(abs(w - f) > 0.0, 0.0, weight)
            for w, f, weight in zip(wanted, found, weights, strict=True)
        ]
    commands: list[Any] = []
    for a in ordered(ship):
        p, x, y = every[a.k]
        own = tuple([f for f, c in zip(found, parts, strict=True) if c.actuator is a])
        if own:
            given = a.law.commanded(own, flow_at(*nu, x, y), p)
        else:
            given = tuple([0.0 * tau[0]] * len(a.law.commands))
        commands += within(a, given, p)
    return tuple(commands)


def _least(
    columns: Sequence[Sequence[Number]], weights: Sequence[Number], wanted: Sequence[Number]
) -> list[Any]:
    """f = W B' (B W B' + e I)^-1 tau for the columns of B, by elimination."""
    n = range(len(wanted))
    rows = [
        [sum_of([w * b[i] * b[j] for w, b in zip(weights, columns, strict=True)]) for j in n] for i in n
    ]
    rows = [
        [x * (1.0 + TINY) + NOTHING if i == j else x for j, x in enumerate(row)]
        for i, row in enumerate(rows)
    ]
    right = list(wanted)
    for k in n:
        for i in range(k + 1, len(wanted)):
            share = rows[i][k] / rows[k][k]
            rows[i] = [x - share * y for x, y in zip(rows[i], rows[k], strict=True)]
            right[i] = right[i] - share * right[k]
    for k in reversed(n):
        known = sum_of([rows[k][j] * right[j] for j in range(k + 1, len(wanted))])
        right[k] = (right[k] - known) / rows[k][k]
    return [w * sum_of([b[i] * right[i] for i in n]) for w, b in zip(weights, columns, strict=True)]


def sum_of(values: Sequence[Number]) -> Any:
    """The sum of some numbers, one after the other: ``sum`` compensates floats from Python 3.12 on."""
    found: Number = 0.0
    for x in values:
        found = found + x
    return found


def largest(ship: Description, values: Any) -> Triple:
    """The largest force and moment on each axis [N, N, N m], of all actuators at rest together."""
    found = [0.0, 0.0, 0.0]
    for c in components(ship):
        p, x, y = law_of(c.actuator, values[c.actuator.k])
        low, high = c.actuator.law.reach(Flow(), p)[c.actuator.law.components.index(c.along)]
        for axis, part in enumerate(_column(c, x, y)):
            found[axis] += abs(part) * max(-low, high)
    return found[0], found[1], found[2]


def limits(ship: Description, values: Any) -> tuple[tuple[Number, Number], ...]:
    """The lowest and the highest value of each command, by the parameters of each actuator."""
    return tuple([span for a in ordered(ship) for span in a.law.limits(law_of(a, values[a.k])[0])])


def working(
    ship: Description, t: Number, u: Number, v: Number, r: Number, commands: Any, values: Any
) -> Running:
    """What the force of a ship's actuators may depend on."""
    part = [
        clip(c / fmax(fmax(high, -low), TINY), -1.0, 1.0)
        for c, (low, high) in zip(commands, limits(ship, values), strict=True)
    ]
    return Running(t, u, v, r, tuple(commands), tuple(part), (1.0,) * len(ship.actuators))


@cache
def layout(ship: Description) -> Layout:
    """How the commands of a ship become a force, with what is wrong with its actuators."""

    def thrust(acting: Any, now: Running, b: Prepared) -> Thrust:
        f = forces(ship, acting, (now.u, now.v, now.r), b.params.plant)
        for member, acts in zip(b.effects.forces.members, b.acting, strict=True):
            f = member.apply(acts, b.params.wrong, f, f, now)
        return f

    at_rest = (0.0, 0.0, 0.0)
    return Layout(
        commands=tuple(map(variable, command_names(ship))),
        running=lambda t, u, v, r, c, b: working(ship, t, u, v, r, c, b.params.plant),
        thrust=thrust,
        believed=lambda c, p: total(forces(ship, c, at_rest, p.allocation)),
        allocate=lambda tau, p: allocate(ship, tau, at_rest, p.allocation),
        full=lambda p: largest(ship, p.allocation),
        limits=lambda p: limits(ship, p.plant),
        curved=True,
        round=tuple([angle for a in ordered(ship) for angle in a.round]),
    )
