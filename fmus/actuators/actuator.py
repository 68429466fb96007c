"""An actuator of a ship, as its law, its commands and its units make it."""

from collections.abc import Sequence
from itertools import combinations
from math import pi
from typing import NamedTuple

from ..declare import variables
from ..effects.devices import Devices
from ..effects.families import Family
from ..scale import Scale
from ..ship_description import Part
from .law import Flow, Law

SIDES = ("to port", "to starboard")


class Actuator(NamedTuple):
    """An actuator of a ship: one unit, or two abreast that share its commands and are alike.

    Where both units have the same commands, each gives half of the force of the law. Where each has
    commands of its own, as in measurements, it gives all of it, at the power of the run.

    Attributes:
        k: its number.
        first: number of its first command among those of the ship.
        part: its description.
        law: that it follows.
        scale: of its ship.
        round: for each of its commands whether it is an angle that goes round.
        leads: whether it is the first with its commands, which others may share.
        behind: number of the actuator in whose race it works; None: in none.
        unit: number of its first unit.
        own: number of its first unit's first command where each unit has commands of its own.
        strength: name of the parameter that is its full force; empty: there is none.
    """

    k: int
    first: int
    part: Part
    law: type[Law]
    scale: Scale
    round: tuple[bool, ...]
    leads: bool = True
    behind: int | None = None
    unit: int = 0
    own: int = 0
    strength: str = ""

    @property
    def order(self) -> str:
        """The name that its commands have."""
        return self.part.order or self.part.name

    @property
    def label(self) -> str:
        """Its name in descriptions of variables."""
        return self.part.label or self.part.title

    @property
    def commands(self) -> slice:
        """Where its commands lie among those of the ship."""
        return slice(self.first, self.first + len(self.law.commands))

    @property
    def sides(self) -> tuple[float, ...]:
        """How far to starboard of its place each of its units is [m]."""
        off = self.part.number("half_spacing")
        return (-off, off) if off else (0.0,)

    @property
    def units(self) -> tuple[int, ...]:
        """Numbers of its units."""
        return tuple(range(self.unit, self.unit + len(self.sides)))

    def commands_of(self, unit: int) -> slice:
        """Where the commands of one of its units lie where each unit has its own."""
        count = len(self.law.commands)
        first = self.own + unit * count
        return slice(first, first + count)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of its units."""
        name = self.part.name
        return (name,) if len(self.sides) == 1 else tuple([f"{name}{k}" for k in (1, 2)])

    @property
    def axis(self) -> str:
        """Axes on which its force may act."""
        pushes = self.law.pushes or self.law.components
        ahead, aside = "X" in pushes, "Y" in pushes
        turns = aside or self.part.number("y") != 0.0 or len(self.sides) > 1
        return "X" * ahead + "Y" * aside + "N" * turns

    @property
    def devices(self) -> Devices:
        """The actuator as what effects concern."""
        title = self.part.title
        family = self.law.family or Family(
            title,
            f"the {title} alone, at several commands, at rest and at speed",
            {title: f"the {title} at rest and at speed, small and large commands"},
        )
        places = [self.commands_of(unit) for unit in range(len(self.sides))]
        return Devices(
            self.part.name,
            title,
            self.label,
            self.units,
            tuple([(at.start if self.law.by_axis else at.stop - 1, at.stop - 1) for at in places]),
            self.axis,
            family,
            full_force(self),
            self.strength,
            len(self.sides) > 1,
            scale=self.scale,
        )

    @property
    def devices_each(self) -> tuple[Devices, ...]:
        """Its units, each as what effects concern."""
        d = self.devices
        if len(self.sides) == 1:
            return (d,)
        return tuple(
            [
                d._replace(
                    name=name,
                    title=f"{self.label} {k + 1} {SIDES[k]}",
                    label=f"{self.label} {k + 1}",
                    members=d.members[k : k + 1],
                    commands=d.commands[k : k + 1],
                    plural=False,
                    apart=True,
                )
                for k, name in enumerate(self.names)
            ]
        )


def twins(every: Sequence[Actuator]) -> list[tuple[Actuator, Actuator]]:
    """Actuators of one law at mirrored places, each with commands of its own."""
    return [
        (a, b)
        for a, b in combinations(every, 2)
        if a.law is b.law and a.order != b.order and _place(a, -1.0) == _place(b) != _place(b, -1.0)
    ]


def _place(a: Actuator, side: float = 1.0) -> tuple[float, float]:
    return a.part.number("x"), side * a.part.number("y")


def both(a: Actuator, b: Actuator) -> Devices:
    """Two actuators as what one effect concerns."""
    d, e = a.devices, b.devices
    return d._replace(
        name=f"{d.name}_{e.name}",
        title=f"{d.title} and {e.title}",
        label=f"{d.label} and {e.label}",
        members=(*d.members, *e.members),
        commands=(*d.commands, *e.commands),
        plural=True,
    )


def goes_round(part: Part, law: type[Law]) -> tuple[bool, ...]:
    """For each command of an actuator whether it is an angle that goes round."""
    starts = {v.name: v.start for v in variables(law.Parameters)}
    limits = [c.angle_limit for c in law.commands]
    return tuple([bool(name) and part.number(name, starts[name]) >= pi for name in limits])


def full_force(a: Actuator) -> float:
    """The largest force [N] that the description gives it at rest."""
    p = a.law.Parameters(
        **{v.name: v.value for v in a.part.values if v.name in a.law.Parameters._fields}
    )
    most = [abs(end) for span in a.law.reach(Flow(0.0, 0.0), p) for end in span]
    return max(most, default=0.0)
