"""Luenberger observer with the model of the hull, (4.50)-(4.52), corrected: C(nu_hat) nu_hat.

The prediction follows the commanded force through the model; omega, which no observer knows, is taken
as zero. A measurement that is frozen or lost (see :mod:`.screen`) corrects nothing. A force that is NaN
or infinite counts as zero. The nominal hull is unstable above 0.04 m/s, so that a long loss of the
measurement ends in a wrong turn: lost for longer than ``rest_time``, the velocity fades.
"""

from typing import NamedTuple

from ..declare import component
from ..hull import Damping, Hull, Inertia, inverse_mass, motion
from ..ops import Number
from ..signals import Estimate, Force
from .correction import CorrectionGains, MotionState, State, corrected, estimated, moved, start
from .screen import Inputs, Screening, limited, look


class Params(NamedTuple):
    gains: CorrectionGains = CorrectionGains()
    screening: Screening = Screening()
    inertia: Inertia = Inertia()
    damping: Damping = Damping()


def accelerate(m: MotionState, tau: Force, p: Params, h: Number) -> MotionState:
    """The velocity after h [s] of a force, by the model."""
    hull = Hull(p.inertia, inverse_mass(p.inertia), p.damping)
    u_dot, v_dot, r_dot = motion(m.u, m.v, m.r, limited(tau), hull)
    return m._replace(u=m.u + h * u_dot, v=m.v + h * v_dot, r=m.r + h * r_dot)


def init(i: Inputs, p: Params) -> State:
    return start(i)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    ahead = moved(accelerate(s.motion, i.tau, p, h), h)
    seen, sample = look(s.seen, i.measurement, ahead.psi, p.screening, h)
    return estimated(s, seen, corrected(ahead, sample, p.gains, h), sample.good, p.gains, h)


COMPONENT = component(
    name="observer_luenberger",
    description="Luenberger observer with the model of the hull",
    init=init,
    step=step,
    hold_nonfinite=False,
    held=("tau_X", "tau_Y", "tau_N"),
)
