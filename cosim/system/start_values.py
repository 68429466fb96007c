"""Start values of a system: from the scenario, tables and parameter sets, checked against the FMUs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from cybership.message_text import name_of

from ..errors import InputError, nearest
from ..fmu.fmu_model import INT_LIMIT, FmuModel, FmuVariable, Value
from ..formats.ssv import ParameterSet
from .controller_model import Chosen, set_controller_models
from .parameter_table import read_table, table_parameters
from .system import System

# Parameter sets, each with its file.
Overrides = Sequence[tuple[Path, ParameterSet]]


def check_parameters(system: System, overrides: Overrides, controller_models: Overrides = ()) -> None:
    """Fill in the start values of a system.

    Args:
        system: is changed.
        overrides: parameter sets of the models that they name.
        controller_models: parameter sets of the models of these that other FMUs have.

    Raises:
        InputError: no such parameter, or a value that it cannot have.
    """
    chosen = _merge_parameters(system, overrides)
    for path, given in controller_models:
        set_controller_models(system, path, given, chosen)
    for name, values in chosen.items():
        model = system.models[name]
        known = model.variables
        settable = {k: v for k, v in known.items() if model.can_be_set(v)}
        system.parameters[name] = []
        for parameter, (value, where) in values.items():
            if parameter not in settable:
                what = "cannot be set" if parameter in known else "does not exist"
                hint = nearest(parameter, list(settable))
                raise InputError(f"{where}: {name}.{name_of(parameter)} {what}{hint}")
            check_value(settable[parameter], value, f"{where}: {name}.{parameter}")
            system.parameters[name].append((settable[parameter], value))


def _merge_parameters(system: System, overrides: Overrides) -> Chosen:
    """Instance -> parameter -> value and its origin; parameter sets override the scenario."""
    chosen: Chosen = {}
    for name, entry in system.scenario.fmus.items():
        chosen[name] = {k: (v, f"fmus.{name}.parameters") for k, v in entry.parameters.items()}
        chosen[name] |= _from_table(system, name)
    for path, given in overrides:
        for name, beside in given.beside.items():
            system.warnings.append(
                f"'{path}': {name} = {beside.value} {beside.unit or ''} is not a parameter of an "
                f"FMU and has no effect here: {beside.description}"
            )
        system.warnings += [f"'{path}': {text}" for text in _of_one_run(given)]
        for model_name in given.values:
            targets = [n for n, model in system.models.items() if model.name == model_name]
            if not targets:
                system.warnings.append(
                    f"'{path}' has values for a model '{model_name}', which is not in the scenario"
                    f"{_models_hint(system, model_name)}"
                )
            for name in targets:
                for parameter, value in _in_units_of(system.models[name], path, given).items():
                    old = chosen[name].get(parameter)
                    if old is not None and old[0] != value:
                        system.warnings.append(
                            f"{name}.{parameter} = {value} from '{path}' overrides {old[0]} from "
                            f"{old[1]}"
                        )
                    chosen[name][parameter] = (value, f"'{path}'")
    return chosen


def _of_one_run(given: ParameterSet) -> Iterator[str]:
    """Which values of a parameter set were found in one measured run and hold for it alone."""
    for model, names in given.of_one_run.items():
        if names:
            first, *others = (f"'{run}'" for run in given.runs)
            more = f"; values that were found in {', '.join(others)} are not used" if others else ""
            called = " … ".join(dict.fromkeys((names[0], names[-1])))
            verb = "was" if len(names) == 1 else "were"
            holds = "holds" if len(names) == 1 else "hold"
            yield f"{model}.{called} {verb} found in run {first} and {holds} for that run only{more}"


def _from_table(system: System, name: str) -> dict[str, tuple[Value, str]]:
    """The parameters of one instance from its table, and their origin."""
    entry = system.scenario.fmus[name]
    if entry.table is None:
        return {}
    path = system.scenario.folder / entry.table
    known = {k: v for k, v in system.models[name].variables.items() if v.causality == "parameter"}
    found = table_parameters(read_table(path), known, f"fmus.{name}.table '{path}'")
    for parameter in entry.parameters:
        if parameter in found:
            raise InputError(f"fmus.{name}: {parameter} is given twice, in parameters and by '{path}'")
    return {parameter: (value, f"'{path}'") for parameter, value in found.items()}


def _models_hint(system: System, wrong: str) -> str:
    if wrong in system.models:
        return f"; the model of that instance is called '{system.models[wrong].name}'"
    return nearest(wrong, {model.name for model in system.models.values()})


def _in_units_of(model: FmuModel, path: Path, given: ParameterSet) -> dict[str, Value]:
    """The values of a parameter set for one model, in the units of the FMU.

    Raises:
        InputError: no such variable, or a unit that does not fit.
    """
    found: dict[str, Value] = {}
    for name, parameter in given.values[model.name].items():
        where = f"'{path}': {model.name}.{name}"
        variable = model.variables.get(name)
        if variable is None:
            raise InputError(f"{where} does not exist{_effects_hint(model, name)}")
        value = given.number(parameter, variable.unit, where)
        found[name] = int(value) if variable.type != "Real" and value.is_integer() else value
    return found


def _effects_hint(model: FmuModel, wrong: str) -> str:
    """A hint for a parameter that an FMU lacks, and how one of this project would get it."""
    hint = nearest(wrong, [v.name for v in model.variables.values() if v.causality == "parameter"])
    if model.path.name != f"{model.name}.fmu":
        return hint
    return (
        f"{hint}; if it is of an effect of your own, build the FMU that has it, with "
        f"'python -m fmus.build {model.name} --effects FILE.py --out fmu', and name it by its path"
    )


def check_value(variable: FmuVariable, value: Value | None, where: str) -> None:
    """Refuse a value that is not of a variable's type, or outside its range.

    Raises:
        InputError: begins with ``where``.
    """
    if variable.type == "String":
        fits = isinstance(value, str)
    elif variable.type == "Boolean":
        fits = isinstance(value, bool) or value in (0, 1)
    elif variable.type == "Real":
        fits = isinstance(value, (int, float)) and not isinstance(value, bool)
    else:
        fits = isinstance(value, int) and not isinstance(value, bool) and abs(value) < INT_LIMIT
    if not fits:
        raise InputError(f"{where} = {value!r}: needs a value of type {variable.type}")
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        if variable.min is not None and value < variable.min:
            raise InputError(f"{where} = {value} is below its minimum {variable.min}")
        if variable.max is not None and value > variable.max:
            raise InputError(f"{where} = {value} is above its maximum {variable.max}")
