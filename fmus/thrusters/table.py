"""Thrusters with a table of their force over command and inflow speed, (2.12)."""

from ..declare import Component
from ..effects import EffectSet
from ..ship_description import Description
from .thrusters import variant


def make(effects: EffectSet, ship: Description) -> Component | None:
    """The FMU of a ship's thrusters by tables; None: none of them has that form."""
    form = ", by tables over command and inflow speed"
    return variant("thrusters_table", "table", form, effects, ship)
