"""The actuators of a described ship: their parameters, their force, and what each is asked for."""

from collections.abc import Sequence
from functools import cache
from typing import Any

from ..declare import Known, Range, Variable, group_of, variables
from ..effects import Thrust
from ..hull import Triple
from ..ops import Number, clip, wrap
from ..ship_description import Description
from . import azimuth_leg as azimuth_leg  # registers laws, as the next two do
from . import force_table as force_table  # registers its laws
from . import laws as laws
from . import standard_method as standard_method
from .failings import Actuator, goes_round
from .law import Flow, Law


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


def limits(ship: Description, values: Any) -> tuple[tuple[Number, Number], ...]:
    """The lowest and the highest value of each command, by the parameters of each actuator."""
    return tuple([span for a in ordered(ship) for span in a.law.limits(law_of(a, values[a.k])[0])])
