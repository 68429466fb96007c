"""Kalman filter on one axis: position, velocity, and a disturbance of the acceleration with its slope.

x_dot = v, v_dot = known + d, d_dot = s, s_dot = -s / T + noise; the position is measured. The slope lets
the disturbance swing without lagging behind: a wrong model errs by what the ship does, smoothly. How
noisy it is nobody knows, so that this is learnt in two ways. The variance of a slope that has been large
lately is large, and its noise follows from that, as in the model of Singer (1970). And innovations that
stay on one side tell that something new has begun: the covariance then grows by a factor with each
sample, until they scatter again (a strong tracking filter).

Written out for scalars, so that it needs no matrices.
"""

from typing import Annotated, NamedTuple

from ..declare import Range
from ..ops import Number, clip, fmax, sqrt, where

# Beyond what any ship of this size does; within, no arithmetic overflows.
MOST = 5.0  # m/s, rad/s, m/s2, rad/s2
MOST_DISTURBANCE = 1.0  # m/s2, rad/s2
MOST_SLOPE = 0.02  # m/s3, rad/s3
# Standard deviations of an innovation that count: what is far off is no better known than what is off.
MOST_INNOVATION = 5.0
# A squared mean innovation below this many variances is scatter.
SCATTER = 4.0


class NoiseLearning(NamedTuple):
    """How the noise of the disturbance is learnt."""

    change_time: Annotated[
        float, "s", "correlation time of the slope of the disturbance", Range(0.1)
    ] = 8.0
    memory_time: Annotated[float, "s", "memory of the slope of the disturbance", Range(0.1)] = 2.0
    alert: Annotated[
        float, "1/s", "growth of the covariance while samples are rejected", Range(0.0, 100.0)
    ] = 20.0
    alert_time: Annotated[float, "s", "over which innovations are averaged", Range(0.01)] = 0.3


class LearningRates(NamedTuple):
    """What is the same on every axis, computed once a step."""

    memory: Number  # share of the present in the variance that is learnt
    keep: Number  # share of the slope that is left after a step
    noise: Number  # gain of its variance by one step, in variances
    alert: Number  # growth of the covariance by one sample
    mean: Number  # share of a sample in the mean innovation
    scatter: Number  # squared mean innovation that is none


class Covariance(NamedTuple):
    """Entries of the symmetric matrix; its start is that before anything is measured."""

    pp: Number = 1.0
    pv: Number = 0.0
    pd: Number = 0.0
    ps: Number = 0.0
    vv: Number = 0.01
    vd: Number = 0.0
    vs: Number = 0.0
    dd: Number = 0.0025
    ds: Number = 0.0
    ss: Number = 0.0


class DisturbedAxis(NamedTuple):
    """Disturbance [m/s2 or rad/s2], its slope and the learnt variance of that; mean innovation in
    standard deviations; covariance."""

    d: Number = 0.0
    slope: Number = 0.0
    variance: Number = 0.0
    bias: Number = 0.0
    covariance: Covariance = Covariance()


def rates(p: NoiseLearning, period: Number, h: Number) -> LearningRates:
    """The rates of learning at a time between samples and a step [s]."""
    mean = period / (p.alert_time + period)
    return LearningRates(
        h / (p.memory_time + h),
        p.change_time / (p.change_time + h),
        2.0 * h / p.change_time,
        p.alert * period,
        mean,
        0.5 * SCATTER * mean,
    )


def later(a: DisturbedAxis, drift: Number, k: LearningRates, h: Number) -> DisturbedAxis:
    """The axis after h [s] without a measurement, P = F P F^T + Q.

    Args:
        a: axis.
        drift: what a slope gains in a second, at least [m/s3 or rad/s3].
        k: rates.
        h: time [s].
    """
    d, slope, variance, bias, (pp, pv, pd, ps, vv, vd, vs, dd, ds, ss) = a
    keep, half = k.keep, 0.5 * h * h
    # F P, of which the lower rows are needed right of the diagonal only.
    pv1 = pv + h * vv + half * vd
    pd1 = pd + h * vd + half * dd
    ps1 = ps + h * vs + half * ds
    vd1 = vd + h * dd + half * ds
    vs1 = vs + h * ds + half * ss
    ds1 = ds + h * ss
    dd1 = dd + h * ds
    return DisturbedAxis(
        d + h * slope,
        keep * slope,
        variance + k.memory * (slope * slope - variance),
        bias,
        Covariance(
            pp + h * (pv + pv1) + half * (pd + pd1),
            pv1 + h * pd1 + half * ps1,
            pd1 + h * ps1,
            keep * ps1,
            vv + h * (vd + vd1) + half * (vs + vs1),
            vd1 + h * vs1,
            keep * vs1,
            dd1 + h * ds1,
            keep * ds1,
            keep * keep * ss + h * drift * drift + k.noise * variance,
        ),
    )


def taken(
    a: DisturbedAxis, innovation: Number, noise: Number, k: LearningRates
) -> tuple[DisturbedAxis, Number, Number]:
    """The axis after a sample, and the corrections of position and velocity.

    Args:
        a: axis at the instant of the sample.
        innovation: of the position [m or rad].
        noise: variance of the measured position [m2 or rad2].
        k: rates.
    """
    d, slope, variance, bias, (pp, pv, pd, ps, vv, vd, vs, dd, ds, ss) = a
    excess = fmax(bias * bias - k.scatter, 0.0)
    factor = where(vv + dd < MOST * MOST, 1.0 + k.alert * excess, 1.0)
    inverse = 1.0 / (factor * pp + noise)
    share = factor * inverse
    kp, kv, kd, ks = share * pp, share * pv, share * pd, share * ps
    rest = noise * share
    sigmas = clip(innovation * sqrt(inverse), -MOST_INNOVATION, MOST_INNOVATION)
    return (
        DisturbedAxis(
            clip(d + kd * innovation, -MOST_DISTURBANCE, MOST_DISTURBANCE),
            clip(slope + ks * innovation, -MOST_SLOPE, MOST_SLOPE),
            variance,
            bias + k.mean * (sigmas - bias),
            Covariance(
                rest * pp,
                rest * pv,
                rest * pd,
                rest * ps,
                factor * (vv - kv * pv),
                factor * (vd - kv * pd),
                factor * (vs - kv * ps),
                factor * (dd - kd * pd),
                factor * (ds - kd * ps),
                factor * (ss - ks * ps),
            ),
        ),
        kp * innovation,
        kv * innovation,
    )
