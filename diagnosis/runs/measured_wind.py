"""The wind that was measured along a run, as the velocity of the air over ground."""

import numpy as np

from fmus.frames import air_velocity, rotate_to_earth

from .cleaning import between
from .columns.columns import RELATIVE_WIND, TRUE_WIND
from .files.reading import Run


def air_along(run: Run, psi: np.ndarray, nu: np.ndarray) -> np.ndarray | None:
    """Velocity (n, 2) of the air to north and east [m/s]; None: no wind was measured.

    Between samples it is on a line between them, before the first and after the last as there.

    Args:
        run: with the true wind, or one relative to the ship, of which the ship's velocity is taken off.
        psi: (n,), smoothed heading [rad].
        nu: (n, 3), smoothed velocity [m/s, m/s, rad/s].
    """
    if all(name in run.measured for name in TRUE_WIND):
        speed, direction = (run.measured[name] for name in TRUE_WIND)
        air = np.column_stack(air_velocity(speed, direction))
    elif all(name in run.measured for name in RELATIVE_WIND):
        speed, direction = (run.measured[name] for name in RELATIVE_WIND)
        u, v = air_velocity(speed, direction)
        air = np.column_stack(rotate_to_earth(psi, u + nu[:, 0], v + nu[:, 1]))
    else:
        return None
    known = np.isfinite(air).all(axis=1) & np.isfinite(run.time)
    if not known.any():
        return None
    return between(run.time, run.time[known], air[known])
