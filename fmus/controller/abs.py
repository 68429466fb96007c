"""Adaptive backstepping, 4.1.1: the rotational damping and earth-fixed force are estimated, (4.18)."""

from .adaptive import adaptive
from .models import ROTATIONAL

COMPONENT = adaptive("controller_abs", "Adaptive backstepping controller", ROTATIONAL)
