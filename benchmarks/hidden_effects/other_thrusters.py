"""Thrusters that the diagnosis does not know: the bow's effectiveness is exp(-(u/u_0)^2).

A component file: ``python -m fmus.build benchmarks/hidden_effects/other_thrusters.py --out fmu``.
"""

from typing import Annotated, Any, NamedTuple

from fmus.actuators.law import Flow
from fmus.actuators.laws import TunnelThruster
from fmus.declare import POSITIVE
from fmus.ops import Number, exp
from fmus.ship import ship
from fmus.thrusters.thrusters import make


class Fading(NamedTuple):
    F: Annotated[float, "N", "force to starboard at full command", POSITIVE] = 1.0
    fade: Annotated[float, "s/m", "1/u_0: inverse of the surge speed that costs 63 %", POSITIVE] = 0.0


class FadingThruster(TunnelThruster):
    """Thruster in a tunnel whose force fades with the surge speed."""

    name = "fading_thruster"
    allocated = TunnelThruster
    proportional = False
    Parameters = Fading

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        (u,) = commands
        slow = p.fade * flow.hull_u
        return 0.0 * u, p.F * (u * exp(-slow * slow))


SHIP = ship()
_, BOW = SHIP.description.actuators
OTHER = SHIP.description._replace(
    actuators=(SHIP.description.actuators[0], BOW._replace(law=FadingThruster.name)),
    aliases=(*SHIP.description.aliases, ("plant_bow_fade", "bow_exp")),
)
COMPONENT = make(SHIP.effects, OTHER, "other_thrusters", "; that of the bow fades with the surge speed")
