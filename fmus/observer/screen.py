"""Telling a measurement from one that is frozen or lost, 4.3.1; shared by the observers.

Frozen: all three channels identical to the bit for a measurement period or longer. Lost: NaN, infinite,
or exactly zero in all three channels. A pose that stays identical for longer than ``rest_time`` is
taken to be true: the ship lies still.
"""

from typing import Annotated, NamedTuple

from ..declare import Range
from ..ops import TWO_PI, Condition, Number, clip, finite, floor, is_finite, not_, where
from ..signals import Force, Measurement

MOST_FORCE = 1e3  # N, N m; beyond, arithmetic may overflow


class Screening(NamedTuple):
    measurement_period: Annotated[float, "s", "time between new measurements", Range(1e-6)] = 0.01
    rest_time: Annotated[
        float, "s", "an identical pose for a longer time is taken as rest", Range(0.0)
    ] = 3.0


class Inputs(NamedTuple):
    """What every observer takes."""

    measurement: Measurement = Measurement()
    tau: Force = Force()


class Seen(NamedTuple):
    """What is remembered of the measurements: whether there was one, its age, its raw values."""

    started: float = 0.0
    age: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    psi_m: float = 0.0


class ScreenedSample(NamedTuple):
    """A screened sample: whether it is good, and the first one; whether there has been none for long;
    its pose with continuous heading, which is finite even if the sample is not."""

    good: Condition
    first: Condition
    overdue: Condition
    x: Number
    y: Number
    psi: Number


def present(m: Measurement) -> Condition:
    """Whether a sample is a measurement at all: finite and not (0, 0, 0)."""
    zero = (m.x_m == 0.0) & (m.y_m == 0.0) & (m.psi_m == 0.0)
    return is_finite(m.x_m + m.y_m + m.psi_m) & not_(zero)


def limited(tau: Force) -> Force:
    """A force as far as it can be true; one that is NaN or infinite is none."""
    X, Y, N = tau
    return Force(
        clip(finite(X, 0.0), -MOST_FORCE, MOST_FORCE),
        clip(finite(Y, 0.0), -MOST_FORCE, MOST_FORCE),
        clip(finite(N, 0.0), -MOST_FORCE, MOST_FORCE),
    )


def unwrap(psi_m: Number, near: Number) -> Number:
    """The measured heading plus the whole turns that bring it closest to ``near`` [rad]."""
    return psi_m + TWO_PI * floor((near - psi_m) / TWO_PI + 0.5)


def first_look(m: Measurement) -> Seen:
    """The memory after the sample of the start, if that is one."""
    here = present(m)
    return Seen(
        where(here, 1.0, 0.0),
        0.0,
        where(here, m.x_m, 0.0),
        where(here, m.y_m, 0.0),
        where(here, m.psi_m, 0.0),
    )


def look(s: Seen, m: Measurement, near: Number, p: Screening, h: Number) -> tuple[Seen, ScreenedSample]:
    """Screen a sample.

    Args:
        s: memory.
        m: the sample [m, m, rad].
        near: predicted heading, continuous over turns [rad].
        p: periods [s].
        h: time since the sample before [s].

    Returns:
        The new memory, and the screened sample.
    """
    here = present(m)
    same = (m.x_m == s.x_m) & (m.y_m == s.y_m) & (m.psi_m == s.psi_m)
    age = where(here & not_(same), 0.0, s.age + h)
    frozen = same & (age > p.measurement_period - 0.5 * h) & (age < p.rest_time)
    # At h = 0 nothing has had time to freeze; a lost sample is lost at any step.
    good = here & not_(frozen & (h > 0.0))
    first = good & (s.started < 0.5)
    # A lost sample must not reach the arithmetic: NaN times zero is NaN.
    x, y, psi = where(here, m.x_m, s.x_m), where(here, m.y_m, s.y_m), where(here, m.psi_m, s.psi_m)
    return Seen(where(here, 1.0, s.started), age, x, y, psi), ScreenedSample(
        good, first, age > p.rest_time, x, y, where(first, psi, unwrap(psi, near))
    )
