"""A model of a ship: what differs from its nominal parameters, by the names of the FMUs."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cosim import InputError
from cosim.errors import nearest
from fmus.declare import Component, Variable, packer, variables
from fmus.effects.linear_map import AXES, parameter
from fmus.effects.measurement import CLOCK_OFFSET, COMMAND_LAG, MEASURED_BEHIND
from fmus.fmi.trace import Symbol
from fmus.hull import mass_matrix, without_zeros
from fmus.ship import Ship, ship
from fmus.vessel.vessel import PreparedVessel

from .filters import Filters

if TYPE_CHECKING:  # at run time it takes a while to import
    from ..runs import Fingerprint

Values = Mapping[str, Any]
OF_RUN = "@"  # between a parameter and the run in which alone a value of it holds


class Logging(NamedTuple):
    """How commands are logged.

    Attributes:
        clock: time [s] by which a pose is older than its stamp, and a command is not.
        lag: time constant [s] of a low-pass filter of the commands; 0: none.
    """

    clock: float
    lag: float


class SampledForce(NamedTuple):
    """A force on the hull over the samples of a run, linear in pose and velocity over ground.

    Attributes:
        still: (n, 3) [N, N, N m], where these are zero.
        slope: (n, 3, 6), what one unit of x, y, psi, u, v, r adds.
    """

    still: np.ndarray
    slope: np.ndarray

    def at(self, eta: np.ndarray, nu: np.ndarray) -> np.ndarray:
        """(n, 3) [N, N, N m], at poses and velocities (n, 3)."""
        return self.still + np.einsum("nij,nj->ni", self.slope, np.concatenate([eta, nu], axis=1))


def of_run(parameter: str, run: str) -> str:
    """The name of a parameter's value that holds in one run alone."""
    return f"{parameter}{OF_RUN}{run}"


def parameter_and_run(name: str) -> tuple[str, str]:
    """The parameter that a value is of, and the run in which alone it holds; empty: in all."""
    parameter, _, run = name.partition(OF_RUN)
    return parameter, run


def of_one_run(values: Mapping[str, float], run: str) -> dict[str, float]:
    """Those of some values that hold in all runs or in this one, by parameter."""
    named = ((*parameter_and_run(name), value) for name, value in values.items())
    return {parameter: value for parameter, of, value in named if of in ("", run)}


def parameters(component: Component, values: Values) -> Any:
    """The parameters of a component, nominal but for some.

    Args:
        component: vessel or thrusters.
        values: name -> number, or array (p, 1) for p sets of parameters, or symbol.

    Raises:
        InputError: a name that the component does not have.
    """
    places, starts = _declared(component.params)
    flat: list[Any] = [*starts]
    for name, value in values.items():
        if name not in places:
            raise InputError(f"{component.name} has no parameter '{name}'{nearest(name, places)}")
        flat[places[name]] = value if isinstance(value, (np.ndarray, Symbol)) else float(value)
    return packer(component.params)(flat)


@cache
def _declared(params: type[Any]) -> tuple[dict[str, int], list[float]]:
    """Place of each parameter by its name, and the nominal values, of a component."""
    declared = variables(params)
    return {v.name: k for k, v in enumerate(declared)}, [float(v.start) for v in declared]


@dataclass(frozen=True, eq=False, repr=False)
class Model:
    """Parameters of a ship, by name; what is not named is nominal.

    A time within a run, such as that of a failure, is of that run alone, and so may a current be. Such
    a value is called ``parameter@run``, wherever values have names, and stands in ``runs``;
    :meth:`during` is the model of a run with its values. Without the run, or with another one, they are
    absent.

    Attributes:
        vessel, thrusters: parameter -> value.
        measurement: parameter of the measurement system that no FMU has -> value.
        ship: its components and effects.
        origin: the model that this one was made from by additions; None: itself. Its inertia is the one
            by which a model error is a force.
        runs: run -> parameter of any part -> value that it has in that run alone.
        given: run -> force at its samples that acts beside all else.
        learned_from: runs of which the parameters were learned.
    """

    vessel: Mapping[str, float] = field(default_factory=dict)
    thrusters: Mapping[str, float] = field(default_factory=dict)
    measurement: Mapping[str, float] = field(default_factory=dict)
    ship: Ship = field(default_factory=ship)
    origin: "Model | None" = None
    runs: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    given: Mapping[str, SampledForce] = field(default_factory=dict)
    learned_from: "tuple[Fingerprint, ...]" = ()

    def __repr__(self) -> str:
        parts = (*self.ship.parameters, "measurement")
        stated = {
            f"{part}.{n}": x for part in dict.fromkeys(parts) for n, x in getattr(self, part).items()
        }
        values = ", ".join(f"{name} = {x:.4g}" for name, x in stated.items())
        runs = f"; values of {', '.join(self.runs)}" if self.runs else ""
        return f"<model: {values or 'nominal'}{runs}>"

    def during(self, run: str) -> "Model":
        """The model of one run, with the values that hold in it alone; mostly the model itself."""
        if run not in self.runs:
            return self
        if run not in self._during:
            parts = self.in_parts(self.runs[run])
            own = {part: {**getattr(self, part), **values} for part, values in parts.items()}
            self._during[run] = replace(self, **own, origin=self.origin or self, runs={})
        return self._during[run]

    @cached_property
    def _during(self) -> dict[str, "Model"]:
        return {}

    def plus(self, changes: Mapping[str, float]) -> "Model":
        """The model with additions to some parameters, wherever they belong, or in one run alone.

        Raises:
            InputError: no part of the ship has such a parameter.
        """
        parts = {part: dict(getattr(self, part)) for part in self.ship.parameters}
        runs = {run: dict(values) for run, values in self.runs.items()}
        for name, value in changes.items():
            parameter, run = parameter_and_run(name)
            place = runs.setdefault(run, {}) if run else parts[self.owner(parameter)]
            place[parameter] = self.value(name) + value
        return replace(self, **parts, origin=self.origin or self, runs=runs)

    def in_parts(self, values: Mapping[str, float]) -> dict[str, dict[str, float]]:
        """Values by the part of the ship that their parameters are of, those of all parts that have any.

        Raises:
            InputError: no part of the ship has such a parameter.
        """
        parts: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            parts.setdefault(self.owner(name), {})[name] = value
        return parts

    def declared(self, name: str) -> Variable:
        """The declaration of a parameter of any part of the ship.

        Raises:
            InputError: there is none.
        """
        parameter, _ = parameter_and_run(name)
        return self.ship.parameters[self.owner(parameter)][parameter]

    def value(self, name: str) -> float:
        """A parameter of any part of the ship, or its value in one run.

        Raises:
            InputError: there is none.
        """
        parameter, run = parameter_and_run(name)
        at = self.during(run)
        return at._value(at.owner(parameter), parameter)

    def _value(self, part: str, name: str) -> float:
        return getattr(self, part).get(name, self.ship.parameters[part][name].start)

    def owner(self, name: str) -> str:
        for part, declared in self.ship.parameters.items():
            if name in declared:
                return part
        known = [name for declared in self.ship.parameters.values() for name in declared]
        raise InputError(f"no parameter '{name}'{nearest(name, known)}")

    def unit(self, name: str) -> float:
        """One unit of a parameter at the size of the ship, by Froude's law."""
        return self.ship.scale.factor(self.declared(name).unit)

    @property
    def values(self) -> dict[str, float]:
        """All parameters of the ship."""
        return {n: self._value(part, n) for part, names in self.ship.parameters.items() for n in names}

    @property
    def clock(self) -> float:
        """Time [s] by which a pose is older than its stamp."""
        return self.measurement.get(CLOCK_OFFSET.id, 0.0)

    @property
    def lags(self) -> dict[str, float]:
        """Lags of the actuators [s], by name; empty: none has any."""
        lags = {n: self.value(n) for n in self.ship.coefficients if self.declared(n).unit == "s"}
        return lags if any(lags.values()) else {}

    @property
    def rates(self) -> dict[str, float]:
        """Limits of the rates of commands, by name [the command's unit per s]; none where it is zero."""
        named = (n for n in self.ship.coefficients if n.endswith("_rate"))
        return {n: rate for n in named if (rate := self.value(n))}

    @property
    def logging(self) -> Logging:
        """How the commands are logged."""
        return Logging(self.clock, self.measurement.get(COMMAND_LAG.id, 0.0))

    @cached_property
    def filters(self) -> Filters:
        """Filters behind which x, y and psi are measured."""
        values = (tuple(self.measurement.get(e.id, 0.0) for e in each) for each in MEASURED_BEHIND)
        return Filters(*((position, position, heading) for position, heading in values))

    @cached_property
    def hull(self) -> PreparedVessel:
        """The vessel, ready for a step."""
        b = self.ship.vessel.prepared(parameters(self.ship.vessel, self.vessel))
        return b._replace(hull=b.hull._replace(damping=without_zeros(b.hull.damping)))

    @cached_property
    def drive(self) -> Any:
        """The thrusters, ready for a step, :class:`fmus.actuators.response.PreparedThrusters`."""
        return self.ship.thrusters.prepared(parameters(self.ship.thrusters, self.thrusters))

    @cached_property
    def change_points(self) -> tuple[float, ...]:
        """Times [s] at which failures begin and end in every run, in order."""
        timed = self.ship.effects.timed
        return tuple(sorted({x for n, x in self.thrusters.items() if n in timed}))

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
