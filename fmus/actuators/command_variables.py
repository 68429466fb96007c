"""The commands of a ship, and the limits of their rates, as variables of an FMU."""

from ..declare import POSITIVE, Fields, Variable, group_of
from ..ship_description import Description
from .actuation import actuators, command_names, ordered, variable
from .actuator import Actuator
from .law import Command


def commands_of(ship: Description) -> type[Fields]:
    """The commands of a ship as a group of variables."""
    return group_of(
        "Commands",
        [
            Variable(variable(name), c.unit, f"{a.label}: {c.description}", 0.0)
            for name, (a, c) in zip(command_names(ship), _commands(ship), strict=True)
        ],
    )


def rates_of(ship: Description) -> type[Fields]:
    """The limit of each command's rate; one for all where each is a share and none has its own."""
    limits = [(a, c, a.part.number(f"{c.name}_rate")) for a, c in _commands(ship)]
    if limits and all(c.unit == "1" and not rate for _, c, rate in limits):
        text = "limit of a command's rate; 0: none"
        return group_of("Rate", [Variable("plant_rate", "1/s", text, 0.0, POSITIVE)])

    def limit(a: Actuator, c: Command, rate: float) -> Variable:
        v = Variable(
            f"plant_{a.order}_{c.name}_rate",
            "1/s" if c.unit == "1" else f"{c.unit}2" if c.unit == "1/s" else f"{c.unit}/s",
            f"{a.label}: limit of the rate of {c.name}; 0: none",
            rate,
            POSITIVE,
        )
        stated = a.part.stated(f"{c.name}_rate")
        return v if stated is None else stated.of(v, "rate")

    return group_of("Rate", [limit(*each) for each in limits])


def powers_of(ship: Description) -> type[Fields]:
    """The power setting of each actuator that has one."""
    return group_of(
        "Power",
        [
            Variable(
                f"power_{a.part.name}",
                "1",
                f"thrust of the {a.label}, of that at its full power",
                1.0,
                POSITIVE,
            )
            for a in actuators(ship)
            if a.law.powered
        ],
    )


def _commands(ship: Description) -> list[tuple[Actuator, Command]]:
    return [(a, c) for a in ordered(ship) for c in a.law.commands]
