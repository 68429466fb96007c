"""Units: whether two measure the same quantity, and how to convert a value."""

import math
from dataclasses import dataclass

from .errors import InputError

# SI base units in the order of FMI's BaseUnit. rad is no dimension of its own: 1/s and rad/s agree.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd")


@dataclass(frozen=True)
class Unit:
    """A unit by name; where a file defines it, with SI exponents (see BASE_UNITS), factor and offset."""

    name: str
    exponents: tuple[int, ...] | None = None
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Conversion:
    """target = factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0


SAME = Conversion()


def conversion(a: Unit | None, b: Unit | None, where: str) -> Conversion | None:
    """How to convert a value from one unit to another.

    Args:
        a, b: the unit that a value has, and the one that it is to have; None where no file states it.
        where: what is converted, for messages.

    Returns:
        The conversion; ``SAME`` where one side has no unit. None: the units differ by name and a file
        does not define them, so that they cannot be compared.

    Raises:
        InputError: different dimensions.
    """
    if a is None or b is None or a == b:
        return SAME
    if a.exponents is None or b.exponents is None or math.isnan(a.factor * b.factor):
        return SAME if a.name == b.name else None
    if a.exponents != b.exponents:
        raise InputError(f"{where}: unit '{a.name}' cannot be converted to '{b.name}'")
    return Conversion(a.factor / b.factor, (a.offset - b.offset) / b.factor)
