"""The commands of a ship, and the limits of their rates, as variables of an FMU."""

from typing import Any

from ..declare import POSITIVE, Variable, group_of
from ..ship_description import Description
from .actuation import ordered, variable


def commands_of(ship: Description) -> type[Any]:
    """The commands of a ship as a group of variables."""
    return group_of(
        "Commands",
        [
            Variable(variable(f"{a.order}.{c.name}"), c.unit, f"{a.part.title}: {c.description}", 0.0)
            for a in ordered(ship)
            for c in a.law.commands
        ],
    )


def rates_of(ship: Description) -> type[Any]:
    """The limit of each command's rate."""
    return group_of(
        "Rate",
        [
            Variable(
                f"plant_{a.order}_{c.name}_rate",
                "1/s" if c.unit == "1" else f"{c.unit}2" if c.unit == "1/s" else f"{c.unit}/s",
                f"{a.part.title}: limit of the rate of {c.name}; 0: none",
                a.part.number(f"{c.name}_rate"),
                POSITIVE,
            )
            for a in ordered(ship)
            for c in a.law.commands
        ],
    )
