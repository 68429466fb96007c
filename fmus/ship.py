"""A ship: a set of effects, and the components of vessel and thrusters that have them."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

from .actuators.actuation import command_units
from .actuators.law import Law
from .actuators.response import Layout, Prepared
from .actuators.weighted_allocation import axes
from .declare import Component, Known, Variable, variables
from .effects import STANDARD, EffectSet
from .effects.effect import Device
from .hull_functions import FUNCTIONS
from .scale import REFERENCE, Scale
from .ship_description import Description
from .ships.expansion import effects_of_ship
from .sizing import sized
from .thrusters.chain import FIVE, THREE
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
        description: that it is made from; None: CyberShip Enterprise 1.
    """

    effects: EffectSet
    vessel: Component
    thrusters: Component
    devices: frozenset[str] = frozenset(get_args(Device))
    scale: Scale = REFERENCE
    description: Description | None = None

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
    def nominal_drive(self) -> Prepared:
        """The thrusters, nothing wrong with them."""
        return self.thrusters.prepared(self.thrusters.params())

    @property
    def layout(self) -> Layout:
        """What commands the thrusters get, and how these become a force."""
        return self.nominal_drive.effects.layout

    @property
    def layouts(self) -> tuple[Layout, ...]:
        """How runs may have its commands: as the FMU does, and each actuator by its own."""
        return (self.layout,) if self.description is not None else (THREE, FIVE)

    def layout_of(self, commands: Any) -> Layout:
        """The layout of a run's commands (n, k); that of the FMU for None."""
        if commands is None:
            return self.layout
        return next(one for one in self.layouts if len(one.commands) == commands.shape[1])

    @property
    def commands(self) -> Mapping[str, str] | None:
        """``ACTUATOR.COMMAND`` and unit of each command of a described ship."""
        return None if self.description is None else command_units(self.description)

    @property
    def fully_actuated(self) -> bool:
        """Whether its thrusters can be asked for a force on every axis."""
        d = self.description
        return d is None or (d.allocates and len(axes(d)) == 3)

    def commanded_force(self, commands: Any, settings: Any = None) -> Any:
        """tau [N, N, N m], shape (n, 3), that the nominal thrusters give by commands at rest.

        Args:
            commands: (n, k), in one of the layouts.
            settings: (n, m), of the thrusters' power; None: full.
        """
        import numpy as np

        layout = next(one for one in self.layouts if len(one.commands) == commands.shape[1])
        drive = (
            self.nominal_drive if settings is None else layout.powered(self.nominal_drive, settings.T)
        )
        force = layout.believed(tuple(commands.T), drive.params)
        return np.column_stack(np.broadcast_arrays(*force, commands[:, 0]))[:, :3]

    @cached_property
    def coefficients(self) -> Mapping[str, Known]:
        """Coefficients of the nominal hull and thrusters -> where their value comes from."""
        parts = (self.vessel.params, self.thrusters.params)
        return {v.name: v.known for part in parts for v in variables(part) if v.known is not None}

    def serving(self, component: Component) -> Component:
        """A component that is no part of the ship, such as a controller, made for it."""
        return component if self.description is None else sized(component, self.description)

    def component(self, component: Component, module: ModuleType) -> Component | None:
        """A component of this project, made for this ship; None: it is of another ship's kind.

        Args:
            component: as its module declares it.
            module: that declares it; one that makes components of effects and of a ship has ``make``.
        """
        make = getattr(module, "make", None)
        if self.description is None:
            return component if make is None else make(self.effects)
        if not component.any_ship:
            return None
        if make is None:
            return self.serving(component)
        return make(self.effects, self.description) if "ship" in signature(make).parameters else None

    @property
    def candidates(self) -> list[str]:
        """Ids of the effects that a ship with these thrusters can have."""
        return [e.id for e in self.effects.values() if e.needs <= self.devices]


def ship(effects: EffectSet = STANDARD, description: Description | None = None) -> Ship:
    """A ship that may have some effects: a described one, or CyberShip Enterprise 1.

    Raises:
        DeclarationError: parts of the description have names of others, or of its effects.
    """
    return _ship(effects, description)


@cache
def _ship(effects: EffectSet, description: Description | None) -> Ship:
    if description is None:
        return Ship(effects, make_vessel(effects), make_thrusters(effects))
    for file in sorted(_files_of_laws(description) - {file.resolve() for file in effects.files}):
        effects = effects.plus_file(file)
    own = effects_of_ship(description, effects)
    parts = make_vessel(own, description), make_thrusters(own, description)
    for part in parts:
        _ = part.variables  # refuses names that are there twice
    return Ship(own, *parts, frozenset(), description.scale, description)


def _files_of_laws(description: Description) -> set[Path]:
    """Files that are not the project's, in which laws of the ship are; its FMUs carry them."""
    laws = [*(Law.known[part.law] for part in description.actuators)]
    functions = [*(FUNCTIONS[part.law] for part in description.functions)]
    modules = {sys.modules[law.__module__] for law in (*laws, *functions)}
    files = {Path(str(module.__file__)).resolve() for module in modules}
    return {file for file in files if not file.is_relative_to(Path(__file__).parent)}
