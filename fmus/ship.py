"""A ship: a set of effects, and the components of vessel and thrusters that have them."""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from .actuators.actuation import command_units
from .actuators.law import Law
from .actuators.response import CommandLayout, PreparedThrusters, layouts
from .actuators.weighted_allocation import axes
from .declare import Component, DeclarationError, Known, Variable, discover, variables
from .effects import STANDARD, EffectSet
from .hull import mass_matrix
from .hull_functions import FUNCTIONS
from .scale import Scale
from .ship_description import Description
from .ships.expansion import effects_of_ship, ship_parts
from .ships.naming import DEFAULT, described_ship
from .sizing import sized
from .thrusters.thrusters import make as make_thrusters
from .vessel.vessel import make as make_vessel

if TYPE_CHECKING:
    import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class Ship:
    """A ship's components. Two ships, or one with and without a user's effects, may live side by side.

    Attributes:
        effects: what it may have beyond its nominal model.
        vessel, thrusters: its components, which have these effects.
        description: that it is made from.
    """

    effects: EffectSet
    vessel: Component
    thrusters: Component
    description: Description

    def __repr__(self) -> str:
        return f"<ship {self.name}>"

    @property
    def name(self) -> str:
        """By which it is called."""
        return self.description.name

    @property
    def scale(self) -> Scale:
        """Its size."""
        return self.description.scale

    @property
    def devices(self) -> frozenset[str]:
        """Names of its actuators, and of the units of those that have two."""
        return frozenset(ship_parts(self.description))

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
    def nominal_drive(self) -> PreparedThrusters:
        """The thrusters, nothing wrong with them."""
        return self.thrusters.prepared(self.thrusters.params())

    @cached_property
    def mass(self) -> "np.ndarray":
        """(3, 3), mass matrix M of the nominal model [kg, kg m, kg m2], (2.4)-(2.5)."""
        import numpy as np

        return np.array(mass_matrix(self.vessel.prepared(self.vessel.params()).hull.inertia))

    @property
    def layout(self) -> CommandLayout:
        """The commands of the thrusters, and how these become a force."""
        return self.nominal_drive.effects.layout

    @property
    def layouts(self) -> tuple[CommandLayout, ...]:
        """How runs may have its commands: as the FMU does, and each unit of its actuators by its own."""
        return layouts(self.description)

    def layout_of(self, commands: "np.ndarray | None") -> CommandLayout:
        """The layout of a run's commands (n, k); that of the FMU for None."""
        if commands is None:
            return self.layout
        return next(one for one in self.layouts if len(one.commands) == commands.shape[1])

    @property
    def commands(self) -> Mapping[str, str]:
        """``ACTUATOR.COMMAND`` and unit of each of its commands."""
        return command_units(self.description)

    @property
    def command_forms(self) -> tuple[Mapping[str, str], ...]:
        """The same for each of :attr:`layouts`."""
        return tuple([command_units(self.description, k > 0) for k in range(len(self.layouts))])

    def form_of(self, commands: "np.ndarray | None") -> Mapping[str, str]:
        """The names and units of a run's commands (n, k)."""
        return self.command_forms[self.layouts.index(self.layout_of(commands))]

    @property
    def power_settings(self) -> tuple[str, ...]:
        """Names of the power settings of its actuators."""
        return tuple([v.name for v in variables(type(self.nominal_drive.params.power))])

    @property
    def allocation_parameters(self) -> frozenset[str]:
        """Parameters of its thrusters that are of the allocation's model, and not of the plant."""
        p = self.thrusters.params()
        return frozenset(v.name for part in (p.allocation, p.attack) for v in variables(type(part)))

    @property
    def fully_actuated(self) -> bool:
        """Whether its thrusters can be asked for a force on every axis."""
        return self.description.allocates and len(axes(self.description)) == 3

    def commanded_force(
        self,
        commands: "np.ndarray",
        settings: "np.ndarray | None" = None,
        surge: "np.ndarray | float" = 0.0,
    ) -> "np.ndarray":
        """tau [N, N, N m], shape (n, 3), that the nominal thrusters give by commands.

        Args:
            commands: (n, k), in one of the layouts.
            settings: (n, m), of the thrusters' power; None: full.
            surge: (n,), speed ahead [m/s]; by default the ship is at rest.
        """
        import numpy as np

        layout = self.layout_of(commands)
        drive = (
            self.nominal_drive if settings is None else layout.powered(self.nominal_drive, settings.T)
        )
        force = layout.nominal_force(tuple(commands.T), drive.params, (surge, 0.0, 0.0))
        return np.column_stack(np.broadcast_arrays(*force, commands[:, 0]))[:, :3]

    @cached_property
    def coefficients(self) -> Mapping[str, Known]:
        """Coefficients of the nominal hull and thrusters -> where their value comes from."""
        parts = (self.vessel.params, self.thrusters.params)
        return {v.name: v.known for part in parts for v in variables(part) if v.known is not None}

    def serving(self, component: Component) -> Component:
        """A component that is not part of the ship, such as a controller, made for it."""
        return sized(component, self.description)

    def component(self, component: Component | None, module: ModuleType) -> Component | None:
        """A component of a module, made for this ship; None: it has none for such a ship.

        Args:
            component: as its module declares it, if it does.
            module: that declares it; one that makes components of effects and of a ship has ``make``.
        """
        make = getattr(module, "make", None)
        if make is not None:
            return make(self.effects, self.description)
        if component is None or not (component.any_ship or self.name == DEFAULT):
            return None
        return self.serving(component)

    @cached_property
    def components(self) -> Mapping[str, tuple[str, Component]]:
        """Name of every FMU that it can have -> module name and component."""
        return {component.name: (module, component) for module, component in discover(self)}

    @property
    def candidates(self) -> list[str]:
        """Ids of the effects that a ship with these thrusters can have."""
        return [e.id for e in self.effects.values() if e.needs <= self.devices]


def ship(effects: EffectSet = STANDARD, description: Description | None = None) -> Ship:
    """A ship that may have some effects.

    Args:
        effects: those of every ship, with or without a user's.
        description: of the ship; None: the default ship.

    Raises:
        DeclarationError: parts of the description have names of others, or of its effects.
    """
    return _ship(effects, described_ship(description))


@cache
def _ship(effects: EffectSet, description: Description) -> Ship:
    for file in sorted(_files_of_laws(description) - {file.resolve() for file in effects.files}):
        effects = effects.plus_file(file)
    own = effects_of_ship(description, effects)
    parts = make_vessel(own, description), make_thrusters(own, description)
    for part in parts:
        try:
            _ = part.variables  # refuses names that are there twice
        except DeclarationError as error:
            where = " or ".join(f"'{file}'" for file in effects.files)
            raise DeclarationError(f"{where}: {error}" if where else str(error)) from error
    return Ship(own, *parts, description)


def _files_of_laws(description: Description) -> set[Path]:
    """Files that are not the project's, in which laws of the ship are; its FMUs carry them."""
    laws = [*(Law.known[part.law] for part in description.actuators)]
    functions = [*(FUNCTIONS[part.law] for part in description.functions)]
    modules = {sys.modules[law.__module__] for law in (*laws, *functions)}
    files = {Path(str(module.__file__)).resolve() for module in modules}
    return {file for file in files if not file.is_relative_to(Path(__file__).parent)}
