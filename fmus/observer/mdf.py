"""Modified derivative filter, 4.3.2: pose filtered, differentiated, filtered again.

A measurement that is frozen (all three channels identical to the bit for a measurement period or
longer) or lost (NaN, infinite, or exactly zero in all three channels) is replaced by the prediction
(4.46): constant velocity. A pose that stays identical for longer than ``rest_time`` is taken to be
true: the ship lies still; one that is lost for longer is predicted with fading velocity. The heading
is made continuous over turns. The filter constants a and b belong to ``filter_period`` and are
converted, so that another step size gives the same filter.
"""

from typing import Annotated, NamedTuple

from ..declare import Component, Range
from ..ops import TWO_PI, Number, cos, exp, floor, is_finite, log, not_, sin, where
from ..signals import Estimate, Force, Measurement

FRACTION = Range(0.0, 0.999999)


class Params(NamedTuple):
    a: Annotated[float, "1", "weight of a new pose in the position filter", FRACTION] = 0.08
    b: Annotated[float, "1", "weight of a new rate in the velocity filter", FRACTION] = 0.05
    filter_period: Annotated[float, "s", "sampling period that a and b belong to", Range(1e-6)] = 0.01
    measurement_period: Annotated[float, "s", "time between new measurements", Range(1e-6)] = 0.01
    rest_time: Annotated[float, "s", "an identical pose for longer means rest", Range(0.0)] = 3.0


class Inputs(NamedTuple):
    measurement: Measurement = Measurement()
    tau: Force = Force()


class State(NamedTuple):
    """Filter memory: filtered pose and earth-fixed rates, body acceleration, last raw sample."""

    started: float = 0.0
    age: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    psi_m: float = 0.0
    x: float = 0.0
    y: float = 0.0
    psi: float = 0.0
    x_dot: float = 0.0
    y_dot: float = 0.0
    psi_dot: float = 0.0
    u_dot: float = 0.0
    v_dot: float = 0.0
    r_dot: float = 0.0


def present(m: Measurement) -> Number:
    """Whether a sample is a measurement at all: finite and not (0, 0, 0)."""
    zero = (m.x_m == 0.0) & (m.y_m == 0.0) & (m.psi_m == 0.0)
    return is_finite(m.x_m + m.y_m + m.psi_m) & not_(zero)


def unwrap(psi_m: Number, near: Number) -> Number:
    """The measured heading plus the whole turns that bring it closest to ``near`` [rad]."""
    return psi_m + TWO_PI * floor((near - psi_m) / TWO_PI + 0.5)


def weight(a: Number, h: Number, period: Number) -> Number:
    """Weight of a new sample at step h in a first-order filter that has weight a at ``period``."""
    return 1.0 - exp(log(1.0 - a) * h / period)


def body_velocity(s: State) -> tuple[Number, Number]:
    """Surge and sway velocity of the filtered earth-fixed rates, (4.45)."""
    c = cos(s.psi)
    n = sin(s.psi)
    return c * s.x_dot + n * s.y_dot, c * s.y_dot - n * s.x_dot


def init(i: Inputs, p: Params) -> State:
    m = i.measurement
    first = present(m)
    x, y, psi = where(first, m.x_m, 0.0), where(first, m.y_m, 0.0), where(first, m.psi_m, 0.0)
    return State(started=where(first, 1.0, 0.0), x_m=x, y_m=y, psi_m=psi, x=x, y=y, psi=psi)


def step(s: State, i: Inputs, p: Params, h: Number) -> tuple[State, Estimate]:
    m = i.measurement
    here = present(m)
    same = (m.x_m == s.x_m) & (m.y_m == s.y_m) & (m.psi_m == s.psi_m)
    age = where(here & not_(same), 0.0, s.age + h)
    frozen = same & (age > p.measurement_period - 0.5 * h) & (age < p.rest_time)
    # At h = 0 nothing has had time to freeze; a lost sample is lost at any step.
    frozen = frozen & (h > 0.0)
    good = here & not_(frozen)
    first = good & (s.started < 0.5)

    # A lost sample must not reach the arithmetic: NaN times zero is NaN.
    x_m, y_m = where(here, m.x_m, s.x_m), where(here, m.y_m, s.y_m)
    psi_m = where(here, m.psi_m, s.psi_m)
    psi_m = where(first, psi_m, unwrap(psi_m, s.psi + h * s.psi_dot))

    low_pass = weight(p.b, h, p.filter_period)
    a = where(good, weight(p.a, h, p.filter_period), 0.0)
    b = where(good, low_pass, 0.0)
    rate = a / where(h > 0.0, h, 1.0)
    keep = where(age > p.rest_time, 1.0 - low_pass, 1.0)
    u, v = body_velocity(s)
    # The prediction (4.46) moves the pose at constant body-fixed velocity.
    x_pred, y_pred, psi_pred = s.x + h * s.x_dot, s.y + h * s.y_dot, s.psi + h * s.psi_dot
    c, n = cos(psi_pred), sin(psi_pred)
    after = State(
        started=where(here, 1.0, s.started),
        age=age,
        x_m=x_m,
        y_m=y_m,
        psi_m=where(here, m.psi_m, s.psi_m),
        x=where(first, x_m, where(good, s.x + a * (x_m - s.x), x_pred)),
        y=where(first, y_m, where(good, s.y + a * (y_m - s.y), y_pred)),
        psi=where(first, psi_m, where(good, s.psi + a * (psi_m - s.psi), psi_pred)),
        x_dot=where(
            first,
            0.0,
            where(good, s.x_dot + b * (rate * (x_m - s.x) - s.x_dot), keep * (c * u - n * v)),
        ),
        y_dot=where(
            first,
            0.0,
            where(good, s.y_dot + b * (rate * (y_m - s.y) - s.y_dot), keep * (n * u + c * v)),
        ),
        psi_dot=where(
            first,
            0.0,
            where(good, s.psi_dot + b * (rate * (psi_m - s.psi) - s.psi_dot), keep * s.psi_dot),
        ),
    )
    u_new, v_new = body_velocity(after)
    per_h = 1.0 / where(h > 0.0, h, 1.0)
    after = after._replace(
        u_dot=s.u_dot + low_pass * ((u_new - u) * per_h - s.u_dot),
        v_dot=s.v_dot + low_pass * ((v_new - v) * per_h - s.v_dot),
        r_dot=s.r_dot + low_pass * ((after.psi_dot - s.psi_dot) * per_h - s.r_dot),
    )
    return after, Estimate(
        after.x,
        after.y,
        after.psi,
        u_new,
        v_new,
        after.psi_dot,
        after.u_dot,
        after.v_dot,
        after.r_dot,
        where(good, 0.0, 1.0),
    )


COMPONENT = Component(
    name="observer_mdf",
    description="Modified derivative filter: freezes bridged, heading continuous",
    params=Params,
    state=State,
    inputs=Inputs,
    outputs=Estimate,
    init=init,
    step=step,
    hold_nonfinite=False,
)
