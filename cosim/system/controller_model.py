"""Controller models: the model of the plant that a parameter set gives to controllers and observers.

An FMU has a model of a plant if it has parameters of the plant's names (``m``, ``X_u``, ...), or
parameters from which it learns that its model description annotates as estimates of these
(:func:`cosim.formats.outline.read_estimates`). It gets the whole model: of what the file does not name,
the start value of the plant's FMU. ``delta_NAME`` adds to ``NAME``.
"""

from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError
from ..fmu.fmu_model import FmuModel, FmuVariable, Value
from ..formats.outline import read_estimates
from ..formats.ssv import ParameterSet
from .system import System

ADDITION = "delta_"

# Instance -> parameter -> value and its origin.
Chosen = dict[str, dict[str, tuple[Value, str]]]


def set_controller_models(system: System, path: Path, given: ParameterSet, chosen: Chosen) -> None:
    """Give a model of the plant to all FMUs that have one.

    Args:
        system: receives warnings of values that no FMU takes.
        path: of the parameter set.
        given: its content.
        chosen: start values by instance; is changed.

    Raises:
        InputError: the plant is not here, or no FMU has a model of it.
    """
    if not given.values:
        system.warnings.append(f"'{path}' is the nominal model: the controller models do not change")
        return
    users, used = set(), set()
    for model_name in given.values:
        plant = next((m for m in system.models.values() if m.name == model_name), None)
        if plant is None:
            raise InputError(
                f"'{path}' has values for a model '{model_name}', which is not in the scenario"
            )
        model = _PlantModel(plant, path, given)
        for name, fmu in system.models.items():
            if fmu is plant:
                continue
            for v, value, names in model.of(fmu):
                chosen[name][v.name] = (value, f"controller model '{path}'")
                users.add(name)
                used.update((model_name, used_name) for used_name in names)
    if not users:
        raise InputError(
            f"'{path}': no controller and no observer of the scenario has parameters of the model "
            f"{', '.join(given.values)}; --parameters sets those of the ship itself"
        )
    unused = [f"{m}.{n}" for m, values in given.values.items() for n in values if (m, n) not in used]
    if unused:
        system.warnings.append(
            f"'{path}': no controller and no observer of the scenario uses {', '.join(unused)}"
        )


class _PlantModel:
    """The model of a parameter set: the plant's start values, and what the set says otherwise."""

    def __init__(self, plant: FmuModel, path: Path, given: ParameterSet) -> None:
        self._plant = {n: v for n, v in plant.variables.items() if _coefficient(v)}
        where = f"'{path}': {plant.name}."
        self._given: dict[str, float] = {}
        for name, parameter in given.values[plant.name].items():
            if name not in plant.variables:
                raise InputError(f"{where}{name} does not exist")
            self._given[name] = given.number(parameter, plant.variables[name].unit, where + name)

    def of(self, fmu: FmuModel) -> Iterator[tuple[FmuVariable, float, list[str]]]:
        """Parameters of an FMU, the value of each, and the names of the set that say so."""
        parameters = [v for v in fmu.variables.values() if v.causality == "parameter"]
        estimates = read_estimates(fmu.annotations)
        changing = {estimate.of for estimate in estimates.values() if estimate.change}
        for v in parameters:
            estimate = estimates.get(v.name)
            name = v.name if estimate is None else estimate.of
            if name not in self._plant or (estimate is None and v.unit != self._plant[name].unit):
                continue
            if estimate is not None and estimate.change:
                yield v, self._given.get(ADDITION + name, 0.0), [ADDITION + name]
            elif estimate is None and name in changing:
                yield v, self._base(name), [name]
            else:
                added = self._given.get(ADDITION + name, 0.0)
                yield v, self._base(name) + added, [name, ADDITION + name]

    def _base(self, name: str) -> float:
        return self._given.get(name, float(self._plant[name].start or 0.0))


def _coefficient(v: FmuVariable) -> bool:
    """Whether a parameter is one of the model: initial states are fixed, coefficients tunable."""
    return v.causality == "parameter" and v.type == "Real" and v.variability == "tunable"
