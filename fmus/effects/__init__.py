"""What the real ship may have and the nominal model lacks: one declaration each, see :mod:`.effect`."""

from . import (
    actuator,
    environment,
    force,
    inertia,
    measurement,
    outages,
    single_propellers,
    thrust_curves,
    thruster_dynamics,
)
from .effect import EACH_VSP, Effect, Memory, Motion, Running, Search, Thrust, Wording, effect
from .effect_set import EffectSet, effects_of
from .families import Family

__all__ = [
    "EACH_VSP",
    "STANDARD",
    "Effect",
    "EffectSet",
    "Family",
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
        actuator,
        outages,
        thruster_dynamics,
        environment,
        force,
        inertia,
        measurement,
    )
    for e in effects_of(module)
)
