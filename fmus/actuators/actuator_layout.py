"""The layout of a described ship: how its commands become a force."""

from functools import cache
from typing import Any

from ..effects import Running, Thrust
from ..ops import Number, clip, fmax
from ..ship_description import Description
from .actuation import command_names, forces, limits, ordered, variable
from .response import Layout, Prepared, total
from .weighted_allocation import TINY, allocate, largest


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
