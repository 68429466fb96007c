"""What the real ship may have and the nominal model lacks: one declaration each, see :mod:`.effect`."""

from . import (
    actuator,
    environment,
    force,
    inertia,
    linear_map,
    measurement,
    outages,
    propellers,
    scaling,
    single_propellers,
    thrust_curves,
    thruster_dynamics,
)
from .effect import (
    EACH_VSP,
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
    "EACH_VSP",
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

# The effects of this project. Those of the thrusters act in this order.
STANDARD = EffectSet(
    e
    for module in (
        thrust_curves,
        single_propellers,
        propellers,
        actuator,
        outages,
        thruster_dynamics,
        environment,
        force,
        linear_map,
        scaling,
        inertia,
        measurement,
    )
    for e in effects_of(module)
)
