"""The actuators of a described ship: their parameters, their force, and what each is asked for."""

from collections.abc import Sequence
from functools import cache

from ..declare import POSITIVE, Fields, Variable, group_of, variables
from ..effects import Thrust
from ..hull import Triple
from ..ops import Number, clip, wrap
from ..ship_description import Description
from . import azimuth_leg as azimuth_leg  # registers laws, as the next ones do
from . import force_table as force_table
from . import four_quadrants as four_quadrants
from . import laws as laws
from . import standard_method as standard_method
from . import thrust_forms as thrust_forms
from .actuator import Actuator, goes_round
from .law import Flow, Law


@cache
def actuators(ship: Description) -> tuple[Actuator, ...]:
    """The actuators of a ship, each with its law and the place of its commands."""
    found: list[Actuator] = []
    places: dict[str, int] = {}
    first = unit = own = 0
    names = [part.name for part in ship.actuators]
    for k, part in enumerate(ship.actuators):
        law = Law.known[part.law]
        order = part.order or part.name
        leads = order not in places
        at = places.setdefault(order, first)
        behind = names.index(part.behind) if part.behind else None
        strength = law.strength and ship.called(f"plant_{part.name}_{law.strength}")
        a = Actuator(
            k, at, part, law, ship.scale, goes_round(part, law), leads, behind, unit, own, strength
        )
        if not leads:
            a = a._replace(own=next(b.own for b in found if b.order == order))
        found.append(a)
        unit += len(a.sides)
        first += len(law.commands) * leads
        own += len(law.commands) * leads * len(a.sides)
    return tuple(found)


@cache
def ordered(ship: Description) -> tuple[Actuator, ...]:
    """The actuators of a ship with commands of their own, or the first with those that others share."""
    return tuple(a for a in actuators(ship) if a.leads)


@cache
def command_units(ship: Description, apart: bool = False) -> dict[str, str]:
    """``ACTUATOR.COMMAND`` of every command of a ship, or its alias, and its unit.

    Args:
        ship: its actuators.
        apart: whether units that share commands have their own.
    """
    found = {}
    for a in ordered(ship):
        for name in a.names if apart and len(a.sides) > 1 else (a.order,):
            for c in a.law.commands:
                known = f"{'each_' * apart}{name}_{c.name}"
                alias = ship.called(known)
                found[f"{name}.{c.name}" if alias == known else alias] = c.unit
    return found


def command_names(ship: Description, apart: bool = False) -> tuple[str, ...]:
    """``ACTUATOR.COMMAND`` of every command of a ship, or its alias."""
    return tuple(command_units(ship, apart))


@cache
def shared(ship: Description) -> tuple[int, ...]:
    """For each command of each unit the place of the command that it shares among those of the ship."""
    return tuple(
        [k for a in ordered(ship) for _ in a.sides for k in range(a.commands.start, a.commands.stop)]
    )


def variable(command: str) -> str:
    """The name that a command has among the variables of an FMU."""
    return command.replace(".", "_")


def parameters(ship: Description, a: Actuator, prefix: str, known: bool) -> type[Fields]:
    """Parameters of an actuator: those of its law, and its place.

    Args:
        ship: whose it is, with aliases.
        a: the actuator.
        prefix: of their names.
        known: whether they are of the real ship, with where their values come from.
    """
    name, title = a.part.name, a.label
    place = [
        Variable("x", "m", "place, forward of the body origin", 0.0),
        Variable("y", "m", "place, to starboard", 0.0),
    ]
    given = {v.name: v for v in a.part.values}
    found: list[Variable] = []
    for v in [*variables(a.law.Parameters), *place]:
        start, fit = v.start, None
        if v.name in given:
            value = given[v.name]
            start = value.value
            fits = (value.std or (start and value.share)) and v.name not in a.law.limiting
            if known and fits:
                fit = value.known("place" if v.name in ("x", "y") else "thrust")
        text = f"{title}: {v.description}"
        called = ship.called(f"{prefix}{name}_{v.name}")
        # The allocation divides by a full force; a real one may be lost.
        span = POSITIVE if known and v.name == a.law.strength else v.range
        found.append(Variable(called, v.unit, text, start, span, False, fit))
    return group_of(f"{prefix}{name}", found)


def law_of(a: Actuator, values: Fields) -> tuple[Fields, Number, Number]:
    """Parameters of an actuator's law, and its place x, y [m, m]."""
    *own, x, y = values
    return a.law.Parameters._make(own), x, y


def within(a: Actuator, commands: Sequence[Number], p: Fields) -> tuple[Number, ...]:
    """Commands brought within their limits."""
    each = zip(commands, a.law.limits(p), a.round, strict=True)
    return tuple([clip(wrap(c) if angle else c, low, high) for c, (low, high), angle in each])


def flow_at(u: Number, v: Number, r: Number, x: Number, y: Number) -> Flow:
    """Velocity of a place on the ship."""
    return Flow(u - y * r, v + x * r, u, v, r)


def water_at(
    ship: Description,
    a: Actuator,
    every: Sequence[tuple[Fields, Number, Number]],
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


def forces(
    ship: Description,
    commands: Sequence[Number],
    nu: Triple,
    values: Sequence[Fields],
    settings: Sequence[Number] = (),
    apart: bool = False,
) -> Thrust:
    """The force of each unit of each actuator, nothing wrong with it.

    Args:
        ship: its actuators.
        commands: of all of them.
        nu: u, v, r [m/s, m/s, rad/s].
        values: parameters of each actuator.
        settings: of the power of each actuator that has one; empty: full.
        apart: whether each unit has commands of its own.
    """
    X, Y, xs, ys, gains, couples = [], [], [], [], [], []
    every = [law_of(a, own) for a, own in zip(actuators(ship), values, strict=True)]
    power, couple = power_of(ship, settings), any(a.law.has_couple for a in actuators(ship))
    for a, (p, x, y), gain in zip(actuators(ship), every, power, strict=True):
        flow = water_at(ship, a, every, commands, nu)
        at, sides = a.law.acts_at(x, p), a.sides
        # Units with the same commands have one object as force, which effects then change once.
        places = [a.commands_of(k) for k in range(len(sides))] if apart else [a.commands]
        given = [a.law.force(within(a, commands[place], p), flow, p) for place in places]
        each = gain if len(given) == len(sides) else gain / len(sides)
        for k, side in enumerate(sides):
            f_x, f_y = given[k] if len(given) == len(sides) else given[0]
            X.append(f_x)
            Y.append(f_y)
            xs.append(at)
            ys.append(y + side if side else y)
            gains.append(each)
            if couple:
                place = places[k] if len(given) == len(sides) else places[0]
                couples.append(a.law.couple(within(a, commands[place], p), flow, p))
    return Thrust(tuple(X), tuple(Y), tuple(xs), tuple(ys), tuple(gains), couple=tuple(couples))


def power_of(ship: Description, settings: Sequence[Number] = ()) -> list[Number]:
    """The power of each actuator, for the settings of those that have one; empty: full."""
    given = iter(settings)
    return [next(given) if settings and a.law.powered else 1.0 for a in actuators(ship)]


@cache
def measurable(ship: Description) -> dict[str, str]:
    """``ACTUATOR.OUTPUT`` of all that can be measured of a ship's actuators, and its unit."""
    return {
        f"{a.part.name}.{name}": unit
        for a in actuators(ship)
        for name, unit in a.law.measured(a.part).items()
    }


def output(
    ship: Description, name: str, commands: Sequence[Number], nu: Triple, values: Sequence[Fields]
) -> Number:
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


def limits(
    ship: Description, values: Sequence[Fields], apart: bool = False
) -> tuple[tuple[Number, Number], ...]:
    """The lowest and the highest value of each command, by the parameters of each actuator."""
    return tuple(
        [
            span
            for a in ordered(ship)
            for _ in (a.sides if apart else (0.0,))
            for span in a.law.limits(law_of(a, values[a.k])[0])
        ]
    )
