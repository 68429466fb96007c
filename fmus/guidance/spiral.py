"""Guidance of a direct spiral: the order goes in plateaus from side to side and back; no inputs.

From the full order of the first side through 0 to the other side and back, ``plateaus`` steps from full
to none, each held for ``hold`` seconds until the rate is steady (ISO 13643-3:2017; J. Dieudonne 1953).
A ship that keeps no course shows a loop: at small orders two rates, by the side that it came from.
"""

from typing import Annotated, NamedTuple

from ..declare import Range, component
from ..ops import Number, clip, floor, where
from ..signals import Nothing
from .trial_order import ANGLE, HARD_OVER, START, Helm, Order, TrialTime, begun, first_side, given


class Params(NamedTuple):
    start: START = 20.0
    angle: ANGLE = HARD_OVER
    plateaus: Annotated[
        float, "1", "number of plateaus from the full order to none", Range(1.0, 50.0)
    ] = 5.0
    hold: Annotated[float, "s", "duration of a plateau", Range(min=0.1)] = 60.0
    helm: Helm = Helm()


def init(i: Nothing, p: Params) -> TrialTime:
    return TrialTime()


def step(s: TrialTime, i: Nothing, p: Params, h: Number) -> tuple[TrialTime, Order]:
    t = s.t + h
    plateau = clip(floor((t - p.start + 0.5 * h) / p.hold), 0.0, 4.0 * p.plateaus)
    order = first_side(p.helm) * (abs(plateau / p.plateaus - 2.0) - 1.0)
    return TrialTime(t), given(where(begun(t, p.start, h), order, 0.0), p.angle, p.helm)


COMPONENT = component(
    name="guidance_spiral",
    description="Direct spiral: an order that changes in plateaus to the other side and back",
    init=init,
    step=step,
    trial="spiral",
)
