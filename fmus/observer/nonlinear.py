"""Nonlinear observer on kinematics alone, (4.47)-(4.49).

It predicts constant body-fixed velocity and corrects by the error of the pose. A measurement that is
frozen or lost (see :mod:`.screen`) corrects nothing; lost for longer than ``rest_time``, the velocity
fades.
"""

from typing import NamedTuple

from ..declare import component
from ..ops import Number
from ..signals import Estimate
from .correction import CorrectionGains, State, corrected, estimated, moved, start
from .screen import Inputs, Screening, look


class Params(NamedTuple):
    gains: CorrectionGains = CorrectionGains()
    screening: Screening = Screening()


def init(i: Inputs, p: Params) -> State:
    return start(i)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    ahead = moved(s.motion, h)
    seen, sample = look(s.seen, i.measurement, ahead.psi, p.screening, h)
    return estimated(s, seen, corrected(ahead, sample, p.gains, h), sample.good, p.gains, h)


COMPONENT = component(
    name="observer_nonlinear",
    description="Nonlinear observer of the kinematics without a ship model",
    init=init,
    step=step,
    hold_nonfinite=False,
)
