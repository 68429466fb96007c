"""Adaptive backstepping of two factors, of inertia and of damping, (2.20)-(2.23)."""

from .adaptive import adaptive
from .models import SCALED

COMPONENT = adaptive(
    "controller_abs_scaled", "Adaptive backstepping: factors of inertia and damping", SCALED
)
