"""Damping of a hull that is no product of speeds: one function each, named in a ship's description.

A function gets u, v and r through the water [m/s, m/s, rad/s] and then its parameters,
``name: Annotated[float, unit, description, ...] = start``, and gives the force on the hull (X, Y, N)
[N, N, N m]. It registers itself by its name.
"""

from collections.abc import Callable
from math import pi
from typing import Annotated, NamedTuple

from .declare import POSITIVE, DeclarationError
from .ops import Number, atan2, fmax, sqrt, where

Function = Callable[..., tuple[Number, Number, Number]]


class Change(NamedTuple):
    """Parameters that a ship may have otherwise than described: an effect of its own.

    Attributes:
        stem: the effect's id; of an actuator its name follows.
        parameters: that are added to.
        text: what they are.
    """

    stem: str
    parameters: tuple[str, ...]
    text: str


FUNCTIONS: dict[str, Function] = {}
CHANGES: dict[str, tuple[Change, ...]] = {}  # of each function

STRIPS = 10  # of a hull's length; the moment of a turn on the spot is within 2 % of the integral
POINTS = 15  # along a hull, its ends included, as the published model of R/V Gunnerus has them
SMALL = 1e-9  # m/s, in place of zero, by which nothing can be divided
# L r / U of the polynomial, at the most: captive tests and turning circles reach about 1; chosen.
SHARPEST = 2.0


def hull_function(*changes: Change) -> Callable[[Function], Function]:
    """Decorator that registers a function of the hull's damping, and what may be otherwise."""

    def register(function: Function) -> Function:
        taken = FUNCTIONS.get(function.__name__)
        if taken is not None and taken.__module__ == __name__:
            raise DeclarationError(f"there is a function of the hull '{function.__name__}' already")
        FUNCTIONS[function.__name__] = function
        CHANGES[function.__name__] = changes
        return function

    return register


@hull_function()
def cross_flow(
    u: Number,
    v: Number,
    r: Number,
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0,
    cross_flow_length: Annotated[
        float, "m", "length in the cross-flow, about the origin", POSITIVE
    ] = 1.0,
    cross_flow_draft: Annotated[float, "m", "draft in the cross-flow", POSITIVE] = 0.1,
    cross_flow_drag: Annotated[float, "1", "drag coefficient of a section", POSITIVE] = 0.7,
) -> tuple[Number, Number, Number]:
    """Drag of the cross-flow by strips along the hull (Faltinsen 1990; Fossen 2021, ch. 6)."""
    dx = cross_flow_length / STRIPS
    scale = -0.5 * water_density * cross_flow_drag * cross_flow_draft * dx
    Y, N = 0.0 * v, 0.0 * v
    for k in range(STRIPS):
        x = (k + 0.5) * dx - 0.5 * cross_flow_length
        speed = v + x * r
        force = scale * abs(speed) * speed
        Y, N = Y + force, N + x * force
    return 0.0 * v, Y, N


@hull_function(
    Change("cross_flow_drag", ("section_drag",), "drag of the cross-flow"),
    Change("cross_flow_distribution", ("section_tilt", "section_ends"), "cross-flow along the hull"),
)
def cross_flow_along(
    u: Number,
    v: Number,
    r: Number,
    section_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0,
    section_length: Annotated[float, "m", "length of the hull, about the origin", POSITIVE] = 1.0,
    section_draft: Annotated[float, "m", "draft of the hull", POSITIVE] = 0.1,
    section_drag: Annotated[float, "1", "drag coefficient of a section"] = 1.0,
    section_tilt: Annotated[float, "1", "relative increase forward, decrease aft"] = 0.0,
    section_ends: Annotated[float, "1", "relative increase at both ends, decrease amidships"] = 0.0,
) -> tuple[Number, Number, Number]:
    """Drag of the cross-flow at points from end to end, unevenly spread along the hull.

    The coefficient at xi = 2 x / L is C (1 + tilt xi + ends (xi^2 - 1/3)).
    """
    dx = section_length / (POINTS - 1)
    scale = -0.5 * section_density * section_draft * dx
    Y, N = 0.0 * v, 0.0 * v
    for k in range(POINTS):
        xi = 2.0 * k / (POINTS - 1) - 1.0
        x = 0.5 * section_length * xi
        speed = v + x * r
        drag = section_drag * (1.0 + section_tilt * xi + section_ends * (xi * xi - 1.0 / 3.0))
        force = scale * drag * abs(speed) * speed
        Y, N = Y + force, N + x * force
    return 0.0 * v, Y, N


@hull_function(
    Change("resistance", ("drag_ahead",), "resistance ahead"),
    Change("resistance_in_drift", ("drag_in_drift",), "resistance added by drift"),
)
def resistance(
    u: Number,
    v: Number,
    r: Number,
    drag_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0,
    drag_area: Annotated[float, "m2", "draft times beam", POSITIVE] = 1.0,
    drag_ahead: Annotated[float, "1", "coefficient of the resistance"] = 0.1,
    drag_in_drift: Annotated[float, "1/rad", "its growth with the angle of drift"] = 0.0,
) -> tuple[Number, Number, Number]:
    """Resistance that grows with the angle of drift, 1/2 rho (C + C_b |atan2(v, u)|) A |u| u."""
    coefficient = drag_ahead + drag_in_drift * abs(atan2(v, u))
    return -0.5 * drag_density * drag_area * coefficient * abs(u) * u, 0.0 * v, 0.0 * v


def swept(v: Number, turn: Number) -> tuple[Number, Number]:
    """Integrals of |s| s and of xi |s| s over -1/2 ... 1/2, s = v + turn xi; in closed form [m2/s2].

    Where s keeps its sign, s |s| is a parabola; elsewhere the place where it is zero divides the hull.
    """
    b, size, end = 0.5 * turn, abs(v), 0.5 * abs(turn)
    over = fmax(end, SMALL)
    whole = size >= end
    Y = where(whole, abs(v) * v + v * b * b / fmax(size, SMALL) / 3.0, v * (end + v * v / (3.0 * over)))
    part = end * end / 8.0 + v * v * (0.25 - v * v / (24.0 * over * over))
    return Y, where(whole, size * b / 3.0, where(turn < 0.0, -part, part))


@hull_function(
    Change("resistance", ("X_0F_prime",), "resistance ahead"),
    Change("resistance_astern", ("X_0A_prime",), "resistance astern"),
    Change("resistance_in_drift", ("X_vr_prime",), "surge force by drift and yaw"),
    Change("sway_by_drift", ("Y_v_prime",), "sway force by drift"),
    Change("yaw_by_drift", ("N_v_prime",), "yaw moment by drift"),
    Change("sway_by_yaw", ("Y_r_prime",), "sway force by the yaw rate"),
    Change("yaw_by_yaw", ("N_r_prime",), "yaw moment by the yaw rate"),
    Change("cross_flow_drag", ("C_D",), "drag of the cross-flow"),
    Change("cross_flow_yaw", ("C_rY", "C_rN"), "cross-flow by the yaw rate"),
)
def low_speed(
    u: Number,
    v: Number,
    r: Number,
    low_speed_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1000.0,
    low_speed_length: Annotated[float, "m", "length L between perpendiculars", POSITIVE] = 1.0,
    low_speed_draft: Annotated[float, "m", "draft d", POSITIVE] = 0.1,
    X_0F_prime: Annotated[float, "1", "surge force ahead, negative"] = -0.02,
    X_0A_prime: Annotated[float, "1", "the same coefficient astern"] = -0.02,
    X_vr_prime: Annotated[float, "1", "surge force, v r L"] = 0.0,
    Y_v_prime: Annotated[float, "1", "sway force, v |u|"] = 0.0,
    Y_r_prime: Annotated[float, "1", "sway force, r L u"] = 0.0,
    N_v_prime: Annotated[float, "1", "yaw moment, v u"] = 0.0,
    N_r_prime: Annotated[float, "1", "yaw moment, r L |u|"] = 0.0,
    C_D: Annotated[float, "1", "drag coefficient of the cross-flow"] = 1.0,
    C_rY: Annotated[float, "1", "factor of the yaw rate in the cross-flow's sway force"] = 1.0,
    C_rN: Annotated[float, "1", "factor of the yaw rate in the cross-flow's yaw moment"] = 1.0,
) -> tuple[Number, Number, Number]:
    """Hull at low speed and on the spot (Yoshimura 1988; Miyauchi et al. 2022), in prime units.

    X = [X_0F + (X_0A - X_0F) |beta| / pi] u U + X_vr v r L, beta = atan2(v, u). Across, products of
    speeds, and the cross-flow, in which the yaw rate counts C_rY and C_rN times. Nothing is divided by
    the speed.
    """
    turn = low_speed_length * r
    resistance = X_0F_prime + (X_0A_prime - X_0F_prime) * abs(atan2(v, u)) / pi
    X = resistance * u * sqrt(u * u + v * v) + X_vr_prime * v * turn
    Y = Y_v_prime * v * abs(u) + Y_r_prime * turn * u - C_D * swept(v, C_rY * turn)[0]
    N = N_v_prime * v * u + N_r_prime * turn * abs(u) - C_D * swept(v, C_rN * turn)[1]
    force = 0.5 * low_speed_density * low_speed_length * low_speed_draft
    return force * X, force * Y, force * low_speed_length * N


@hull_function(
    Change("resistance", ("R_0_prime",), "resistance ahead"),
    Change("resistance_in_drift", ("X_vv_prime", "X_vr_prime"), "surge force by drift"),
    Change("asymmetry", ("Y_0_prime", "N_0_prime"), "asymmetry of port and starboard"),
    Change("sway_by_drift", ("Y_v_prime", "Y_vvv_prime"), "sway force by drift"),
    Change("yaw_by_drift", ("N_v_prime", "N_vvv_prime"), "yaw moment by drift"),
    Change("sway_by_yaw", ("Y_r_prime", "Y_rrr_prime"), "sway force by the yaw rate"),
    Change("yaw_by_yaw", ("N_r_prime", "N_rrr_prime"), "yaw moment by the yaw rate"),
)
def drift_polynomial(
    u: Number,
    v: Number,
    r: Number,
    polynomial_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1000.0,
    polynomial_length: Annotated[float, "m", "length L between perpendiculars", POSITIVE] = 1.0,
    polynomial_draft: Annotated[float, "m", "draft d", POSITIVE] = 0.1,
    R_0_prime: Annotated[float, "1", "resistance ahead"] = 0.0,
    X_vv_prime: Annotated[float, "1", "surge force, v'^2"] = 0.0,
    X_vr_prime: Annotated[float, "1", "surge force, v' r'"] = 0.0,
    X_rr_prime: Annotated[float, "1", "surge force, r'^2"] = 0.0,
    X_vvvv_prime: Annotated[float, "1", "surge force, v'^4"] = 0.0,
    Y_0_prime: Annotated[float, "1", "sway force ahead, of an asymmetric hull"] = 0.0,
    Y_v_prime: Annotated[float, "1", "sway force, v'"] = 0.0,
    Y_r_prime: Annotated[float, "1", "sway force, r'"] = 0.0,
    Y_vvv_prime: Annotated[float, "1", "sway force, v'^3"] = 0.0,
    Y_vvr_prime: Annotated[float, "1", "sway force, v'^2 r'"] = 0.0,
    Y_vrr_prime: Annotated[float, "1", "sway force, v' r'^2"] = 0.0,
    Y_rrr_prime: Annotated[float, "1", "sway force, r'^3"] = 0.0,
    N_0_prime: Annotated[float, "1", "yaw moment ahead, of an asymmetric hull"] = 0.0,
    N_v_prime: Annotated[float, "1", "yaw moment, v'"] = 0.0,
    N_r_prime: Annotated[float, "1", "yaw moment, r'"] = 0.0,
    N_vvv_prime: Annotated[float, "1", "yaw moment, v'^3"] = 0.0,
    N_vvr_prime: Annotated[float, "1", "yaw moment, v'^2 r'"] = 0.0,
    N_vrr_prime: Annotated[float, "1", "yaw moment, v' r'^2"] = 0.0,
    N_rrr_prime: Annotated[float, "1", "yaw moment, r'^3"] = 0.0,
) -> tuple[Number, Number, Number]:
    """Hull of the MMG standard method (Yasukawa and Yoshimura 2015), in prime units.

    Forces over 1/2 rho L d U^2, the moment over 1/2 rho L^2 d U^2, v' = v / U, r' = r L / U. The powers
    above the second are those of v' and r' within what was measured: U in them is at least L |r| / 2.
    """
    turn = polynomial_length * r
    speed = sqrt(u * u + v * v)
    over = fmax(fmax(speed, abs(turn) / SHARPEST), SMALL)
    vv, vr, rr = v * v, v * turn, turn * turn
    X = where(u < 0.0, R_0_prime, -R_0_prime) * speed * speed
    X = X + X_vv_prime * vv + X_vr_prime * vr + X_rr_prime * rr + X_vvvv_prime * vv * vv / (over * over)

    def across(
        c_0: Number, c_v: Number, c_r: Number, vvv: Number, vvr: Number, vrr: Number, rrr: Number
    ) -> Number:
        linear = (c_v * v + c_r * turn) * speed
        cubic = ((vvv * v + vvr * turn) * vv + (vrr * v + rrr * turn) * rr) / over
        return c_0 * u * abs(u) + linear + cubic

    Y = across(Y_0_prime, Y_v_prime, Y_r_prime, Y_vvv_prime, Y_vvr_prime, Y_vrr_prime, Y_rrr_prime)
    N = across(N_0_prime, N_v_prime, N_r_prime, N_vvv_prime, N_vvr_prime, N_vrr_prime, N_rrr_prime)
    force = 0.5 * polynomial_density * polynomial_length * polynomial_draft
    return force * X, force * Y, force * polynomial_length * N
