"""Which column of a measurement is which variable of an FMU that is not a ship: ``map.json``::

    {
        "inputs": {"force": "f"},
        "outputs": {"position": {"name": "s", "factor": 0.001, "noise": 0.5}},
        "start": {"position": "springDamper.s_rel", "der(position)": "springDamper.v_rel"},
        "disturbance_inputs": ["f"],
        "window": 20.0,
        "run_in": 0.0
    }

The key is the column, the name that of the variable, as in the map of a ship. Without a map, columns
that are called as inputs and outputs are those.
"""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Annotated

from pydantic import (
    AllowInfNan,
    BaseModel,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
)

from cosim import InputError
from cosim.errors import nearest
from cosim.fmu import FmuModel
from cosim.scenario import read_model
from cybership.message_text import quoted

from ..runs import Named

# Units of an input that acts in addition to all else.
FORCES = ("N", "N.m", "Nm", "m/s2", "rad/s2")
TIME = "time"
Positive = Annotated[PositiveFloat, AllowInfNan(False)]


class MeasuredOutput(Named):
    """An output that is compared with a column."""

    noise: Positive | None = Field(
        default=None, description="standard deviation of the column's noise (estimated)"
    )


class DrivenInput(Named):
    """An input that a column drives."""

    linear: bool = Field(
        default=False,
        description="linear interpolation between samples (each sample is held until the next)",
    )


class SystemMap(BaseModel):
    """The content of a map of any FMU."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    inputs: dict[str, DrivenInput] = Field(default_factory=dict)
    outputs: dict[str, MeasuredOutput] = Field(min_length=1)
    start: dict[str, Named] = Field(
        default_factory=dict, description="start values, by measured outputs or their derivatives"
    )
    disturbance_inputs: list[str] | None = Field(
        default=None, description="inputs where an additional force may act (those in N, N.m, m/s2)"
    )
    window: Positive | None = Field(default=None, description="length of the windows [s] (whole runs)")
    run_in: Annotated[NonNegativeFloat, AllowInfNan(False)] = Field(
        default=0.0, description="time before a prediction is compared [s]"
    )

    @property
    def variables(self) -> set[str]:
        """All variables that are in use."""
        groups: tuple[Mapping[str, Named], ...] = (self.inputs, self.outputs, self.start)
        return {c.name for group in groups for c in group.values()}


def read_system_map(path: Path) -> SystemMap:
    """A map from its file.

    Raises:
        InputError: it is none.
    """
    return read_model(path, SystemMap, "a map", strict=False, renamed="map")


def map_by_names(model: FmuModel, columns: Collection[str], where: str) -> SystemMap:
    """The map in which columns are the variables of their names.

    Raises:
        InputError: no column is an output.
    """
    known = ({v.name for v in model.reals(group)} for group in ("input", "output"))
    inputs, outputs = ([c for c in columns if c in names] for names in known)
    if not outputs:
        names = ", ".join(v.name for v in model.variables.values() if v.causality == "output") or "none"
        raise InputError(
            f"{where}: no column has the name of an output of '{model.path.name}' ({names}); --map "
            "FILE.json maps columns to variables"
        )
    each = {"inputs": inputs, "outputs": outputs}
    return SystemMap.model_validate({group: {c: c for c in names} for group, names in each.items()})


def check_map(found: SystemMap, model: FmuModel, where: str) -> None:
    """Check a map against an FMU.

    Raises:
        InputError: it names a variable that the FMU does not have, or not in this role.
    """
    settable = [v for v in model.reals() if model.can_be_set(v)]
    roles = {
        "inputs": (model.reals("input"), "input"),
        "outputs": (model.reals("output", "local"), "output"),
        "start": (settable, "value that can be set before a simulation"),
    }
    for group, (variables, role) in roles.items():
        possible = [v.name for v in variables]
        channels: Mapping[str, Named] = getattr(found, group)
        for column, channel in channels.items():
            place = f"{where}: {group}.{column}"
            if channel.name not in possible:
                hint = nearest(channel.name, possible)
                raise InputError(f"{place}: the FMU has no {role} {quoted(channel.name)}{hint}")
            if channel.factor == 0.0:
                raise InputError(f"{place}.factor must not be zero")
    inputs = [v.name for v in model.reals("input")]
    for name in found.disturbance_inputs or ():
        if name not in inputs:
            hint = nearest(name, inputs)
            raise InputError(f"{where}: disturbance_inputs: the FMU has no input {quoted(name)}{hint}")
    for column in found.start:
        if column_of_start(column)[0] not in found.outputs:
            raise InputError(
                f"{where}: start.{column} must be a column of 'outputs', or der(COLUMN) of one"
            )


def column_of_start(key: str) -> tuple[str, bool]:
    """The column that a start value is of, and whether it is its derivative by time."""
    rate = key.startswith("der(") and key.endswith(")")
    return (key[4:-1] if rate else key), rate


def force_inputs(found: SystemMap, model: FmuModel) -> list[str]:
    """Inputs on which a force may act in addition."""
    if found.disturbance_inputs is not None:
        return list(found.disturbance_inputs)
    return [v.name for v in model.reals("input") if v.unit is not None and v.unit.name in FORCES]
