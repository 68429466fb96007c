"""The layouts of a ship: how its commands become a force."""

from functools import cache
from typing import Any

from ..effects import Running, Thrust
from ..hull import Triple
from ..ops import Number, clip, fmax
from ..ship_description import Description
from .actuation import (
    actuators,
    command_names,
    forces,
    limits,
    ordered,
    power_of,
    shared,
    variable,
)
from .law import Law
from .response import Layout, Prepared, total
from .weighted_allocation import TINY, allocate, largest


def working(ship: Description, t: Number, nu: Triple, commands: Any, p: Any, apart: bool) -> Running:
    """What the force of a ship's actuators may depend on."""
    units = [
        c.unit for a in ordered(ship) for _ in (a.sides if apart else (0.0,)) for c in a.law.commands
    ]
    part = [
        c if unit == "1" else clip(c / fmax(fmax(high, -low), TINY), -1.0, 1.0)
        for c, unit, (low, high) in zip(commands, units, limits(ship, p.plant, apart), strict=True)
    ]
    each = part if apart else [part[k] for k in shared(ship)]
    power = zip(actuators(ship), power_of(ship, p.power), strict=True)
    return Running(t, *nu, tuple(commands), tuple(each), tuple([x for a, x in power for _ in a.sides]))


@cache
def allocating(ship: Description) -> Description:
    """The ship as the allocation has it, which may know simpler laws."""
    laws = [Law.known[part.law].allocated for part in ship.actuators]
    parts = [
        p if x is None else p._replace(law=x.name) for p, x in zip(ship.actuators, laws, strict=True)
    ]
    return ship._replace(actuators=tuple(parts))


@cache
def layouts(ship: Description) -> tuple[Layout, ...]:
    """How runs may have a ship's commands: as its FMU does, and each unit by its own."""
    each = any(len(a.sides) > 1 for a in actuators(ship))
    return (_layout(ship, False), _layout(ship, True)) if each else (_layout(ship, False),)


def _layout(ship: Description, apart: bool) -> Layout:
    """How the commands of a ship become a force, with the effects of its actuators."""
    known = allocating(ship)

    def thrust(acting: Any, now: Running, b: Prepared) -> Thrust:
        p = b.params
        f = forces(ship, acting, (now.u, now.v, now.r), p.plant, p.power, apart)
        for member, acts in zip(b.effects.forces.members, b.acting, strict=True):
            f = member.apply(acts, b.params.wrong, f, f, now)
        return f

    at_rest = (0.0, 0.0, 0.0)
    # The power of a run is told with the commands of each unit.
    return Layout(
        commands=tuple(map(variable, command_names(ship, apart))),
        running=lambda t, u, v, r, c, b: working(ship, t, (u, v, r), c, b.params, apart),
        thrust=thrust,
        believed=lambda c, p: total(
            forces(known, c, at_rest, p.allocation, p.power if apart else (), apart)
        ),
        allocate=lambda tau, p: allocate(known, tau, at_rest, p.allocation, apart),
        full=lambda p: largest(known, p.allocation, apart),
        limits=lambda p: limits(ship, p.plant, apart),
        powered=powered,
        shared=shared(ship) if not apart and len(shared(ship)) > len(command_names(ship)) else (),
        curved=not all(a.law.proportional for a in actuators(ship)),
        round=tuple(
            [angle for a in ordered(ship) for _ in (a.sides if apart else (0.0,)) for angle in a.round]
        ),
    )


def powered(b: Prepared, settings: Any) -> Prepared:
    """The actuators at settings of their power, of each that has one."""
    p = b.params
    power = type(p.power)(*[x * s for x, s in zip(p.power, settings, strict=True)])
    return b._replace(params=p._replace(power=power))
