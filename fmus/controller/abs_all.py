"""Adaptive backstepping of all coefficients but the inertia's, (2.24)-(2.26), corrected."""

from .adaptive import adaptive
from .models import ALL_UNKNOWN

COMPONENT = adaptive("controller_abs_all", "Adaptive backstepping: all but inertia unknown", ALL_UNKNOWN)
