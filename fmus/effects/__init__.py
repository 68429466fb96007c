"""What the real ship may have and the nominal model lacks: one declaration each, see :mod:`.effect`."""

from . import (
    all_thrusters,
    environment,
    force,
    inertia,
    linear_map,
    measurement,
    scaling,
)
from .effect import (
    Effect,
    Loaded,
    Memory,
    Motion,
    Running,
    Search,
    Thrust,
    Wording,
    effect,
)
from .effect_set import EffectSet, effects_of
from .families import Family

__all__ = [
    "STANDARD",
    "Effect",
    "EffectSet",
    "Family",
    "Loaded",
    "Memory",
    "Motion",
    "Running",
    "Search",
    "Thrust",
    "Wording",
    "effect",
    "effects_of",
]

# The effects of every ship. Those of the thrusters act in this order.
STANDARD = EffectSet(
    [
        *all_thrusters.LOSSES,
        all_thrusters.lag,
        all_thrusters.delay,
        *[
            e
            for module in (environment, force, linear_map, scaling, inertia, measurement)
            for e in effects_of(module)
        ],
    ]
)
