"""How a target runs along its path: steadily, in pulses of speed, or as in the thesis' fault."""

from typing import Annotated, NamedTuple

from ..declare import FIXED, POSITIVE, Range
from ..ops import Number, fmax, fmin
from .ramps import train


class PathTiming(NamedTuple):
    """What all paths have in common in time; by itself a steady run.

    With ``pulse`` = 1 the speed changes between nothing and full (6.3.5: a period of 15 s, a width of
    70 %). A change takes ``pulse_rise``, but no longer than the shorter part of the period; the mean
    speed is 1 - pulse (1 - pulse_width) of the full one.

    With ``calls`` = 4 a path repeats the fault of the thesis' experiments: the path parameter is
    advanced four times in every step while each call believes that one step has passed, so the target
    runs at four times the speed that its own derivatives state. The pulses keep their period.
    """

    calls: Annotated[float, "1", "steps of the path parameter in each step", Range(0.0, 100.0)] = 1.0
    pulse: Annotated[
        float, "1", "reduction of the speed between pulses, as a share", Range(0.0, 1.0)
    ] = 0.0
    pulse_period: Annotated[float, "s", "period of the pulses", Range(min=0.1), FIXED] = 15.0
    pulse_width: Annotated[float, "1", "part of the period at full speed", Range(0.05, 0.95), FIXED] = (
        0.7
    )
    pulse_rise: Annotated[float, "s", "duration of a change of speed", POSITIVE, FIXED] = 2.0


class PulseClock(NamedTuple):
    """Time since the start, and how much of it a target that pulses stands still [s]."""

    t: float = 0.0
    rest: float = 0.0


class Beat(NamedTuple):
    """One step of a pulsing target: what the path sees of time.

    Attributes:
        passed: time by which the path goes on [s].
        factor: speed at the end of the step as part of the steady speed.
        slope: its derivative [1/s].
    """

    passed: Number
    factor: Number
    slope: Number

    def rates(self, rate: Number, acceleration: Number) -> tuple[Number, Number]:
        """First two derivatives in time of a path parameter, from those of the steady run."""
        return rate * self.factor, acceleration * self.factor * self.factor + rate * self.slope


def tick(clock: PulseClock, p: PathTiming, h: Number) -> tuple[PulseClock, Beat]:
    """The clock after h [s]; the time that passes is integrated exactly, whatever h."""
    short = p.pulse_period * fmin(p.pulse_width, 1.0 - p.pulse_width)
    t = clock.t + h
    rise = fmax(fmin(p.pulse_rise, short), 1e-3)
    full = train(t, p.pulse_period, p.pulse_period * p.pulse_width, rise)
    rest = t - full.integral
    return PulseClock(t, rest), Beat(
        (h - p.pulse * (rest - clock.rest)) * p.calls,
        1.0 - p.pulse * (1.0 - full.value),
        p.pulse * full.rate,
    )
