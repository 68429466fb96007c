"""Between the earth-fixed frame (north, east) and the body-fixed one (ahead, to starboard).

Of numbers at an instant, or of whole time series.
"""

from .ops import Series, cos, sin


def rotate_to_body(psi: Series, x: Series, y: Series) -> tuple[Series, Series]:
    """R^T(psi) of an earth-fixed vector."""
    c = cos(psi)
    s = sin(psi)
    return c * x + s * y, c * y - s * x


def rotate_to_earth(psi: Series, x: Series, y: Series) -> tuple[Series, Series]:
    """R(psi) of a body-fixed vector, (2.1)."""
    c = cos(psi)
    s = sin(psi)
    return c * x - s * y, s * x + c * y


def air_velocity(speed: Series, direction: Series) -> tuple[Series, Series]:
    """Velocity of the air to north and east [m/s], of a wind of a speed [m/s] from a direction [rad]."""
    return -speed * cos(direction), -speed * sin(direction)
