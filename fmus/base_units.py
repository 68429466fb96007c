"""SI units as FMI 2.0 writes them: a string, and the exponents of the base units behind it."""

import re
from collections import Counter

# Exponents of kg, m, s and rad of every symbol that the components use.
_SYMBOLS: dict[str, dict[str, int]] = {
    "1": {},
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
}
_FACTOR = re.compile(r"([A-Za-z]+|1)(\d*)")


def base_exponents(unit: str) -> dict[str, int]:
    """Exponents of the SI base units in a unit such as ``N.s2/(m.rad)``.

    Args:
        unit: products with ``.``, exponents as digits, at most one ``/``.

    Returns:
        Exponents that are not zero, in the order kg, m, s, rad.

    Raises:
        ValueError: a symbol is unknown.
    """
    total: Counter[str] = Counter()
    for sign, part in zip((1, -1), unit.split("/", 1), strict=False):
        for factor in part.removeprefix("(").removesuffix(")").split("."):
            match = _FACTOR.fullmatch(factor)
            if match is None or match[1] not in _SYMBOLS:
                raise ValueError(f"unknown unit '{factor}' in '{unit}'")
            for base, exponent in _SYMBOLS[match[1]].items():
                total[base] += sign * exponent * int(match[2] or 1)
    return {base: total[base] for base in ("kg", "m", "s", "rad") if total[base]}
