"""What may go wrong with the actuators of a described ship: the effects of each, by its law."""

from math import pi
from typing import NamedTuple

from ..declare import variables
from ..effects.all_thrusters import slow
from ..effects.devices import Devices, parameter
from ..effects.effect import Effect
from ..effects.families import Family
from ..effects.lost_force import Inflow, deadband, failure, inflow, loss, outage, saturation, speed_loss
from ..effects.misplaced import elsewhere, turned
from ..effects.own_curves import command_curve
from ..effects.text import number
from ..scale import Scale
from ..ship_description import Part
from .law import Flow, Law


class Actuator(NamedTuple):
    """An actuator of a ship.

    Attributes:
        k: its number.
        first: number of its first command among those of the ship.
        part: its description.
        law: that it follows.
        scale: of its ship.
        round: for each of its commands whether it is an angle that goes round.
        leads: whether it is the first with its commands, which others may share.
        behind: number of the actuator in whose race it works; None: in none.
    """

    k: int
    first: int
    part: Part
    law: type[Law]
    scale: Scale
    round: tuple[bool, ...]
    leads: bool = True
    behind: int | None = None

    @property
    def order(self) -> str:
        """The name that its commands have."""
        return self.part.order or self.part.name

    @property
    def commands(self) -> slice:
        """Where its commands lie among those of the ship."""
        return slice(self.first, self.first + len(self.law.commands))

    @property
    def axis(self) -> str:
        """Axes on which its force may act."""
        pushes = self.law.pushes or self.law.components
        ahead, aside = "X" in pushes, "Y" in pushes
        turns = aside or self.part.number("y") != 0.0
        return "X" * ahead + "Y" * aside + "N" * turns

    @property
    def devices(self) -> Devices:
        """The actuator as what effects concern."""
        title, last = self.part.title, self.first + len(self.law.commands) - 1
        family = Family(
            title,
            f"the {title} alone, at several commands, at rest and at speed",
            {title: f"the {title} at rest and at speed, small and large commands"},
        )
        return Devices(
            self.part.name,
            title,
            title,
            (self.k,),
            ((last, last),),
            self.axis,
            family,
            full_force(self),
            scale=self.scale,
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


def failings(a: Actuator) -> list[Effect]:
    """All that may go wrong with an actuator."""
    d = a.devices
    lag = f"lag_{a.order}"
    lost = parameter(
        f"inflow_{d.name}", "N.s/m", f"force of the {d.title} lost with the water's speed at its place"
    )
    lagging = slow(
        d._replace(label=f"the {d.title}"),
        lag,
        lambda f: f"{d.does('follow')} its command with a time constant {number(f[lag])} s longer.",
        a.commands,
        a.round,
    )
    return [
        command_curve(d, a.law.commands[-1].name),
        loss(d),
        speed_loss(d),
        inflow(d, [Inflow(lost, "XY", "X")]),
        failure(d),
        *([deadband(d), saturation([d], d)] if d.full > 0.0 else []),
        turned(d),
        elsewhere(d),
        outage(d, f"{d.name}_failure"),
        *([lagging] if a.leads else []),
    ]
