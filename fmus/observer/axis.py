"""Kalman filter on one axis: position, velocity, and a disturbance of the acceleration.

x_dot = v, v_dot = known + d, d_dot = noise; the position is measured. How noisy d_dot is nobody knows,
and it changes, so that it is learnt in two ways. A disturbance that has varied lately will go on to do
so. And innovations that stay on one side tell that something new has begun: the covariance then grows by
a factor with each sample, until they scatter again (a strong tracking filter).

Written out for scalars, so that it needs no matrices.
"""

from typing import Annotated, Any, NamedTuple

from ..declare import Range
from ..ops import Number, clip, exp, fmax, sqrt, where

# Beyond what any ship of this size does; within, no arithmetic overflows.
MOST = 5.0  # m/s, rad/s, m/s2, rad/s2
# Standard deviations of an innovation that count: what is far off is no better known than what is off.
MOST_INNOVATION = 5.0
# A squared mean innovation below this many variances is scatter.
SCATTER = 8.0


class Learning(NamedTuple):
    """How the noise of the disturbance is learnt."""

    change_time: Annotated[float, "s", "in which a disturbance changes", Range(0.1)] = 20.0
    memory_time: Annotated[float, "s", "over which its variation is learnt", Range(0.1)] = 3.0
    alert: Annotated[float, "1/s", "growth of the covariance in doubt", Range(0.0, 100.0)] = 10.0
    alert_time: Annotated[float, "s", "over which innovations are averaged", Range(0.01)] = 0.1


class Rates(NamedTuple):
    """What is the same on every axis, computed once a step."""

    memory: Any  # share of the present in the variation that is learnt
    change: Any  # [1/s]
    alert: Any  # growth of the covariance by one sample
    mean: Any  # share of a sample in the mean innovation
    scatter: Any  # squared mean innovation that is none


class Covariance(NamedTuple):
    """Entries of the symmetric matrix; its start is what is believed before anything is measured."""

    pp: Any = 1.0
    pv: Any = 0.0
    pd: Any = 0.0
    vv: Any = 0.01
    vd: Any = 0.0
    dd: Any = 0.0025


class Axis(NamedTuple):
    """Disturbance [m/s2 or rad/s2] with its slow mean and its variance about that; mean innovation in
    standard deviations; covariance."""

    d: Any = 0.0
    mean: Any = 0.0
    variance: Any = 0.0
    bias: Any = 0.0
    covariance: Covariance = Covariance()


def rates(p: Learning, period: Number, h: Number) -> Rates:
    """The rates of learning at a time between samples and a step [s]."""
    return Rates(
        1.0 - exp(-h / p.memory_time),
        2.0 / p.change_time,
        p.alert * period,
        1.0 - exp(-period / p.alert_time),
        0.5 * SCATTER * period / p.alert_time,
    )


def later(a: Axis, drift: Number, k: Rates, h: Number) -> Axis:
    """The axis after h [s] without a measurement, P = F P F^T + Q.

    Args:
        a: axis.
        drift: what a disturbance gains in a second, at least [m/s2 or rad/s2].
        k: rates.
        h: time [s].
    """
    d, mean, variance, bias, (pp, pv, pd, vv, vd, dd) = a
    half = 0.5 * h * h
    pv1 = pv + h * vv + half * vd
    pd1 = pd + h * vd + half * dd
    vd1 = vd + h * dd
    off = d - mean
    return Axis(
        d,
        mean + k.memory * off,
        # What may be an error of the estimate is no variation.
        variance + k.memory * (fmax(off * off - dd, 0.0) - variance),
        bias,
        Covariance(
            pp + h * (pv + pv1) + half * (pd + pd1),
            pv1 + h * pd1,
            pd1,
            vv + h * (vd + vd1),
            vd1,
            dd + h * (drift * drift + k.change * variance),
        ),
    )


def taken(a: Axis, innovation: Number, noise: Number, k: Rates) -> tuple[Axis, Any, Any]:
    """The axis after a sample, and the corrections of position and velocity.

    Args:
        a: axis at the instant of the sample.
        innovation: of the position [m or rad].
        noise: variance of the measured position [m2 or rad2].
        k: rates.
    """
    d, mean, variance, bias, (pp, pv, pd, vv, vd, dd) = a
    excess = fmax(bias * bias - k.scatter, 0.0)
    factor = where(vv + dd < MOST * MOST, 1.0 + k.alert * excess, 1.0)
    inverse = 1.0 / (factor * pp + noise)
    share = factor * inverse
    kp, kv, kd = share * pp, share * pv, share * pd
    rest = factor * noise * inverse
    sigmas = clip(innovation * sqrt(inverse), -MOST_INNOVATION, MOST_INNOVATION)
    return (
        Axis(
            clip(d + kd * innovation, -MOST, MOST),
            mean,
            variance,
            bias + k.mean * (sigmas - bias),
            Covariance(
                kp * noise,
                rest * pv,
                rest * pd,
                factor * (vv - kv * pv),
                factor * (vd - kv * pd),
                factor * (dd - kd * pd),
            ),
        ),
        kp * innovation,
        kv * innovation,
    )
