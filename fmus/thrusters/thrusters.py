"""Thrust allocation and thrusters of CyberShip Enterprise 1, (2.10)-(2.19).

Two Voith Schneider propellers aft act as one that pushes in surge and sway, a tunnel thruster forward
pushes in sway. The allocation inverts its own model of them and limits each command to -1...1; the
forces that act come from a separate set of parameters. A request that is NaN or infinite counts as
zero.
"""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE, Component, Range
from ..hull import Triple
from ..ops import Number, clip, finite
from ..signals import Force, Velocity

# The allocation divides by forces and by the distance between the thrusters.
DIVISOR = Range(min=0.01)
AFT = Range(max=-0.01)
FORE = Range(min=0.01)


class Allocation(NamedTuple):
    """What the allocation believes of the thrusters."""

    F_vsp: Annotated[float, "N", "force per unit of VSP command", DIVISOR] = 1.165
    F_bow: Annotated[float, "N", "force per unit of bow command", DIVISOR] = 2.629
    l_vsp: Annotated[float, "m", "VSP position forward of the body origin", AFT] = -0.4575
    l_bow: Annotated[float, "m", "bow thruster position forward of the body origin", FORE] = 0.3875
    p_x: Annotated[float, "m", "assumed point of attack, forward"] = 0.0
    p_y: Annotated[float, "m", "assumed point of attack, to starboard"] = 0.0


class Plant(NamedTuple):
    """What the thrusters really do."""

    plant_F_vsp: Annotated[float, "N", "real force per unit of VSP command", POSITIVE] = 1.165
    plant_F_bow: Annotated[float, "N", "real force per unit of bow command", POSITIVE] = 2.629
    plant_l_vsp: Annotated[float, "m", "real VSP position forward of the body origin"] = -0.4575
    plant_l_bow: Annotated[float, "m", "real bow thruster position forward of the origin"] = 0.3875
    plant_p_x: Annotated[float, "m", "real point of attack, forward"] = 0.0
    plant_p_y: Annotated[float, "m", "real point of attack, to starboard"] = 0.0


class Params(NamedTuple):
    allocation: Allocation = Allocation()
    plant: Plant = Plant()


class State(NamedTuple):
    """The thrusters answer at once: nothing to remember."""


class Inputs(NamedTuple):
    request: Force = Force()
    velocity: Velocity = Velocity()


class Outputs(NamedTuple):
    u_vsp_x: Annotated[float, "1", "VSP command in surge, -1...1"] = 0.0
    u_vsp_y: Annotated[float, "1", "VSP command in sway, -1...1"] = 0.0
    u_bow: Annotated[float, "1", "bow thruster command, -1...1"] = 0.0
    tau_cmd_X: Annotated[float, "N", "requested surge force after clipping"] = 0.0
    tau_cmd_Y: Annotated[float, "N", "requested sway force after clipping"] = 0.0
    tau_cmd_N: Annotated[float, "N.m", "requested yaw moment after clipping"] = 0.0
    tau_act_X: Annotated[float, "N", "surge force that acts"] = 0.0
    tau_act_Y: Annotated[float, "N", "sway force that acts"] = 0.0
    tau_act_N: Annotated[float, "N.m", "yaw moment that acts"] = 0.0


def thrust(u_vsp_x: Number, u_vsp_y: Number, u_bow: Number, p: Allocation | Plant) -> Triple:
    """Force and moment [N, N, N m] of three commands: H(p_o) T K u, (2.15)-(2.19), corrected."""
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    f_x = F_vsp * u_vsp_x
    f_y = F_vsp * u_vsp_y
    f_bow = F_bow * u_bow
    return f_x, f_y + f_bow, (l_vsp + p_x) * f_y + (l_bow + p_x) * f_bow - p_y * f_x


def allocate(X: Number, Y: Number, N: Number, p: Allocation) -> Triple:
    """Commands that give a force, before limiting: the inverse of :func:`thrust`."""
    F_vsp, F_bow, l_vsp, l_bow, p_x, p_y = p
    moment = N + p_y * X - p_x * Y
    f_bow = (moment - l_vsp * Y) / (l_bow - l_vsp)
    return X / F_vsp, (Y - f_bow) / F_vsp, f_bow / F_bow


def init(i: Inputs, p: Params) -> State:
    return State()


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]:
    request = i.request
    raw = allocate(
        finite(request.tau_X, 0.0), finite(request.tau_Y, 0.0), finite(request.tau_N, 0.0), p.allocation
    )
    u_vsp_x, u_vsp_y, u_bow = clip(raw[0], -1.0, 1.0), clip(raw[1], -1.0, 1.0), clip(raw[2], -1.0, 1.0)
    return s, Outputs(
        u_vsp_x,
        u_vsp_y,
        u_bow,
        *thrust(u_vsp_x, u_vsp_y, u_bow, p.allocation),
        *thrust(u_vsp_x, u_vsp_y, u_bow, p.plant),
    )


COMPONENT = Component(
    name="thrusters",
    description="Thrust allocation and thrusters of CyberShip Enterprise 1",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Outputs,
    init=init,
    step=step,
    sampled=True,
    hold_nonfinite=False,
)
