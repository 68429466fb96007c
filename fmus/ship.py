"""A ship: a set of effects, and the components of vessel and thrusters that have them."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import get_args

from .declare import Component, Known, Variable, variables
from .effects import STANDARD, EffectSet
from .effects.effect import Device
from .scale import CSE1, Scale
from .thrusters.thrusters import make as make_thrusters
from .vessel.vessel import make as make_vessel


@dataclass(frozen=True, eq=False)
class Ship:
    """A ship's components. Two ships, or one with and without a user's effects, may live side by side.

    Attributes:
        effects: what it may have beyond its nominal model.
        vessel, thrusters: its components, which have these effects.
        devices: thrusters that it has.
        scale: its size.
    """

    effects: EffectSet
    vessel: Component
    thrusters: Component
    devices: frozenset[str] = frozenset(get_args(Device))
    scale: Scale = CSE1

    @cached_property
    def parameters(self) -> Mapping[str, Mapping[str, Variable]]:
        """Part of the ship -> parameters by name; ``measurement`` has those that no FMU has."""
        return {
            "vessel": {v.name: v for v in variables(self.vessel.params)},
            "thrusters": {v.name: v for v in variables(self.thrusters.params)},
            "measurement": {
                p.name: p
                for e in self.effects.of_kind("measurement")
                if e.function is None
                for p in e.parameters
            },
        }

    @cached_property
    def coefficients(self) -> Mapping[str, Known]:
        """Coefficients of the nominal hull and thrusters -> where their value comes from."""
        parts = (self.vessel.params, self.thrusters.params)
        return {v.name: v.known for part in parts for v in variables(part) if v.known is not None}

    @property
    def candidates(self) -> list[str]:
        """Ids of the effects that a ship with these thrusters can have."""
        return [e.id for e in self.effects.values() if e.needs <= self.devices]


@cache
def ship(effects: EffectSet = STANDARD) -> Ship:
    """CyberShip Enterprise 1 with a set of effects."""
    return Ship(effects, make_vessel(effects), make_thrusters(effects))
