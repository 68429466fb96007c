"""Nonlinear observer on kinematics alone, (4.47)-(4.49).

It predicts constant body-fixed velocity and corrects by the error of the pose. A measurement that is
frozen or lost (see :mod:`.screen`) corrects nothing; lost for longer than ``rest_time``, the velocity
fades.
"""

from typing import NamedTuple

from ..declare import Component
from ..ops import Number
from ..signals import Estimate
from .correction import Gains, Motion, State, corrected, estimated, moved
from .mdf import Inputs
from .screen import Screening, first_look, look


class Params(NamedTuple):
    gains: Gains = Gains()
    screening: Screening = Screening()


def init(i: Inputs, p: Params) -> State:
    seen = first_look(i.measurement)
    return State(seen, Motion(seen.x_m, seen.y_m, seen.psi_m))


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    ahead = moved(s.motion, h)
    seen, sample = look(s.seen, i.measurement, ahead.psi, p.screening, h)
    return estimated(s, seen, corrected(ahead, sample, p.gains, h), sample.good, p.gains, h)


COMPONENT = Component(
    name="observer_nonlinear",
    description="Nonlinear observer on kinematics alone",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Estimate,
    init=init,
    step=step,
    hold_nonfinite=False,
)
