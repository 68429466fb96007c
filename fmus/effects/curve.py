"""Free shapes: a curve through values at equally spaced nodes."""

from collections.abc import Sequence

from ..declare import Range, Variable
from ..ops import Number, clip, fmax, is_series, series_between

NODES = 21


def hats(x: Number, low: Number, high: Number, count: int) -> list[Number]:
    """Weights of ``count`` equally spaced nodes that interpolate linearly at x; constant outside."""
    place = (clip(x, low, high) - low) / (high - low) * (count - 1.0)
    return [fmax(0.0, 1.0 - abs(place - k)) for k in range(count)]


def interpolate(x: Number, low: Number, high: Number, values: Sequence[Number]) -> Number:
    """The piecewise linear curve through ``values`` at equally spaced nodes from low to high, at x."""
    if is_series(x) and not any(map(is_series, values)):
        return series_between(x, low, high, values)
    total = 0.0
    for weight, value in zip(hats(x, low, high, len(values)), values, strict=True):
        total = total + weight * value
    return total


def node_parameters(
    prefix: str, unit: str, what: str, over: str, over_unit: str, reach: float, least: float = 0.01
) -> tuple[Variable, ...]:
    """Parameters of a curve: its value at each of the nodes, and the range that they span.

    Args:
        prefix: of their names.
        unit, what: of the values.
        over, over_unit: what the curve is over.
        reach: range at the start.
        least: the smallest range.
    """
    nodes = [
        Variable(f"{prefix}_{k}", unit, f"{what}, node {k} of {NODES}", 0.0) for k in range(1, NODES + 1)
    ]
    span = f"reach of the nodes of {prefix}: {over}"
    return (*nodes, Variable(f"{prefix}_range", over_unit, span, reach, Range(min=least)))
