"""Luenberger observer with the model of the hull, (4.50)-(4.52), corrected: C(nu_hat) nu_hat.

The prediction follows the commanded force through the model; omega, which no observer knows, is taken
as zero. A measurement that is frozen or lost (see :mod:`.screen`) corrects nothing. A force that is NaN
or infinite counts as zero. The nominal hull is unstable above 0.04 m/s, so that a long loss of the
measurement ends in a wrong turn: lost for longer than ``rest_time``, the velocity fades.
"""

from typing import NamedTuple

from ..declare import Component
from ..hull import Damping, Inertia, coriolis_force, damping_force, inverse_mass
from ..ops import Number, finite
from ..signals import Estimate, Force
from .correction import Gains, Motion, State, corrected, estimated, moved
from .mdf import Inputs
from .screen import Screening, first_look, look


class Params(NamedTuple):
    gains: Gains = Gains()
    screening: Screening = Screening()
    inertia: Inertia = Inertia()
    damping: Damping = Damping()


def accelerate(m: Motion, tau: Force, p: Params, h: Number) -> Motion:
    """The velocity after h [s] of a force, by the model."""
    CX, CY, CN = coriolis_force(m.u, m.v, m.r, p.inertia)
    DX, DY, DN = damping_force(m.u, m.v, m.r, p.damping)
    i11, i22, i23, i32, i33 = inverse_mass(p.inertia)
    X = finite(tau.tau_X, 0.0) - CX + DX
    Y = finite(tau.tau_Y, 0.0) - CY + DY
    N = finite(tau.tau_N, 0.0) - CN + DN
    return m._replace(
        u=m.u + h * i11 * X, v=m.v + h * (i22 * Y + i23 * N), r=m.r + h * (i32 * Y + i33 * N)
    )


def init(i: Inputs, p: Params) -> State:
    seen = first_look(i.measurement)
    return State(seen, Motion(seen.x_m, seen.y_m, seen.psi_m))


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    ahead = moved(accelerate(s.motion, i.tau, p, h), h)
    seen, sample = look(s.seen, i.measurement, ahead.psi, p.screening, h)
    return estimated(s, seen, corrected(ahead, sample, p.gains, h), sample.good, p.gains, h)


COMPONENT = Component(
    name="observer_luenberger",
    description="Luenberger observer with the model of the hull",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Estimate,
    init=init,
    step=step,
    hold_nonfinite=False,
)
