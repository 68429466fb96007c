"""Samples for learning: of this instant, or delayed and smoothed, after chapter 8.

The delayed sample is the weighted mean of velocity, force and heading over a span, and for the
acceleration the weighted slope of the velocity: the observer's acceleration is not used.
"""

from typing import Any, NamedTuple

from ..hull import Triple
from ..ops import Condition, Number, choose, when
from .eigen import dot

TAPS = 11
# (1 - s^2)^2 with s just inside of -1...1.
KERNEL = tuple((1.0 - ((k - 5) / 6.0) ** 2) ** 2 for k in range(TAPS))


class LearningSample(NamedTuple):
    """A time [s], heading, velocity, acceleration and force that belong together."""

    time: Number = 0.0
    psi: Number = 0.0
    nu: Triple = (0.0, 0.0, 0.0)
    nu_dot: Triple = (0.0, 0.0, 0.0)
    tau: Triple = (0.0, 0.0, 0.0)


class Tap(NamedTuple):
    time: Number = 0.0
    psi: Number = 0.0
    nu: Triple = (0.0, 0.0, 0.0)
    tau: Triple = (0.0, 0.0, 0.0)


class Register(NamedTuple):
    """The last taps, newest first, how many there are, and the sample they give."""

    taps: tuple[Tap, ...] = (Tap(),) * TAPS
    count: Any = 0.0
    sample: LearningSample = LearningSample()


def smoothed(taps: tuple[Tap, ...]) -> LearningSample:
    """Weighted means over the taps, and the slope of the velocity by weighted least squares."""
    total = sum(KERNEL)
    weights = [w / total for w in KERNEL]

    def mean(values: list[Number]) -> Number:
        return dot(weights, values)

    time = mean([t.time for t in taps])
    lever = [w * (t.time - time) for w, t in zip(weights, taps, strict=True)]
    # The 1e-30 is for taps at one time, where the lever is zero as well.
    spread = dot(lever, [t.time for t in taps]) + 1e-30
    nu = [[t.nu[axis] for t in taps] for axis in range(3)]
    tau = [[t.tau[axis] for t in taps] for axis in range(3)]
    return LearningSample(
        time,
        mean([t.psi for t in taps]),
        (mean(nu[0]), mean(nu[1]), mean(nu[2])),
        (dot(lever, nu[0]) / spread, dot(lever, nu[1]) / spread, dot(lever, nu[2]) / spread),
        (mean(tau[0]), mean(tau[1]), mean(tau[2])),
    )


def shifted(
    s: Register, now: Tap, span: Number, usable: Condition
) -> tuple[Register, Condition, Condition]:
    """The register after an instant; emptied where that is not usable.

    Returns:
        The register, True where it is full, and True where its sample is new and to be used.
    """
    # The last tap is old enough, within rounding.
    due = (s.count < 0.5) | (now.time - s.taps[0].time >= span / (TAPS - 1.0) * (1.0 - 1e-9))

    def pushed() -> Register:
        taps = (now, *s.taps[:-1])
        count = s.count + 1.0
        sample = when(count > TAPS - 0.5, lambda: smoothed(taps), lambda: s.sample)
        return Register(taps, count, sample)

    after = choose(usable, when(due, pushed, lambda: s), Register())
    full = after.count > TAPS - 0.5
    return after, full, usable & due & full
