"""What the thesis identified by concurrent learning, Table 7.1: coefficients of (7.2) and (7.5).

The surge coefficients add to g(nu), those of sway and yaw are totals (corrected).
"""

from collections.abc import Mapping

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from diagnosis.predictors import Model
from fmus.controller.models import SURGE
from fmus.declare import variables
from fmus.effects.linear_map import parameter
from fmus.hull import RotationalDamping

from .partial_least_squares import AXES

NAMES = tuple(c.name.removesuffix(", added") for c in SURGE.coefficients)
ADDED, LOSSES = 3, 3  # coefficients of surge, which come first, and losses of thrust, which come last

TABLE_7_1: Mapping[str, tuple[float, ...]] = {
    "SYSID1": (-0.3, -6.5, -0.025, 0.0, 0.0, 0.0, 0.0, -1.44, -2.7, 1.4, 8.2, 0.0, 0.0, 0.0),
    "SYSID2": (-0.30, -4.0, 0.225, 0.0, 0.38, 0.0, 0.067, 0.02, -1.7, -0.02, -0.23, 0.36, 0.0, 0.23),
    "SYSID3": (-0.33, -4.6, 0.27, -0.015, 1.7, 0.02, 0.2, 0.02, -2.3, -0.026, -0.26, 0.11, 0.0, 0.18),
    "SYSID4": (-0.26, -3.5, 0.2, -0.014, 1.55, 0.017, 0.2, 0.017, -1.8, -0.02, -0.2, 0.3, 0.0, 0.31),
}


def row(name: str) -> np.ndarray:
    """(14,), a row of the table.

    Raises:
        InputError: there is none of this name.
    """
    if name not in TABLE_7_1:
        known = ", ".join(TABLE_7_1)
        raise InputError(f"no recipe '{name}'{nearest(name, TABLE_7_1)}; there are {known}")
    return np.array(TABLE_7_1[name])


def plant(phi: np.ndarray) -> Model:
    """The ship that has these coefficients (14,): additions to Table 2.1, and the map -delta tau."""
    nominal = {v.name: v.start for v in variables(RotationalDamping)}
    hull = dict(zip(NAMES[:-LOSSES], phi[:-LOSSES].tolist(), strict=True))
    values = {f"delta_{n}": x - nominal.get(n, 0.0) for n, x in hull.items()}
    for axis, loss in zip(AXES, phi[-LOSSES:].tolist(), strict=True):
        values[parameter(axis, f"tau_{axis}")] = -loss
    return Model().plus(values)
