"""What the real ship may have and the nominal model lacks: one registry, see :mod:`.registry`."""

from . import actuator, environment, force, inertia, measurement
from .registry import EFFECTS, Effect, Running, Ship, Thrust, effect, effects, find, load

__all__ = [
    "EFFECTS",
    "Effect",
    "Running",
    "Ship",
    "Thrust",
    "actuator",
    "effect",
    "effects",
    "environment",
    "find",
    "force",
    "inertia",
    "load",
    "measurement",
]
