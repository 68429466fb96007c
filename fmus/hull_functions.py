"""Damping of a hull that is no product of speeds: one function each, named in a ship's description.

A function gets u, v and r through the water [m/s, m/s, rad/s] and then its parameters,
``name: Annotated[float, unit, description, ...] = start``, and gives the force on the hull (X, Y, N)
[N, N, N m]. It registers itself by its name.
"""

from collections.abc import Callable
from typing import Annotated, Any

from .declare import POSITIVE
from .ops import Number

FUNCTIONS: dict[str, Callable[..., tuple[Any, Any, Any]]] = {}

STRIPS = 10  # of a hull's length; the moment of a turn on the spot is within 2 % of the integral


def hull_function(function: Callable[..., tuple[Any, Any, Any]]) -> Callable[..., tuple[Any, Any, Any]]:
    """Decorator that registers a function of the hull's damping."""
    FUNCTIONS[function.__name__] = function
    return function


@hull_function
def cross_flow(
    u: Number,
    v: Number,
    r: Number,
    water_density: Annotated[float, "kg/m3", "density of the water", POSITIVE] = 1025.0,
    cross_flow_length: Annotated[
        float, "m", "length in the cross-flow, about the origin", POSITIVE
    ] = 1.0,
    cross_flow_draft: Annotated[float, "m", "draft in the cross-flow", POSITIVE] = 0.1,
    cross_flow_drag: Annotated[float, "1", "drag coefficient of a section", POSITIVE] = 0.7,
) -> tuple[Any, Any, Any]:
    """Drag of the cross-flow by strips along the hull (Faltinsen 1990; Fossen 2021, ch. 6)."""
    dx = cross_flow_length / STRIPS
    scale = -0.5 * water_density * cross_flow_drag * cross_flow_draft * dx
    Y, N = 0.0 * v, 0.0 * v
    for k in range(STRIPS):
        x = (k + 0.5) * dx - 0.5 * cross_flow_length
        speed = v + x * r
        force = scale * abs(speed) * speed
        Y, N = Y + force, N + x * force
    return 0.0 * v, Y, N
