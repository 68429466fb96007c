"""Whether two connected variables speak of the same quantity, and how to convert."""

import math
from dataclasses import dataclass

from .errors import InputError
from .fmu import Variable


@dataclass(frozen=True)
class Conversion:
    """target = factor * source + offset."""

    factor: float = 1.0
    offset: float = 0.0


SAME = Conversion()


def conversion(source: Variable, target: Variable, ends: str, warnings: list[str]) -> Conversion:
    """How to turn a source's value into the target's unit.

    Args:
        source, target: the connected variables.
        ends: names of both ends, for messages.
        warnings: receives a line where the units cannot be compared.

    Returns:
        The conversion; none where one side has no unit.

    Raises:
        InputError: different dimensions.
    """
    a, b = source.unit, target.unit
    if a is None or b is None:
        return SAME
    if a.exponents is None or b.exponents is None or math.isnan(a.factor * b.factor):
        if a.name != b.name:
            warnings.append(
                f"{ends}: units '{a.name}' and '{b.name}' cannot be compared, "
                "because an FMU does not define them; the value passes unchanged"
            )
        return SAME
    if a.exponents != b.exponents:
        raise InputError(f"{ends}: unit '{a.name}' cannot be converted to '{b.name}'")
    return Conversion(a.factor / b.factor, (a.offset - b.offset) / b.factor)
