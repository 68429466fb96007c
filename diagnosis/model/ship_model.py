"""A model of a ship: what differs from its nominal parameters, by the names of the FMUs."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.declare import Component, Variable, packer, variables
from fmus.effects.linear_map import AXES, parameter
from fmus.effects.measurement import CLOCK_OFFSET
from fmus.hull import mass_matrix
from fmus.ship import Ship, ship
from fmus.vessel.vessel import Prepared

Values = Mapping[str, Any]


def parameters(component: Component, values: Values) -> Any:
    """The parameters of a component, nominal but for some.

    Args:
        component: vessel or thrusters.
        values: name -> number, or array (p, 1) for p sets of parameters.

    Raises:
        InputError: a name that the component does not have.
    """
    declared = variables(component.params)
    names = [v.name for v in declared]
    for name in values:
        if name not in names:
            raise InputError(f"{component.name} has no parameter '{name}'{nearest(name, names)}")
    flat = [values.get(v.name, v.start) for v in declared]
    return packer(component.params)([v if isinstance(v, np.ndarray) else float(v) for v in flat])


@dataclass(frozen=True, eq=False)
class Model:
    """Parameters of a ship, by name; what is not named is nominal.

    Attributes:
        vessel, thrusters: parameter -> value.
        measurement: parameter of the measurement system that no FMU has -> value.
        ship: its components and effects.
        origin: the model that this one was made from by additions; None: itself. Its inertia is the one
            by which a model error is a force.
    """

    vessel: Mapping[str, float] = field(default_factory=dict)
    thrusters: Mapping[str, float] = field(default_factory=dict)
    measurement: Mapping[str, float] = field(default_factory=dict)
    ship: Ship = field(default_factory=ship)
    origin: "Model | None" = None

    def plus(self, changes: Mapping[str, float]) -> "Model":
        """The model with additions to some parameters, wherever they belong.

        Raises:
            InputError: no part of the ship has such a parameter.
        """
        parts = {part: dict(getattr(self, part)) for part in self.ship.parameters}
        for name, value in changes.items():
            part = self._owner(name)
            parts[part][name] = self._value(part, name) + value
        return Model(**parts, ship=self.ship, origin=self.origin or self)

    def declared(self, name: str) -> Variable:
        """The declaration of a parameter of any part of the ship.

        Raises:
            InputError: there is none.
        """
        return self.ship.parameters[self._owner(name)][name]

    def value(self, name: str) -> float:
        """A parameter of any part of the ship.

        Raises:
            InputError: there is none.
        """
        return self._value(self._owner(name), name)

    def _value(self, part: str, name: str) -> float:
        return getattr(self, part).get(name, self.ship.parameters[part][name].start)

    def _owner(self, name: str) -> str:
        for part, declared in self.ship.parameters.items():
            if name in declared:
                return part
        known = [name for declared in self.ship.parameters.values() for name in declared]
        raise InputError(f"no parameter '{name}'{nearest(name, known)}")

    @property
    def values(self) -> dict[str, float]:
        """All parameters of the ship."""
        return {n: self._value(part, n) for part, names in self.ship.parameters.items() for n in names}

    @property
    def clock(self) -> float:
        """Time [s] by which a pose is older than its stamp."""
        return self.measurement.get(CLOCK_OFFSET.id, 0.0)

    @cached_property
    def hull(self) -> Prepared:
        """The vessel, ready for a step."""
        return self.ship.vessel.prepared(parameters(self.ship.vessel, self.vessel))

    @cached_property
    def drive(self) -> Any:
        """The thrusters, ready for a step, :class:`fmus.thrusters.chain.Prepared`."""
        return self.ship.thrusters.prepared(parameters(self.ship.thrusters, self.thrusters))

    @cached_property
    def mass(self) -> np.ndarray:
        """(3, 3), mass matrix M [kg, kg m, kg m2], effects included."""
        return np.array(mass_matrix(self.hull.hull.inertia))

    @cached_property
    def effective_thrust(self) -> np.ndarray:
        """(3, 3), I + B_tau: force on the hull by the thrusters' force, with the effect linear_map."""
        given = [[self.vessel.get(parameter(a, f"tau_{b}"), 0.0) for b in AXES] for a in AXES]
        return np.eye(3) + np.array(given)

    @property
    def reference_mass(self) -> np.ndarray:
        """(3, 3), mass matrix by which accelerations are forces: of the model this was made from."""
        return (self.origin or self).mass
