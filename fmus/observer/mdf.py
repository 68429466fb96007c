"""Modified derivative filter, 4.3.2: freezes bridged, heading continuous over turns.

A measurement that is frozen or lost (see :mod:`.screen`) is replaced by the prediction (4.46): constant
velocity. A pose that is lost for longer than ``rest_time`` is predicted with fading velocity.
"""

from typing import NamedTuple

from ..declare import component
from ..frames import rotate_to_earth
from ..ops import Number, choose, where
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
from .screen import Inputs, Screening, Seen, first_look, look


class Params(NamedTuple):
    weights: Weights = Weights()
    screening: Screening = Screening()


class State(NamedTuple):
    seen: Seen = Seen()
    filter: Filtered = Filtered()
    acceleration: Acceleration = Acceleration()


def predicted(f: Filtered, keep: Number, h: Number) -> Filtered:
    """The filter after h [s] without a measurement, (4.46), with a share of its velocity."""
    u, v, r = body_velocity(f)
    psi = f.psi + h * f.psi_dot
    x_dot, y_dot = rotate_to_earth(psi, u, v)
    return Filtered(
        f.x + h * f.x_dot,
        f.y + h * f.y_dot,
        psi,
        keep * x_dot,
        keep * y_dot,
        keep * r,
    )


def init(i: Inputs, p: Params) -> State:
    seen = first_look(i.measurement)
    return State(seen, Filtered(seen.x_m, seen.y_m, seen.psi_m))


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    before = s.filter
    near = before.psi + h * before.psi_dot
    seen, sample = look(s.seen, i.measurement, near, p.screening, h)
    low_pass = weight(p.weights.b, h, p.weights.filter_period)
    keep = where(sample.overdue, 1.0 - low_pass, 1.0)
    measured = filtered(before, sample.x, sample.y, sample.psi, p.weights, h)
    after = choose(sample.good, measured, predicted(before, keep, h))
    after = choose(sample.first, Filtered(sample.x, sample.y, sample.psi), after)
    nu = body_velocity(after)
    acceleration = accelerated(s.acceleration, body_velocity(before), nu, low_pass, h)
    return State(seen, after, acceleration), Estimate(
        after.x, after.y, after.psi, *nu, *acceleration, where(sample.good, 0.0, 1.0)
    )


COMPONENT = component(
    name="observer_mdf",
    description="Modified derivative filter: freezes bridged, heading continuous",
    init=init,
    step=step,
    hold_nonfinite=False,
)
