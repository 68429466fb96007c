"""Which variable of an FMU is which signal of a run: known by names and units, or by a map file.

A map has the form of the file next to a measurement, once for inputs, outputs and start values::

    {
        "inputs": {"tau_X": "Thrust.X", "rudder.delta": {"name": "delta", "unit": "deg", "flip": true}},
        "outputs": {"x": "north", "y": "east", "psi": {"name": "hdg", "unit": "deg"}},
        "start": {"u": "u_0", "v": "v_0", "r": "r_0"},
        "run_in": 60.0,
    }

Inputs for a force or an acceleration that acts in addition are in ``disturbance_inputs``, by ``tau_X``
or ``u_dot`` and so on. A number in place of an output is one that the FMU lacks, as the sway of what
moves ahead alone. A variable whose unit the map does not state is in that of its FMU, else in SI.
"""

import json
import re
from collections.abc import Iterable, Mapping
from math import pi
from pathlib import Path
from typing import Annotated, Any

from pydantic import AllowInfNan, BaseModel, ConfigDict, Field, NonNegativeFloat

from cosim import BASE_UNITS, InputError, Unit
from cosim.errors import most_alike, nearest
from cosim.fmu import FmuModel, FmuVariable
from cosim.scenario import read_model
from cybership.message_text import quoted
from fmus.addition import Line
from fmus.base_units import base_exponents

from ...runs import QUANTITY, UNITS, Column
from ...runs.columns.unit_check import SI_UNIT
from ..black_box import MOTION, POSE, VELOCITY
from .signal_names import NONE, Meant, lone, meant

PROPOSED = ("inputs", "outputs", "start")
DISTURBANCES = "disturbance_inputs"
GROUPS = (*PROPOSED, DISTURBANCES)
# Inputs that act beside all else: forces, or accelerations.
BESIDE = {"tau_X": "force", "tau_Y": "force", "tau_N": "moment",
          "u_dot": "acceleration", "v_dot": "acceleration", "r_dot": "angular acceleration"}  # fmt: skip
# What marks a variable as a start value, before or behind the name of the signal.
BEFORE = re.compile(r"(initial|init|start)_?(?P<core>.+)")
BEHIND = re.compile(r"(?P<core>.+?)_?(0|initial|init|start)")


Number = Annotated[float, Field(allow_inf_nan=False, strict=True)]


class VariableMap(BaseModel):
    """The content of a map file; a signal without a variable is null or missing."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    inputs: dict[str, Column | None] = Field(default_factory=dict, description="commands or forces")
    outputs: dict[str, Column | Number | None] = Field(
        default_factory=dict, description="pose or velocity; a number [SI] if it is constant"
    )
    start: dict[str, Column | None] = Field(default_factory=dict, description="start values")
    disturbance_inputs: dict[str, Column | None] = Field(
        default_factory=dict, description="forces or accelerations that act in addition to all others"
    )
    run_in: Annotated[NonNegativeFloat, AllowInfNan(False)] | None = Field(
        default=None, description="time before the comparison of a whole run begins [s]"
    )

    def stated(self, group: str) -> dict[str, Column]:
        """The signals of a group that have a variable."""
        every: Mapping[str, Column | float | None] = getattr(self, group)
        return {signal: column for signal, column in every.items() if isinstance(column, Column)}

    @property
    def fixed(self) -> dict[str, float]:
        """The outputs that stay the same [SI]."""
        return {signal: x for signal, x in self.outputs.items() if isinstance(x, float)}

    @property
    def known(self) -> set[str]:
        """The outputs that have a variable, or stay the same."""
        return {*self.stated("outputs"), *self.fixed}

    def content(self) -> dict[str, Any]:
        """As JSON holds it: a signal with the name of its variable alone, where no more is to tell."""
        stated = self.model_dump(exclude_defaults=True)
        for group in (g for g in GROUPS if g in stated):
            for signal, column in stated[group].items():
                if isinstance(column, dict) and column.keys() == {"name"}:
                    stated[group][signal] = column["name"]
        return stated


def read_map(path: Path) -> VariableMap:
    """A map from its file.

    Raises:
        InputError: it is none.
    """
    return read_model(path, VariableMap, "a map", strict=False, renamed="map")


def write_map(path: Path, content: Mapping[str, Any]) -> None:
    """Write a map as JSON."""
    path.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def quantities(commands: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Group -> signal -> quantity of all that a map may have, of a run with some commands."""
    motion = {signal: QUANTITY[signal] for signal in MOTION}
    start = {**motion, **commands}
    return {"inputs": dict(commands), "outputs": motion, "start": start, DISTURBANCES: BESIDE}


def signal_lines(map: VariableMap, commands: Mapping[str, str]) -> dict[str, dict[str, Line]]:  # noqa: A002
    """Group -> signal in SI by its variable.

    Args:
        map: with the units of all variables.
        commands: of the runs: signal -> quantity.
    """

    def line(c: Column, quantity: str) -> Line:
        unit = UNITS[quantity].get(c.unit or "", 1.0)
        return Line((-c.factor if c.flip else c.factor) * unit, c.offset * unit)

    known = quantities(commands)
    return {g: {s: line(c, known[g][s]) for s, c in map.stated(g).items()} for g in GROUPS}


def propose(model: FmuModel, commands: Mapping[str, str]) -> VariableMap:
    """The map that names and units of an FMU tell.

    Args:
        model: the FMU.
        commands: of the runs: signal -> quantity.
    """
    found: dict[str, Any] = {}
    every, refused = quantities(commands), set[str]()
    for group, known in ((g, every[g]) for g in PROPOSED):
        signals: dict[str, Column | None] = dict.fromkeys(known)
        each = [(v, _meant(v, group, known)) for v in _candidates(model, group)]
        by: dict[str, tuple[FmuVariable, Meant]] = {}
        for v, m in sorted(each, key=lambda pair: not _same(pair[0].name, pair[1].signal)):
            if m.signal in known and m.signal not in by and _fits(v.unit, known[m.signal]):
                by[m.signal] = v, m
        seen = {signal: m for signal, (_, m) in by.items()}
        if group != "start":  # whose marks say more than a letter, unless the output is another thing
            refused = {s for each in (POSE, VELOCITY) for s in lone(seen, each)}
        for signal, (v, m) in by.items():
            if signal not in refused:
                signals[signal] = _column(v, m)
        found[group] = signals
    return VariableMap(**found)


def _column(v: FmuVariable, m: Meant) -> Column:
    stated = m.unit or (v.unit.name if v.unit else "rad")
    quarter = pi / 2.0 / UNITS["angle"].get(stated, 1.0) if m.quarter else 0.0
    return Column(name=v.name, unit=m.unit, flip=m.flip, offset=quarter)


def completed(
    given: VariableMap, model: FmuModel, commands: Mapping[str, str], where: str
) -> VariableMap:
    """A map with the units that the FMU declares, checked against it.

    Args:
        given: from a file, or proposed.
        model: the FMU.
        commands: of the runs: signal -> quantity.
        where: what messages call the map.

    Raises:
        InputError: no such signal or variable, or a unit of another quantity.
    """
    found: dict[str, Any] = {"run_in": given.run_in}
    for group, known in quantities(commands).items():
        variables = {v.name: v for v in _candidates(model, group)}
        found[group] = dict(given.fixed) if group == "outputs" else {}
        for signal, column in given.stated(group).items():
            place = f"{where}: {group}.{signal}"
            if signal not in known:
                raise InputError(f"{place} is not a signal of these runs{nearest(signal, known)}")
            if column.name not in variables:
                hint = nearest(column.name, variables)
                raise InputError(f"{place}: the FMU has no variable {quoted(column.name)}{hint}")
            if column.factor == 0.0:
                raise InputError(f"{place}.factor is 0; give another number")
            if column.unit is not None and column.unit not in UNITS[known[signal]]:
                hint = nearest(column.unit, UNITS[known[signal]])
                raise InputError(f"{place}: {quoted(column.unit)} is not a unit of {signal}{hint}")
            found[group][signal] = _with_unit(column, variables[column.name], known[signal], place)
    return VariableMap(**found)


def unmatched(found: VariableMap, model: FmuModel) -> list[str]:
    """What an FMU lacks in order to be held against a run, a part of a sentence each."""
    lacking = []
    outputs = found.known
    if not any(set(group) <= outputs for group in (POSE, VELOCITY)):
        missing = [s for s in (POSE if outputs & {"x", "y"} else MOTION) if s not in outputs]
        lacking.append(f"no output is {_with_hints(missing, model, 'outputs')}")
    if not found.stated("inputs"):
        lacking.append(f"no input is {_with_hints(found.inputs, model, 'inputs')}")
    return lacking


def _with_hints(signals: Iterable[str], model: FmuModel, group: str) -> str:
    known = [v.name for v in _candidates(model, group)]
    near = {signal: most_alike(signal, known) for signal in signals}
    stated = ", ".join(s if n is None else f"{s} (near: '{n}')" for s, n in near.items())
    return f"{stated}; its {group} are {', '.join(known[:8]) or 'none'}{', ...' if known[8:] else ''}"


def _candidates(model: FmuModel, group: str) -> list[FmuVariable]:
    """The variables of an FMU that can be in a group of a map."""
    if group == "start":
        return [v for v in model.reals() if model.can_be_set(v)]
    return model.reals("output" if group == "outputs" else "input")


def _meant(v: FmuVariable, group: str, known: Mapping[str, str]) -> Meant:
    """The signal that a variable is by its name, whole or its last part."""
    if group != "start":
        return meant(v, v.name, known)
    cores = [core for part in (v.name, v.name.rpartition(".")[2]) for core in _cores(part)]
    return next((m for core in cores if (m := meant(v, core, known)).signal), NONE)


def _same(name: str, signal: str) -> bool:
    """Whether a variable bears a signal's own name, which goes before other names of it."""
    own, known = (x.casefold().replace(".", "_") for x in (name, signal))
    return bool(signal) and own.startswith(known)


def _cores(name: str) -> list[str]:
    """A start value's name without what marks it as one."""
    cores = [m["core"] for mark in (BEFORE, BEHIND) if (m := mark.fullmatch(name.casefold()))]
    return [core for core in cores if len(core) > 1 or core in MOTION]


def _fits(unit: Unit | None, quantity: str) -> bool:
    """Whether a variable's unit is one of the quantity, as far as it is known."""
    return unit is None or unit.name in UNITS[quantity] or _is_of(unit, quantity)


def _is_of(unit: Unit, quantity: str) -> bool:
    exponents = base_exponents(SI_UNIT[quantity])
    return unit.exponents == tuple(exponents.get(base, 0) for base in BASE_UNITS)


def _with_unit(column: Column, v: FmuVariable, quantity: str, where: str) -> Column:
    """A column with the unit of its variable, where the map does not tell another one."""
    unit = v.unit
    if column.unit is not None or unit is None:
        return column
    if unit.name in UNITS[quantity]:
        return column.model_copy(update={"unit": unit.name})
    if not _is_of(unit, quantity):
        raise InputError(
            f"{where}: the FMU gives '{v.name}' in '{unit.name}', which is not a unit of {quantity}; "
            'add "unit" to its entry, or name another variable'
        )
    scaled = {"factor": column.factor * unit.factor, "offset": column.offset * unit.factor + unit.offset}
    return column.model_copy(update=scaled)
