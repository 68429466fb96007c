"""A heavier ship, or more water that moves with it."""

from typing import Annotated

from ..declare import Range
from ..hull import Inertia
from .registry import effect

_SIGN = "positive is heavier"


@effect(
    "mass",
    "inertia",
    "XYN",
    formula="m + Δm, I_z (1 + Δm/m), in M and C(nu)",
    symbol="Δm",
    sign=_SIGN,
    source="(2.5)-(2.7), corrected",
)
def mass(
    i: Inertia, mass: Annotated[float, "kg", "additional mass", Range(-10.0, 100.0)] = 0.0
) -> Inertia:
    """Additional mass; the moment of inertia grows in proportion."""
    return i._replace(m=i.m + mass, I_z=i.I_z * (1.0 + mass / i.m))


@effect(
    "added_mass_X",
    "inertia",
    "XN",
    formula="X_udot - Δ, in M and C(nu)",
    symbol="Δ",
    sign=_SIGN,
    source="(2.5)-(2.7), corrected",
)
def added_mass_X(
    i: Inertia,
    added_mass_X: Annotated[float, "kg", "additional added mass in surge", Range(-5.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that moves along in surge."""
    return i._replace(X_udot=i.X_udot - added_mass_X)


@effect(
    "added_mass_Y",
    "inertia",
    "XYN",
    formula="Y_vdot - Δ, in M and C(nu)",
    symbol="Δ",
    sign=_SIGN,
    source="(2.5)-(2.7), corrected",
)
def added_mass_Y(
    i: Inertia,
    added_mass_Y: Annotated[float, "kg", "additional added mass in sway", Range(-10.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that moves along in sway."""
    return i._replace(Y_vdot=i.Y_vdot - added_mass_Y)


@effect(
    "added_mass_N",
    "inertia",
    "N",
    formula="N_rdot - Δ, in M",
    symbol="Δ",
    sign=_SIGN,
    source="(2.5)-(2.7), corrected",
)
def added_mass_N(
    i: Inertia,
    added_mass_N: Annotated[float, "kg.m2", "additional added inertia in yaw", Range(-1.0, 100.0)] = 0.0,
) -> Inertia:
    """More water that turns along in yaw."""
    return i._replace(N_rdot=i.N_rdot - added_mass_N)
