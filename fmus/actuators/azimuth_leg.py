"""Azimuth thruster whose leg and nozzle meet the water: drag along the inflow, lift across it.

The form of the published model of R/V Gunnerus (NTNU-MCS/MCSim_python, 2022), written anew from its
formulas.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import POSITIVE, Range, group_of, variables
from ..ops import Number, atan2, cos, sin, wrap
from .law import Change, Flow, Law, Span
from .laws import Azimuth, AzimuthThruster


class LegForces(NamedTuple):
    """What the water does to the leg; alpha below is the thruster's angle less that of the inflow."""

    area: Annotated[float, "m2", "area of the leg in the flow", POSITIVE] = 0.0
    drag: Annotated[float, "1", "its drag coefficient along the inflow"] = 0.0
    drag_slope: Annotated[float, "1/rad", "growth of the drag coefficient with |alpha|"] = 0.0
    lift: Annotated[float, "1", "its lift coefficient, of sin 2 alpha"] = 0.0
    bias: Annotated[float, "rad", "angle of the thruster at the command 0", Range(-0.5, 0.5)] = 0.0
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1000.0


class AzimuthLeg(Law):
    """Thrust at a bollard, and drag and lift of the leg in its own inflow; not asked for force."""

    name = "azimuth_with_leg"
    commands = AzimuthThruster.commands
    pushes = "XY"
    limiting = AzimuthThruster.limiting
    changes = (
        Change("bias", ("bias",), "angle at the command 0"),
        Change("thrust", ("k_ahead",), "thrust by the square of the shaft speed"),
        Change("leg_drag", ("drag", "drag_slope"), "drag of the legs"),
        Change("leg_lift", ("lift",), "lift of the legs"),
    )
    Parameters = group_of("AzimuthLegs", [*variables(Azimuth), *variables(LegForces)])

    @classmethod
    def limits(cls, p: Any) -> tuple[Span, ...]:
        return AzimuthThruster.limits(p)

    @classmethod
    def force(cls, commands: tuple[Number, ...], flow: Flow, p: Any) -> tuple[Number, Number]:
        alpha, n = commands
        angle = alpha + p.bias
        X, Y = AzimuthThruster.force((angle, n), flow, p)
        inflow = atan2(flow.v, flow.u)
        off = wrap(angle - inflow)
        pressure = 0.5 * p.water_density * p.area * (flow.u * flow.u + flow.v * flow.v)
        drag = pressure * (p.drag + p.drag_slope * abs(off))
        lift = pressure * p.lift * sin(2.0 * off)
        c, s = cos(inflow), sin(inflow)
        return X - drag * c - lift * s, Y + lift * c - drag * s
