"""The derivative filter, (4.45): pose filtered, differentiated, and the rates filtered again."""

from typing import Annotated, NamedTuple

from ..declare import Range
from ..frames import rotate_to_body
from ..ops import Number, exp, log, where

FRACTION = Range(0.0, 0.999999)


class Weights(NamedTuple):
    """The filter constants belong to a sampling period; another step size gives the same filter."""

    a: Annotated[float, "1", "weight of a new pose in the position filter", FRACTION] = 0.08
    b: Annotated[float, "1", "weight of a new rate in the velocity filter", FRACTION] = 0.05
    filter_period: Annotated[float, "s", "sampling period of a and b", Range(1e-6)] = 0.01


class Filtered(NamedTuple):
    """Filtered pose and earth-fixed rates."""

    x: Number = 0.0
    y: Number = 0.0
    psi: Number = 0.0
    x_dot: Number = 0.0
    y_dot: Number = 0.0
    psi_dot: Number = 0.0


class Acceleration(NamedTuple):
    """Body-fixed acceleration: the differenced velocity estimate, low-passed."""

    u_dot: Number = 0.0
    v_dot: Number = 0.0
    r_dot: Number = 0.0


def weight(a: Number, h: Number, period: Number) -> Number:
    """Weight of a new sample at step h in a first-order filter that has weight a at ``period``."""
    return 1.0 - exp(log(1.0 - a) * h / period)


def per_step(h: Number) -> Number:
    """1/h, and 1 where h = 0: nothing changes then that could be divided."""
    return 1.0 / where(h > 0.0, h, 1.0)


def filtered(f: Filtered, x: Number, y: Number, psi: Number, w: Weights, h: Number) -> Filtered:
    """The filter after a sample of the pose [m, m, rad], (4.45)."""
    a, b = weight(w.a, h, w.filter_period), weight(w.b, h, w.filter_period)
    rate = a * per_step(h)
    return Filtered(
        f.x + a * (x - f.x),
        f.y + a * (y - f.y),
        f.psi + a * (psi - f.psi),
        f.x_dot + b * (rate * (x - f.x) - f.x_dot),
        f.y_dot + b * (rate * (y - f.y) - f.y_dot),
        f.psi_dot + b * (rate * (psi - f.psi) - f.psi_dot),
    )


def body_velocity(f: Filtered) -> tuple[Number, Number, Number]:
    """nu_hat = R^T(psi) eta_dot [m/s, m/s, rad/s], (4.45)."""
    return *rotate_to_body(f.psi, f.x_dot, f.y_dot), f.psi_dot


def accelerated(
    s: Acceleration,
    before: tuple[Number, Number, Number],
    after: tuple[Number, Number, Number],
    b: Number,
    h: Number,
) -> Acceleration:
    """The acceleration estimate after the velocity went from ``before`` to ``after`` in h [s].

    (4.45) gives none: this takes the differenced velocity, low-passed with weight b.
    """
    inverse = per_step(h)
    return Acceleration(
        s.u_dot + b * ((after[0] - before[0]) * inverse - s.u_dot),
        s.v_dot + b * ((after[1] - before[1]) * inverse - s.v_dot),
        s.r_dot + b * ((after[2] - before[2]) * inverse - s.r_dot),
    )
