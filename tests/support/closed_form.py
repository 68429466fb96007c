"""The thrust and its allocation of CyberShip Enterprise 1 in closed form, (2.13)-(2.19): a reference."""

from typing import Any, NamedTuple


class Allocation(NamedTuple):
    """What the allocation believes of the thrusters."""

    F_vsp: float = 1.165
    F_bow: float = 2.629
    l_vsp: float = -0.4575
    l_bow: float = 0.3875
    p_x: float = 0.0
    p_y: float = 0.0


def thrust(s_x: Any, s_y: Any, s_bow: Any, p: Any) -> tuple[Any, Any, Any]:
    """Force and moment [N, N, N m] of shares of full force: H(p_o) T K u, (2.15)-(2.19), corrected.

    The thrusters p are an Allocation, or a tuple in the same order.
    """
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    f_x, f_y, f_bow = F_vsp * s_x, F_vsp * s_y, F_bow * s_bow
    return f_x, f_y + f_bow, (l_vsp + p_x) * f_y + (l_bow + p_x) * f_bow - p_y * f_x


def allocate(X: Any, Y: Any, N: Any, p: Allocation) -> tuple[Any, Any, Any]:
    """Shares of full force that give a force, before limiting: the inverse of :func:`thrust`."""
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    moment = N + p_y * X - p_x * Y
    f_bow = (moment - l_vsp * Y) / (l_bow - l_vsp)
    return X / F_vsp, (Y - f_bow) / F_vsp, f_bow / F_bow
