"""Smooth steps and what is made of them, each with its integral and derivatives in closed form."""

from typing import NamedTuple

from ..ops import Number, clip, floor, fmax, where


class RampShape(NamedTuple):
    """A function of one variable at one place: integral from 0, value, first two derivatives."""

    integral: Number
    value: Number
    rate: Number
    curvature: Number


def smooth(q: Number) -> Number:
    """The quintic that goes from 0 at q = 0 to 1 at q = 1 with two derivatives of zero at both ends."""
    return q * q * q * (10.0 + q * (6.0 * q - 15.0))


def ramp(x: Number, width: Number) -> RampShape:
    """From 0 for x <= 0 to 1 for x >= width (> 0); its integral lags behind x by half a width."""
    q = clip(x / width, 0.0, 1.0)
    q2 = q * q
    e = q * (1.0 - q)
    return RampShape(
        width * q2 * q2 * (2.5 + q * (q - 3.0)) + fmax(x - width, 0.0),
        smooth(q),
        30.0 * e * e / width,
        60.0 * e * (1.0 - 2.0 * q) / (width * width),
    )


def train(x: Number, period: Number, high: Number, width: Number) -> RampShape:
    """Pulses between 0 and 1: up in [0, width], down in [high, high + width], and so every period.

    The mean is high / period. Needs 0 < width <= min(high, period - high).
    """
    rounds = floor(x / period)
    tau = x - period * rounds
    low = where(tau < high, 0.0, 1.0)  # 1 in the part of the period that leads down
    sign = 1.0 - 2.0 * low
    change = ramp(tau - high * low, width)
    return RampShape(
        high * rounds + low * (tau - 0.5 * width) + sign * change.integral,
        low + sign * change.value,
        sign * change.rate,
        sign * change.curvature,
    )


# Twice the integral of a ramp of unit width up to its middle: what half a change of sign costs.
HALF_CHANGE = 5.0 / 32.0


def alternation(x: Number, half: Number, width: Number) -> RampShape:
    """A smooth square wave between -1 and 1, rising through 0 at x = 0, falling at x = half.

    A change of sign takes ``width`` (0 < width <= half). The integral goes from 0 up to :func:`climb`
    and back.
    """
    on = train(x + 0.5 * width, 2.0 * half, half, width)
    return RampShape(
        2.0 * on.integral - x - HALF_CHANGE * width,
        2.0 * on.value - 1.0,
        2.0 * on.rate,
        2.0 * on.curvature,
    )


def climb(half: Number, width: Number) -> Number:
    """By how much the integral of an :func:`alternation` rises in half a period."""
    return half - 2.0 * HALF_CHANGE * width
