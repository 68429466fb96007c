"""The file of parameters to calibrate: ``parameters.json``, its checks, and a first proposal of it::

{
    "parameters": [
        {"name": "mass.m", "unit": "kg", "value": 2.0, "min": 0.0, "log": true,
         "prior": {"rel_std": 0.1, "origin": "mass: chosen"}}
    ]
}
"""

import json
import re
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
from pydantic import (
    AllowInfNan,
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PositiveFloat,
    model_validator,
)

import cosim
from cosim import InputError, Unit
from cosim.errors import nearest
from cosim.fmu import FmuModel, FmuVariable
from cosim.scenario import read_model
from cybership.message_text import quoted

Positive = Annotated[PositiveFloat, AllowInfNan(False)]


class Kind(NamedTuple):
    """What is known of all parameters with some dimension before any data.

    Attributes:
        name: of the kind.
        unit: name of its unit, where a file leaves out the definition; empty: no other one.
        base: the dimension in base units, each with its exponent, as ``kg m2 s-2``.
        rel_std: relative standard deviation of the prior. Chosen: a weighed or measured quantity to a
            tenth, one that data sheets state to three tenths, one that is mostly guessed to a half.
        positive: whether a value below zero has no meaning.
    """

    name: str
    unit: str
    base: str
    rel_std: float
    positive: bool

    @property
    def exponents(self) -> tuple[int, ...]:
        """Of kg, m, s, A, K, mol, cd."""
        powers = dict(re.findall(r"([A-Za-z]+)(-?\d*)", self.base))
        return tuple(int(powers[b] or 1) if b in powers else 0 for b in cosim.BASE_UNITS)


# 1, standard deviations by the kind, see :class:`Kind`.
KINDS = (
    Kind("mass", "kg", "kg", 0.1, True),
    Kind("moment of inertia", "kg.m2", "kg m2", 0.3, True),
    Kind("length", "m", "m", 0.1, False),
    Kind("area", "m2", "m2", 0.1, True),
    Kind("volume", "m3", "m3", 0.1, True),
    Kind("density", "", "kg m-3", 0.1, True),
    Kind("time constant", "s", "s", 0.3, True),
    Kind("frequency", "Hz", "s-1", 0.3, True),
    Kind("stiffness", "N/m", "kg s-2", 0.3, True),
    Kind("damping", "N.s/m", "kg s-1", 0.5, True),
    Kind("temperature", "K", "K", 0.02, False),
    Kind("heat capacity", "J/K", "kg m2 s-2 K-1", 0.3, True),
    Kind("thermal conductance", "W/K", "kg m2 s-3 K-1", 0.5, True),
    Kind("electric resistance", "Ohm", "kg m2 s-3 A-2", 0.1, True),
    Kind("inductance", "H", "kg m2 s-2 A-2", 0.3, True),
    Kind("capacitance", "F", "kg-1 m-2 s4 A2", 0.3, True),
)
QUADRATIC = Kind("quadratic damping", "", "", 0.5, False)  # 1, as a damping
OTHER = Kind("other", "", "", 0.3, False)  # 1, as what data sheets state


class Prior(BaseModel):
    """What is known of a value before the runs: a standard deviation, absolute or relative."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    std: Positive | None = Field(default=None, description="standard deviation [unit of the value]")
    rel_std: Positive | None = Field(default=None, description="the same, relative to the value [1]")
    origin: str = Field(default="", description="source of this value")

    @model_validator(mode="after")
    def _one(self) -> "Prior":
        if (self.std is None) == (self.rel_std is None):
            raise ValueError("needs either 'std' or 'rel_std'")
        return self


class CalibratedParameter(BaseModel):
    """One parameter to calibrate."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: str = Field(description="variable of the FMU: a parameter, or an input that is not in the map")
    unit: str = Field(default="1", description="that of the FMU, for information only")
    value: FiniteFloat = Field(description="mean of the prior, start of the fit")
    min: FiniteFloat | None = Field(default=None, description="lower bound")
    max: FiniteFloat | None = Field(default=None, description="upper bound")
    log: bool = Field(default=False, description="fit the logarithm of a positive value")
    prior: Prior

    @model_validator(mode="after")
    def _consistent(self) -> "CalibratedParameter":
        low, high = self.min, self.max
        if (low is not None and self.value < low) or (high is not None and self.value > high):
            raise ValueError(f"'value' must lie from 'min' to 'max'; got {self.value:g}")
        if self.log and self.value <= 0.0:
            raise ValueError(f"'log' needs a positive value; got {self.value:g}")
        if self.prior.rel_std is not None and self.value == 0.0:
            raise ValueError("'rel_std' of a value of zero is zero; give 'std'")
        return self

    @property
    def std(self) -> float:
        """Standard deviation of the prior, in the unit of the value."""
        p = self.prior
        return p.std if p.std is not None else float(p.rel_std or 0.0) * abs(self.value)

    # The fit moves z, in prior standard deviations from the prior mean.

    def at(self, z: float) -> float:
        """The value at z prior standard deviations from the mean."""
        if self.log:
            return float(self.value * np.exp(z * self.std / self.value))
        return self.value + z * self.std

    def z(self, value: float) -> float:
        """The inverse of :meth:`at`."""
        if self.log:
            return float(np.log(value / self.value) * self.value / self.std) if value > 0.0 else -np.inf
        return (value - self.value) / self.std

    @property
    def bounds(self) -> tuple[float, float]:
        """Bounds of z."""
        low, high = self.min, self.max
        return (-np.inf if low is None else self.z(low)), (np.inf if high is None else self.z(high))

    def slope(self, z: float) -> float:
        """Derivative of the value by z."""
        return self.std * (self.at(z) / self.value if self.log else 1.0)


class ParameterFile(BaseModel):
    """The content of ``parameters.json``."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    parameters: list[CalibratedParameter] = Field(min_length=1)

    @model_validator(mode="after")
    def _different(self) -> "ParameterFile":
        names = [p.name for p in self.parameters]
        twice = [n for n in dict.fromkeys(names) if names.count(n) > 1]
        if twice:
            raise ValueError(f"'{twice[0]}' occurs twice")
        return self


def read_parameters(path: Path, model: FmuModel, mapped: Collection[str]) -> list[CalibratedParameter]:
    """The parameters of a file, checked against an FMU.

    Raises:
        InputError: no such file, a fault of it, or a name that the FMU does not have.
    """
    found = read_model(path, ParameterFile, "parameters", strict=False).parameters
    possible = {v.name for v in model.variables.values() if can_be_calibrated(v)} - set(mapped)
    for p in found:
        if p.name in mapped:
            raise InputError(
                f"'{path}': {quoted(p.name)} is a variable of the map; remove it from the map or "
                "from this file"
            )
        if p.name not in possible:
            hint = nearest(p.name, possible)
            raise InputError(f"'{path}': {model.path.name} has no parameter {quoted(p.name)}{hint}")
    return found


def write_parameters(path: Path, parameters: Collection[CalibratedParameter]) -> None:
    """Write ``parameters.json``; an older file is replaced when the new one is complete."""
    content = ParameterFile(parameters=list(parameters)).model_dump(exclude_none=True)
    with cosim.atomic_write(path) as scratch:
        scratch.write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def can_be_calibrated(v: FmuVariable) -> bool:
    """Whether a variable is a real number that keeps the value that it is set to at the start.

    An input that nothing drives is one, too: some tools export parameters so.
    """
    if v.type != "Real" or v.start is None:
        return False
    return v.causality == "input" or (
        v.causality == "parameter" and v.variability in ("fixed", "tunable")
    )


def proposed(model: FmuModel, mapped: Collection[str]) -> tuple[list[CalibratedParameter], list[str]]:
    """The parameters of an FMU with a prior by their kind.

    Returns:
        The parameters, and a sentence of those that have no scale and are left out, if there are any.
    """
    every = [
        v
        for v in model.variables.values()
        if v.causality == "parameter" and can_be_calibrated(v) and v.name not in mapped
    ]
    priors = {v.name: _with_prior(v) for v in every}
    found = [prior for prior in priors.values() if prior is not None]
    names = [name for name, prior in priors.items() if prior is None]
    reason = "a value of 0 without a range has no scale; give 'std' to calibrate one"
    return found, [f"left out: {', '.join(names)}; {reason}"] if names else []


def chosen_parameters(
    path: Path | None, model: FmuModel, mapped: Collection[str]
) -> tuple[list[CalibratedParameter], list[str]]:
    """The parameters of a file; without one those that are :func:`proposed`, and a sentence."""
    return proposed(model, mapped) if path is None else (read_parameters(path, model, mapped), [])


def _with_prior(v: FmuVariable) -> CalibratedParameter | None:
    """A parameter with the prior of its kind; None: its value is no scale and it has no range."""
    value, unit = float(v.start or 0.0), unit_of(v)
    kind = kind_of(v.unit)
    positive = value > 0.0 and (kind.positive or (v.min is not None and v.min >= 0.0))
    if value:
        prior = Prior(rel_std=kind.rel_std, origin=f"{kind.name}: chosen")
    elif v.min is not None and v.max is not None and v.max > v.min:
        # Chosen: the range holds two standard deviations on either side of its middle.
        prior = Prior(std=0.25 * (v.max - v.min), origin="a quarter of its range")
    else:
        return None
    return CalibratedParameter(
        name=v.name, unit=unit, value=value, min=v.min, max=v.max, log=positive, prior=prior
    )


def unit_of(v: FmuVariable) -> str:
    """Name of a variable's unit; 1 where the FMU states none."""
    return "1" if v.unit is None else v.unit.name


def kind_of(unit: Unit | None) -> Kind:
    """The kind of a quantity by its unit; :data:`OTHER` where that says nothing."""
    if unit is None:
        return OTHER
    if re.match(r"N\.(m\.)?s2", unit.name):  # N.s2/m has the dimension of a mass
        return QUADRATIC
    known = (
        k for k in KINDS if unit.exponents == k.exponents or (not unit.exponents and unit.name == k.unit)
    )
    return next(known, OTHER)
