"""A model as a file: an SSP 1.0 parameter set with what differs from the nominal model.

``python -m cosim.run SCENARIO --parameters model.ssv`` runs with it, ``python -m fmus.build --parameters
model.ssv`` makes FMUs that have it, and any tool that knows SSP can bind it to ours.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from cosim import (
    BASE_UNITS,
    InputError,
    Parameter,
    ParameterSet,
    Unit,
    read_parameters,
    write_parameters,
)
from cosim.errors import nearest
from fmus.base_units import base_exponents
from fmus.declare import DeclarationError, Variable
from fmus.effects import STANDARD
from fmus.installed import plus_files
from fmus.ship import Ship, ship
from fmus.ships.naming import described_ship

from ..runs import fingerprints
from .ship_model import Model

MEASUREMENT, THRUSTERS = "measurement", "thrusters"
# What a tool gets of a parameter that no FMU has.
NO_FMU = "of the measurement system: no FMU has this parameter; a scenario has a fault instead"


def write_model(path: str | Path, model: Model) -> None:
    """Write a model as a parameter set.

    Nominal values are left out: the file of the nominal model is an empty set. No FMU has
    a parameter of the measurement system, such as the offset of its clock: it stands in an
    annotation, which :func:`read_model` knows, and of which ``cosim.run`` says that it has no effect.
    Values that hold in one run alone stand in another, with the name of their run; times of the first
    such run are parameters as well, of which ``cosim.run`` says whose they are.

    Args:
        path: ``.ssv``; an older file is replaced.
        model: its parameters may be of a user's effects, if those were loaded.

    Raises:
        InputError: a parameter that no FMU has, or a value that its FMU would refuse.
    """
    values = {
        part: _told(part, getattr(model, part), names) for part, names in model.ship.parameters.items()
    }
    runs = {
        run: {
            part: _told(part, of_part, model.ship.parameters[part])
            for part, of_part in model.in_parts(own).items()
        }
        for run, own in model.runs.items()
    }
    for part, own in next(iter(runs.values()), {}).items():
        times = {name: x for name, x in own.items() if name in model.ship.effects.timed}
        values[part] = {**times, **values[part]}
    beside = values.pop(MEASUREMENT)
    of_runs = (own for parts in runs.values() for own in parts.values())
    groups = (*values.values(), beside, *of_runs)
    used = [str(given.unit) for group in groups for given in group.values()]
    units = {unit: base_exponents(unit) for unit in sorted(set(used))}
    learned = [f.content() for f in model.learned_from]
    write_parameters(path, ParameterSet(values, units, beside, "model", runs, learned))


def _told(
    part: str, values: Mapping[str, float], declared: Mapping[str, Variable]
) -> dict[str, Parameter]:
    """What differs from the nominal values of a part of the ship, for a file."""
    stated = {}
    for name, value in values.items():
        v = _find(name, declared, f"{part}.{name}")
        if _within(float(value), v, f"{part}.{name}") != v.start:
            text = f"{v.description}; {NO_FMU}" if part == MEASUREMENT else v.description
            stated[name] = Parameter(float(value), v.unit, text)
    return stated


def ship_with(files: Sequence[Path], name: str | Path | None = None) -> Ship:
    """A ship with the effects of a user's files.

    Args:
        files: of effects, or names of effects of installed packages.
        name: of a shipped ship, or the path of a description; None: the default ship.

    Raises:
        InputError: no such ship, or a file has no effects, or fails.
    """
    try:
        return ship(plus_files(STANDARD, files), described_ship(name))
    except DeclarationError as error:
        raise InputError(" ".join(str(error).split())) from None


def read_model(path: str | Path, of: Ship | None = None) -> Model:
    """A model from a parameter set.

    Args:
        path: ``.ssv``; a value without a unit is in that of the FMU.
        of: the ship that it is a model of; by default with the effects of this project.

    Raises:
        InputError: no parameter set, a model or parameter that is not ours, a value or unit that does
            not fit.
    """
    given = read_parameters(path)
    of = of or ship()
    declared = {part: names for part, names in of.parameters.items() if part != MEASUREMENT}

    def numbers(values: Mapping[str, Mapping[str, Parameter]]) -> dict[str, dict[str, float]]:
        found: dict[str, dict[str, float]] = {part: {} for part in declared}
        for part, own in values.items():
            if part not in declared:
                raise InputError(f"'{path}' has values for '{part}'{nearest(part, declared)}")
            for name, parameter in own.items():
                where = f"'{path}': {part}.{name}"
                v = _find(name, declared[part], where)
                exponents = base_exponents(v.unit)
                unit = Unit(v.unit, tuple(exponents.get(base, 0) for base in BASE_UNITS))
                found[part][name] = _within(given.number(parameter, unit, where), v, where)
        return found

    found = numbers(given.values)
    for part, names in given.of_one_run.items():
        for name in names:
            del found[part][name]
    runs = {
        run: {name: x for of_part in numbers(own).values() for name, x in of_part.items()}
        for run, own in given.runs.items()
    }
    known = of.parameters[MEASUREMENT]
    beside = {name: p.value for name, p in given.beside.items() if name in known}
    learned = fingerprints(given.learned_from, Path(path))
    return Model(found["vessel"], found[THRUSTERS], beside, of, runs=runs, learned_from=learned)


def _find(name: str, declared: Mapping[str, Variable], where: str) -> Variable:
    if name not in declared:
        raise InputError(
            f"{where} is not a parameter{nearest(name, declared)}; one of an effect of your own "
            "needs --effects FILE.py"
        )
    return declared[name]


def _within(value: float, v: Variable, where: str) -> float:
    """The value, if its FMU would take it."""
    low = -math.inf if v.range.min is None else v.range.min
    high = math.inf if v.range.max is None else v.range.max
    if not (math.isfinite(value) and low <= value <= high):
        raise InputError(f"{where} = {value:g} is not a number from {low:g} to {high:g}")
    return value
