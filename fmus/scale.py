"""Froude's law: from CyberShip Enterprise 1 to another ship's size, for the quantity of any unit."""

from dataclasses import dataclass, replace
from functools import cache

from .base_units import base_exponents
from .declare import Range, Variable

REFERENCE_LENGTH = 1.105  # between perpendiculars of CyberShip Enterprise 1 [m]

# Powers of the ratio of lengths: in the same water and under the same gravity, a mass goes with the
# volume, a time with the root of the length.
_POWERS = {"kg": 3.0, "m": 1.0, "s": 0.5, "rad": 0.0}


@dataclass(frozen=True)
class Scale:
    """The size of a ship.

    Attributes:
        length: length between perpendiculars over that of CyberShip Enterprise 1.
    """

    length: float = 1.0

    def factor(self, unit: str) -> float:
        """Factor of a quantity of this unit from CyberShip Enterprise 1 to this ship."""
        return _factor(self.length, unit)

    def limits(self, unit: str, reference: Range) -> Range:
        """The range of a quantity of this unit, for its range at the size of the reference ship."""
        at = self.factor(unit)
        return Range(*(None if end is None else at * end for end in (reference.min, reference.max)))

    def of(self, v: Variable) -> Variable:
        """A parameter whose start value and range are those of this size."""
        start = self.factor(v.unit) * v.start
        return replace(v, start=start, range=self.limits(v.unit, v.range))

    @property
    def time(self) -> float:
        return self.factor("s")

    @property
    def speed(self) -> float:
        return self.factor("m/s")

    @property
    def rate(self) -> float:
        return self.factor("rad/s")

    @property
    def force(self) -> float:
        return self.factor("N")

    @property
    def moment(self) -> float:
        return self.factor("N.m")

    @property
    def speeds(self) -> tuple[float, float, float]:
        """Of surge, sway and yaw."""
        return self.speed, self.speed, self.rate

    @property
    def forces(self) -> tuple[float, float, float]:
        """Of X, Y and N."""
        return self.force, self.force, self.moment


REFERENCE = Scale()


@cache
def _factor(length: float, unit: str) -> float:
    return length ** sum(_POWERS[base] * n for base, n in base_exponents(unit).items())
