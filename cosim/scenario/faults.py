"""Measurement faults.

A fault is a class that declares its options; bound to slots of the value table, it returns a function
that is called each time the values have been set. A new fault is a new class, here or in a module of the
user: it registers itself by its ``kind``. Where the function is an operation
(:mod:`cosim.scenario.operations`), as it is for all faults here, the run can take the compiled step
loop. Faults on the same signal act in the order of their ``stage``, as along a real measurement chain,
whatever their order in the scenario.
"""

import math
from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PositiveFloat, model_validator

from . import operations
from .json_files import StrictModel
from .operations import Add, Hold, Replace, Values
from .plans import TimeSpans, WhiteNoise, Within

Effect = Callable[[Values, float], None]
Times = Annotated[float, Field(ge=0.0)]
Span = tuple[Times, Times]

KINDS: dict[str, type["Fault"]] = {}
NO_EFFECT = "no step starts at or after t = {} s: no effect"


class Fault(StrictModel):
    """A fault, with the signals on which it acts together."""

    stage: ClassVar[int]
    units: ClassVar[tuple[str | None, ...]] = ()  # of its signals, None: not stated; empty: of any
    by_signal: ClassVar[str] = ""  # name of the option that is one number, or one for each signal

    signals: list[str] = Field(min_length=1, description="inputs, as instance.variable")

    @model_validator(mode="after")
    def _check_signals(self) -> "Fault":
        twice = next((name for name in self.signals if self.signals.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"'signals' has {twice} twice")
        value, count = getattr(self, self.by_signal, None), len(self.signals)
        if isinstance(value, list) and len(value) != count:
            raise ValueError(
                f"'{self.by_signal}' needs one number, or one for each of the {count} signals"
            )
        return self

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if "kind" in cls.__annotations__:
            for kind in cls.__annotations__["kind"].__args__:
                KINDS[kind] = cls

    def remark(self, step: float, stop: float) -> str:
        """What a user should know of it in a run with a step and an end [s]; empty: nothing."""
        return ""

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        """The fault as a function of the value table.

        Args:
            slots: where the signals stand in the table.
            step: time between two calls [s].
            rng: random numbers of this fault alone.

        Returns:
            ``effect(values, t)``, which changes the values at the slots.
        """
        raise NotImplementedError


class Timed(Fault):
    """A fault that acts at times, given or random."""

    at: list[Times] | None = Field(None, description="times at which it starts [s]")
    rate: PositiveFloat | None = Field(None, description="mean rate of random starts [1/s]")
    duration: Times | Span | None = Field(
        None, description="duration [s], or [shortest, longest]; one sample if not given"
    )

    @model_validator(mode="after")
    def _check_times(self) -> "Timed":
        if (self.at is None) == (self.rate is None):
            raise ValueError("give either 'at' (times) or 'rate' (random)")
        if isinstance(self.duration, tuple) and self.duration[0] > self.duration[1]:
            raise ValueError("the shorter duration comes first")
        return self

    def remark(self, step: float, stop: float) -> str:
        return NO_EFFECT.format(min(self.at)) if self.at and min(self.at) >= stop else ""

    def windows(self, step: float, rng: np.random.Generator) -> TimeSpans:
        """When the fault is active."""
        return TimeSpans(self.at, self.rate or 0.0, lambda: self._draw_duration(step, rng), rng)

    def _draw_duration(self, step: float, rng: np.random.Generator) -> float:
        """How long the fault lasts this time [s]: at least a sample."""
        if isinstance(self.duration, tuple):
            return max(step, rng.uniform(*self.duration))
        return max(step, self.duration or 0.0)


def _each(value: float | list[float], count: int) -> list[float]:
    return list(value) if isinstance(value, list) else [value] * count


class Bias(Fault):
    """A constant added to each signal."""

    kind: Literal["bias"]
    stage = 1
    by_signal = "value"
    value: float | list[float] = Field(description="offset, in the signal's unit")

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        return Add(slots, _each(self.value, len(slots)))


class Noise(Fault):
    """White Gaussian noise, drawn for each signal and sample."""

    kind: Literal["noise"]
    stage = 2
    by_signal = "std"
    std: Annotated[float, Field(ge=0.0)] | list[Annotated[float, Field(ge=0.0)]] = Field(
        description="standard deviation, in the signal's unit"
    )

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        return Add(slots, WhiteNoise(_each(self.std, len(slots)), rng))


class Spikes(Timed):
    """Single samples far off: plus or minus ``size``, on all signals at once."""

    kind: Literal["spikes"]
    stage = 3
    by_signal = "size"
    size: float | list[float] = Field(description="amplitude, in the signal's unit")

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        sizes = _each(self.size, len(slots))

        def sample() -> list[float]:
            return [size if rng.random() < 0.5 else -size for size in sizes]

        return Add(slots, Within(self.windows(step, rng), sample))


class Wrap(Fault):
    """An angle reported in (-pi, pi]."""

    kind: Literal["wrap"]
    stage = 4
    units = (None, "rad", "1")

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        return operations.WrapOperation(slots)


class Delay(Fault):
    """Values arrive late, by a whole number of samples."""

    kind: Literal["delay"]
    stage = 5
    time: float = Field(ge=0.0, le=1e6, description="delay [s], rounded to samples")

    def remark(self, step: float, stop: float) -> str:
        if self.time >= stop:
            return f"{self.time:g} s is longer than the run: the first values are held"
        if 0.0 < self.time < 0.5 * step:
            return f"{self.time:g} s is less than half a step, {step:g} s: no effect"
        return ""

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        return operations.DelayOperation(slots, int(self.time / step + 0.5))


class Freeze(Timed):
    """All signals keep the values they had before, to the bit."""

    kind: Literal["freeze"]
    stage = 6

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        return Hold(slots, self.windows(step, rng))


class Dropout(Timed):
    """All signals are lost: NaN, or zero."""

    kind: Literal["dropout"]
    stage = 7
    value: Literal["nan", "zero"] = Field("nan", description="reported value")

    def bind(self, slots: Sequence[int], step: float, rng: np.random.Generator) -> Effect:
        lost = [math.nan if self.value == "nan" else 0.0] * len(slots)
        return Replace(slots, Within(self.windows(step, rng), lambda: lost))
