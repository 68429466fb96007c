"""Observers that predict and correct, 4.3.3 and 4.3.4: what the two of the thesis share."""

from typing import Annotated, NamedTuple

from ..declare import Range
from ..frames import rotate_to_body, rotate_to_earth
from ..ops import Condition, Number, clip, where
from ..signals import Estimate
from .derivative import FRACTION, Acceleration, accelerated, weight
from .screen import Inputs, ScreenedSample, Seen, first_look

GAIN = Range(0.0, 50.0)


class CorrectionGains(NamedTuple):
    """K_1 and K_2, limits of the velocity, and the filter of the acceleration."""

    k1_x: Annotated[float, "1/s", "correction of the north position", GAIN] = 6.0
    k1_y: Annotated[float, "1/s", "correction of the east position", GAIN] = 6.0
    k1_psi: Annotated[float, "1/s", "correction of the heading", GAIN] = 6.0
    k2_u: Annotated[float, "1/s2", "correction of the surge velocity", GAIN] = 9.0
    k2_v: Annotated[float, "1/s2", "correction of the sway velocity", GAIN] = 9.0
    k2_r: Annotated[float, "1/s2", "correction of the yaw rate", GAIN] = 9.0
    u_max: Annotated[float, "m/s", "upper limit of a plausible velocity", Range(0.0, 100.0)] = 2.0
    r_max: Annotated[float, "rad/s", "upper limit of a plausible yaw rate", Range(0.0, 100.0)] = 5.0
    b: Annotated[float, "1", "weight of a new acceleration in its filter", FRACTION] = 0.05
    filter_period: Annotated[float, "s", "sampling period of b", Range(1e-6)] = 0.01


class MotionState(NamedTuple):
    """Pose, heading continuous over turns, and body-fixed velocity."""

    x: Number = 0.0
    y: Number = 0.0
    psi: Number = 0.0
    u: Number = 0.0
    v: Number = 0.0
    r: Number = 0.0


class State(NamedTuple):
    seen: Seen = Seen()
    motion: MotionState = MotionState()
    acceleration: Acceleration = Acceleration()


def start(i: Inputs) -> State:
    """At rest where the first sample shows the ship."""
    seen = first_look(i.measurement)
    return State(seen, MotionState(seen.x_m, seen.y_m, seen.psi_m))


def moved(m: MotionState, h: Number) -> MotionState:
    """The pose after h [s] at the present velocity, (4.47)."""
    x_dot, y_dot = rotate_to_earth(m.psi, m.u, m.v)
    return m._replace(x=m.x + h * x_dot, y=m.y + h * y_dot, psi=m.psi + h * m.r)


def corrected(m: MotionState, s: ScreenedSample, k: CorrectionGains, h: Number) -> MotionState:
    """A prediction corrected by a good sample, (4.48); by any other, nothing but a fading velocity."""
    dx, dy, dpsi = s.x - m.x, s.y - m.y, s.psi - m.psi
    ahead, aside = rotate_to_body(m.psi, dx, dy)
    gain = where(s.good, h, 0.0)
    # With nothing to correct it for long, a velocity is worth less and less.
    keep = where(s.overdue, 1.0 - weight(k.b, h, k.filter_period), 1.0)
    on = MotionState(
        m.x + gain * k.k1_x * dx,
        m.y + gain * k.k1_y * dy,
        m.psi + gain * k.k1_psi * dpsi,
        # A spike may not throw the velocity to where the model of the damping overflows.
        clip(keep * m.u + gain * k.k2_u * ahead, -k.u_max, k.u_max),
        clip(keep * m.v + gain * k.k2_v * aside, -k.u_max, k.u_max),
        clip(keep * m.r + gain * k.k2_r * dpsi, -k.r_max, k.r_max),
    )
    return MotionState(
        where(s.first, s.x, on.x),
        where(s.first, s.y, on.y),
        where(s.first, s.psi, on.psi),
        where(s.first, 0.0, on.u),
        where(s.first, 0.0, on.v),
        where(s.first, 0.0, on.r),
    )


def estimated(
    s: State, seen: Seen, after: MotionState, good: Condition, k: CorrectionGains, h: Number
) -> tuple[State, Estimate]:
    """State and outputs after a step that ends in ``after``."""
    nu = (after.u, after.v, after.r)
    b = weight(k.b, h, k.filter_period)
    before = (s.motion.u, s.motion.v, s.motion.r)
    acceleration = accelerated(s.acceleration, before, nu, b, h)
    return State(seen, after, acceleration), Estimate(
        after.x, after.y, after.psi, *nu, *acceleration, where(good, 0.0, 1.0)
    )
