"""Thrusters that are propellers: the force grows with the square of the speed of rotation, (2.11)."""

from ..declare import Component
from ..effects import EffectSet
from ..ship_description import Description
from .thrusters import variant


def make(effects: EffectSet, ship: Description) -> Component | None:
    """The FMU of a ship's thrusters by the square of the command; None: none of them has that form."""
    form = ", whose force increases with the square of the command"
    return variant("thrusters_propeller", "squared", form, effects, ship)
