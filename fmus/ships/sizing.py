"""Components for a described ship: what they believe of it, and all else to its size."""

from dataclasses import replace

from ..declare import Component, Variable, redeclared, variables
from ..hull import Damping, Inertia
from ..ship_description import Description

ESTIMATE = "estimate at the start of "


def sized(component: Component, ship: Description) -> Component:
    """A component for a ship: parameters that a hull has too are the ship's, the others to its scale.

    Args:
        component: made for CyberShip Enterprise 1, such as a controller.
        ship: that it is to serve.
    """
    nominal = {v.name: v for v in [*variables(Inertia), *variables(Damping)]}
    given = {name: v.value for name, v in ship.values().items()}

    def for_ship(v: Variable) -> Variable:
        named = v.description.removeprefix(ESTIMATE)
        name = v.name if named == v.description else named
        known = name in nominal and nominal[name].unit == v.unit
        if known and (v.start != 0.0 or named == v.description):
            return replace(v, start=given.get(name, 0.0))
        return ship.scale.of(v)

    return replace(component, params=redeclared(component.params, for_ship))
