"""The hull of CyberShip Enterprise 1 in surge, sway and yaw, (2.1)-(2.9).

Integrated by the classical fourth-order Runge-Kutta method with the force held over the step; a
communication step above 0.02 s is divided. A force input that is NaN or infinite acts as zero.
"""

from operator import add
from typing import Annotated, Any, NamedTuple

from ..declare import FIXED, Component, variables, vector
from ..frames import rotate_to_earth
from ..hull import (
    Damping,
    ExtraDamping,
    Hull,
    Inertia,
    RotationalDamping,
    TowedDamping,
    damping_force,
    inverse_mass,
    motion,
    rotational_damping_force,
)
from ..ops import Number, finite, wrap
from ..signals import Force, Measurement, Velocity


def _changes(coefficients: type[Any]) -> type[Any]:
    """Additions to a group of coefficients, as parameters ``delta_<coefficient>``."""
    return vector(
        f"{coefficients.__name__}Change",
        [
            (f"delta_{c.name}", c.unit, f"addition to {c.name}: a model error", 0.0)
            for c in variables(coefficients)
        ],
    )


TowedChange = _changes(TowedDamping)
RotationalChange = _changes(RotationalDamping)
ExtraChange = _changes(ExtraDamping)


class DampingChange(NamedTuple):
    """Additions to all damping coefficients, in the order of Damping."""

    towed: Any = TowedChange()
    rotational: Any = RotationalChange()
    extra: Any = ExtraChange()


class Start(NamedTuple):
    """State at the start of the simulation."""

    x_0: Annotated[float, "m", "initial north position", FIXED] = 5.0
    y_0: Annotated[float, "m", "initial east position", FIXED] = 2.0
    psi_0: Annotated[float, "rad", "initial heading", FIXED] = 0.0
    u_0: Annotated[float, "m/s", "initial surge velocity", FIXED] = 0.0
    v_0: Annotated[float, "m/s", "initial sway velocity", FIXED] = 0.0
    r_0: Annotated[float, "rad/s", "initial yaw rate", FIXED] = 0.0


class Params(NamedTuple):
    inertia: Inertia = Inertia()
    damping: Damping = Damping()
    change: DampingChange = DampingChange()
    start: Start = Start()


class State(NamedTuple):
    """eta and nu; the heading is continuous over turns."""

    x: float = 0.0
    y: float = 0.0
    psi: float = 0.0
    u: float = 0.0
    v: float = 0.0
    r: float = 0.0


class Pose(NamedTuple):
    x: Annotated[float, "m", "north position"] = 0.0
    y: Annotated[float, "m", "east position"] = 0.0
    psi: Annotated[float, "rad", "heading, continuous over turns"] = 0.0


class Outputs(NamedTuple):
    pose: Pose = Pose()
    velocity: Velocity = Velocity()
    u_dot: Annotated[float, "m/s2", "surge acceleration"] = 0.0
    v_dot: Annotated[float, "m/s2", "sway acceleration"] = 0.0
    r_dot: Annotated[float, "rad/s2", "yaw acceleration"] = 0.0
    measured: Measurement = Measurement()
    omega_X: Annotated[float, "N", "all model error in surge"] = 0.0
    omega_Y: Annotated[float, "N", "all model error in sway"] = 0.0
    omega_N: Annotated[float, "N.m", "all model error in yaw"] = 0.0
    omega_star_X: Annotated[float, "N", "what control model (2.27) lacks in surge"] = 0.0
    omega_star_Y: Annotated[float, "N", "what control model (2.27) lacks in sway"] = 0.0
    omega_star_N: Annotated[float, "N.m", "what control model (2.27) lacks in yaw"] = 0.0


def total_damping(p: Params) -> Damping:
    """The nominal damping coefficients plus their changes."""
    nominal, change = p.damping, p.change
    return Damping(
        TowedDamping._make(map(add, nominal.towed, change.towed)),
        RotationalDamping._make(map(add, nominal.rotational, change.rotational)),
        ExtraDamping._make(map(add, nominal.extra, change.extra)),
    )


def hull(p: Params) -> Hull:
    """The hull with the changes of its damping applied."""
    return Hull(p.inertia, inverse_mass(p.inertia), total_damping(p))


def integrate(s: State, tau: Force, b: Hull, h: Number) -> State:
    """State after h [s] of constant force by one step of the classical Runge-Kutta method."""
    x, y, psi, u, v, r = s
    half = 0.5 * h
    x1, y1 = rotate_to_earth(psi, u, v)
    u1, v1, r1 = motion(u, v, r, tau, b)
    ub, vb, rb = u + half * u1, v + half * v1, r + half * r1
    x2, y2 = rotate_to_earth(psi + half * r, ub, vb)
    u2, v2, r2 = motion(ub, vb, rb, tau, b)
    uc, vc, rc = u + half * u2, v + half * v2, r + half * r2
    x3, y3 = rotate_to_earth(psi + half * rb, uc, vc)
    u3, v3, r3 = motion(uc, vc, rc, tau, b)
    ud, vd, rd = u + h * u3, v + h * v3, r + h * r3
    x4, y4 = rotate_to_earth(psi + h * rc, ud, vd)
    u4, v4, r4 = motion(ud, vd, rd, tau, b)
    sixth = h / 6.0
    return State(
        x + sixth * (x1 + 2.0 * (x2 + x3) + x4),
        y + sixth * (y1 + 2.0 * (y2 + y3) + y4),
        psi + sixth * (r + 2.0 * (rb + rc) + rd),
        u + sixth * (u1 + 2.0 * (u2 + u3) + u4),
        v + sixth * (v1 + 2.0 * (v2 + v3) + v4),
        r + sixth * (r1 + 2.0 * (r2 + r3) + r4),
    )


def init(i: Force, p: Params) -> State:
    return State._make(p.start)


def step(s: State, i: Force, p: Params, h: Number) -> tuple[State, Outputs]:
    tau = Force(finite(i.tau_X, 0.0), finite(i.tau_Y, 0.0), finite(i.tau_N, 0.0))
    b = hull(p)
    s = integrate(s, tau, b, h)
    x, y, psi, u, v, r = s
    omega_X, omega_Y, omega_N = damping_force(u, v, r, p.change)
    _, phi_Y, phi_N = rotational_damping_force(v, r, p.damping.rotational)
    return s, Outputs(
        Pose(x, y, psi),
        Velocity(u, v, r),
        *motion(u, v, r, tau, b),
        Measurement(x, y, wrap(psi)),
        omega_X,
        omega_Y,
        omega_N,
        omega_X,
        omega_Y + phi_Y,
        omega_N + phi_N,
    )


COMPONENT = Component(
    name="vessel",
    description="Hull of CyberShip Enterprise 1 in surge, sway and yaw",
    params=Params,
    state=State,
    inputs=Force,
    outputs=Outputs,
    init=init,
    step=step,
    sampled=False,
    max_step=0.02,
    hold_nonfinite=False,
)
