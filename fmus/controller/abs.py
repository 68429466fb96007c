"""Adaptive backstepping, 4.1.1: the rotational damping and an earth-fixed force are estimated, (4.18).

An input that is NaN or infinite keeps its last finite value. With ``hold_frozen`` = 1 nothing is
learned while the observer says that its measurement is frozen.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import FIXED, Component, Range, variables, vector
from ..frames import rotate_to_body, rotate_to_earth
from ..hull import RotationalDamping, rotational_regressors
from ..ops import Number, where
from .backstepping import (
    GAIN,
    Belief,
    Errors,
    Gains,
    Inputs,
    Outputs,
    PhiHat,
    PhiStart,
    control,
    control_errors,
)

# Table 5.1, in the order of (2.31).
GAMMA = (8.0, 4.0, 8.0, 8.0, 8.0, 4.0, 8.0, 8.0)

Gamma = vector(
    "Gamma",
    [
        (f"gamma_{k}", "1", f"adaptation gain of {c.name}", gain)
        for k, (c, gain) in enumerate(zip(variables(RotationalDamping), GAMMA, strict=True), 1)
    ],
    [GAIN],
)


class Disturbance(NamedTuple):
    """Adaptation to a constant earth-fixed force omega_n: off unless a gain is set."""

    gamma_omega_x: Annotated[float, "1/m", "adaptation gain of the north force", GAIN] = 0.0
    gamma_omega_y: Annotated[float, "1/m", "adaptation gain of the east force", GAIN] = 0.0
    gamma_omega_psi: Annotated[float, "1", "adaptation gain of the yaw moment", GAIN] = 0.0


class Params(NamedTuple):
    gains: Gains = Gains()
    belief: Belief = Belief()
    phi: Any = PhiStart()
    gamma: Any = Gamma()
    disturbance: Disturbance = Disturbance()
    hold_frozen: Annotated[float, "1", "1: do not adapt while frozen", FIXED, Range(0.0, 1.0)] = 0.0


class State(NamedTuple):
    phi_hat: Any = PhiHat()
    omega_x: float = 0.0
    omega_y: float = 0.0
    omega_psi: float = 0.0


def phi_rate(z: Errors, v: Number, r: Number, gamma: Any) -> list[Any]:
    """d phi_hat / dt = -Gamma Phi^T(nu) z2, (4.18); Phi holds minus the regressors."""
    regressors = rotational_regressors(v, r)
    by_axis = [f * z.z2_v for f in regressors] + [f * z.z2_r for f in regressors]
    return [g * f for g, f in zip(gamma, by_axis, strict=True)]


def init(i: Inputs, p: Params) -> State:
    return State(PhiHat._make(p.phi))


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Outputs]:
    e = i.estimate
    z, alpha_dot = control_errors(e, i.target, p.gains)
    dt = where((e.frozen > 0.5) & (p.hold_frozen > 0.5), 0.0, h)
    rates = phi_rate(z, e.v_hat, e.r_hat, p.gamma)
    z2_north, z2_east = rotate_to_earth(e.psi_hat, z.z2_u, z.z2_v)
    d = p.disturbance
    s = State(
        PhiHat._make([value + dt * rate for value, rate in zip(s.phi_hat, rates, strict=True)]),
        s.omega_x + dt * d.gamma_omega_x * z2_north,
        s.omega_y + dt * d.gamma_omega_y * z2_east,
        s.omega_psi + dt * d.gamma_omega_psi * z.z2_r,
    )
    w = (*rotate_to_body(e.psi_hat, s.omega_x, s.omega_y), s.omega_psi)
    return s, control(e, z, alpha_dot, p.gains, p.belief, s.phi_hat, w)


COMPONENT = Component(
    name="controller_abs",
    description="Adaptive backstepping controller",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Outputs,
    init=init,
    step=step,
)
