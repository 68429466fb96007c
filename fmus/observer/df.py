"""Derivative filter as before the thesis, (4.45): it knows neither freezes nor turns of the heading.

A freeze looks like a ship that stands still, its end like a jump, and a heading that crosses pi like a
turn. Only a sample that is NaN or infinite is left out, and the last one taken in its place.
"""

from typing import NamedTuple

from ..declare import component
from ..ops import Number, choose, is_finite, where
from ..signals import Estimate
from .derivative import (
    Acceleration,
    Filtered,
    Weights,
    accelerated,
    body_velocity,
    filtered,
    weight,
)
from .screen import Inputs


class State(NamedTuple):
    started: Number = 0.0
    x_m: Number = 0.0
    y_m: Number = 0.0
    psi_m: Number = 0.0
    filter: Filtered = Filtered()
    acceleration: Acceleration = Acceleration()


def init(i: Inputs, p: Weights) -> State:
    m = i.measurement
    there = is_finite(m.x_m + m.y_m + m.psi_m)
    pose = Filtered(where(there, m.x_m, 0.0), where(there, m.y_m, 0.0), where(there, m.psi_m, 0.0))
    return State(where(there, 1.0, 0.0), pose.x, pose.y, pose.psi, pose)


def step(s: State, i: Inputs, p: Weights, h: Number) -> tuple[State, Estimate]:
    m = i.measurement
    there = is_finite(m.x_m + m.y_m + m.psi_m)
    x, y, psi = where(there, m.x_m, s.x_m), where(there, m.y_m, s.y_m), where(there, m.psi_m, s.psi_m)
    first = there & (s.started < 0.5)
    after = choose(first, Filtered(x, y, psi), filtered(s.filter, x, y, psi, p, h))
    nu = body_velocity(after)
    b = weight(p.b, h, p.filter_period)
    acceleration = accelerated(s.acceleration, body_velocity(s.filter), nu, b, h)
    state = State(where(there, 1.0, s.started), x, y, psi, after, acceleration)
    return state, Estimate(after.x, after.y, after.psi, *nu, *acceleration, 0.0)


COMPONENT = component(
    name="observer_df",
    description="Derivative filter without freeze and wrap handling",
    init=init,
    step=step,
    hold_nonfinite=False,
)
