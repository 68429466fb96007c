"""Thrust allocation of CyberShip Enterprise 1, (2.13)-(2.19): shares of full force for a request.

Two Voith Schneider propellers aft act as one that pushes in surge and sway, a tunnel thruster forward
pushes in sway.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import Range
from ..hull import Triple
from ..ops import Number

# The allocation divides by forces and by the distance between the thrusters.
DIVISOR = Range(min=0.01)
AFT = Range(max=-0.01)
FORE = Range(min=0.01)


class Allocation(NamedTuple):
    """What the allocation believes of the thrusters."""

    F_vsp: Annotated[float, "N", "force of the VSP at full command", DIVISOR] = 1.165
    F_bow: Annotated[float, "N", "force of the bow thruster at full command", DIVISOR] = 2.629
    l_vsp: Annotated[float, "m", "VSP position forward of the body origin", AFT] = -0.4575
    l_bow: Annotated[float, "m", "bow thruster position forward of the body origin", FORE] = 0.3875
    p_x: Annotated[float, "m", "assumed point of attack, forward"] = 0.0
    p_y: Annotated[float, "m", "assumed point of attack, to starboard"] = 0.0


def thrust(s_x: Number, s_y: Number, s_bow: Number, p: Any) -> Triple:
    """Force and moment [N, N, N m] of shares of full force: H(p_o) T K u, (2.15)-(2.19), corrected.

    The thrusters p are an Allocation, or a tuple in the same order.
    """
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    f_x, f_y, f_bow = F_vsp * s_x, F_vsp * s_y, F_bow * s_bow
    return f_x, f_y + f_bow, (l_vsp + p_x) * f_y + (l_bow + p_x) * f_bow - p_y * f_x


def allocate(X: Number, Y: Number, N: Number, p: Allocation) -> Triple:
    """Shares of full force that give a force, before limiting: the inverse of :func:`thrust`."""
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    moment = N + p_y * X - p_x * Y
    f_bow = (moment - l_vsp * Y) / (l_bow - l_vsp)
    return X / F_vsp, (Y - f_bow) / F_vsp, f_bow / F_bow
