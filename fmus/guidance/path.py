"""From a parametrised path eta_t = g(theta) to a target with exact derivatives, (4.38)."""

from typing import Annotated, NamedTuple

from ..declare import FIXED
from ..ops import Number, atan2
from ..signals import Target


class Course(NamedTuple):
    """What all closed paths have: where they lie and where they start."""

    x_c: Annotated[float, "m", "north position of the centre"] = 5.0
    y_c: Annotated[float, "m", "east position of the centre"] = 0.5
    theta_0: Annotated[float, "rad", "path parameter at the start", FIXED] = 0.0


class PathPoint(NamedTuple):
    """A point of a path and its first three derivatives by theta, north and east."""

    x: Number
    y: Number
    x1: Number
    y1: Number
    x2: Number
    y2: Number
    x3: Number
    y3: Number


def target(p: PathPoint, theta_dot: Number, theta_ddot: Number) -> Target:
    """Target pose [m, m, rad] along the tangent, with its derivatives in time.

    Args:
        p: the path at theta.
        theta_dot: rate of the path parameter [1/s].
        theta_ddot: its derivative [1/s2].

    Returns:
        eta_t and its first two derivatives; analytic in place of (4.43)-(4.44).
    """
    x, y, x1, y1, x2, y2, x3, y3 = p
    square = x1 * x1 + y1 * y1
    psi1 = (x1 * y2 - y1 * x2) / square
    psi2 = ((x1 * y3 - y1 * x3) - 2.0 * psi1 * (x1 * x2 + y1 * y2)) / square
    rate2 = theta_dot * theta_dot
    return Target(
        x,
        y,
        atan2(y1, x1),
        x1 * theta_dot,
        y1 * theta_dot,
        psi1 * theta_dot,
        x2 * rate2 + x1 * theta_ddot,
        y2 * rate2 + y1 * theta_ddot,
        psi2 * rate2 + psi1 * theta_ddot,
    )
