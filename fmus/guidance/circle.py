"""Guidance of a turning circle: after a steady approach the order is put over and held; no inputs.

35 degrees of rudder, or all that is permitted, to either side (IMO, MSC.137(76), 4.2.1; ISO
13643-2:2017). With ``release`` it ends as a pull-out: that long after the first execute the order is
taken back, and the rate that remains tells whether the ship is stable (ISO 13643-3:2017).
"""

from typing import Annotated, NamedTuple

from ..declare import POSITIVE, component
from ..ops import Number, where
from ..signals import Nothing
from .trial_order import ANGLE, HARD_OVER, START, Helm, Order, TrialTime, begun, first_side, given


class Params(NamedTuple):
    start: START = 20.0
    angle: ANGLE = HARD_OVER
    release: Annotated[float, "s", "time from execute to pull-out; 0: none", POSITIVE] = 0.0
    helm: Helm = Helm()


def init(i: Nothing, p: Params) -> TrialTime:
    return TrialTime()


def step(s: TrialTime, i: Nothing, p: Params, h: Number) -> tuple[TrialTime, Order]:
    t = s.t + h
    out = (p.release > 0.0) & begun(t, p.start + p.release, h)
    order = where(begun(t, p.start, h), where(out, 0.0, first_side(p.helm)), 0.0)
    return TrialTime(t), given(order, p.angle, p.helm)


COMPONENT = component(
    name="guidance_circle",
    description="Turning circle: an order that is held, with or without a pull-out",
    init=init,
    step=step,
    trial="circle",
)
