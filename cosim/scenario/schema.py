"""The content of a scenario file."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import (
    AfterValidator,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    PrivateAttr,
    TypeAdapter,
    model_validator,
)

from ..formats.imported import Unpacked
from . import faults
from .json_files import StrictModel
from .roles import Roles

if TYPE_CHECKING:
    AnyFault = faults.Fault
else:
    AnyFault = Annotated[
        Union[tuple(faults.KINDS.values())],  # noqa: UP007 - made from the registry
        Field(discriminator="kind"),
    ]
# Integers that a double represents exactly.
ExactInt = Annotated[int, Field(ge=-(2**53), le=2**53)]
StartValue = bool | ExactInt | float | str
# Step [s]; below a microsecond, rounding exceeds the tolerance of time comparisons in long runs.
Step = Annotated[float, Field(ge=1e-6)]


def _folder_name(name: str) -> str:
    if name in (".", "..") or any(c in name for c in "/\\\x00"):
        raise ValueError("cannot be the name of a folder")
    return name


def _instance_name(name: str) -> str:
    if not name.strip() or not name.isprintable() or any(c in name for c in '.*,"'):
        raise ValueError(f"{name!r} cannot be an instance: no dot, *, comma or quote in its name")
    return name


def _fmu_path(path: str) -> str:
    if not path.isprintable() or not path.endswith(".fmu") or len(path) > 1000:
        raise ValueError(f"{path[:100]!r} is not the name of an .fmu file")
    return path


def _ship_name(name: str) -> str:
    if not name.strip() or not name.isprintable() or len(name) > 1000:
        raise ValueError(f"{name[:100]!r} is neither the name of a ship nor that of a .toml file")
    return name


def _table_path(path: str) -> str:
    if not path.isprintable() or not path.endswith(".csv") or len(path) > 1000:
        raise ValueError(f"{path[:100]!r} is not the name of a .csv file")
    return path


class FmuEntry(StrictModel):
    """One instance: which FMU, how often it steps, with what parameters."""

    path: Annotated[str, AfterValidator(_fmu_path)] = Field(
        description="the project's FMU by bare name, or a path relative to the scenario"
    )
    step: Step | None = Field(None, description="own step [s], a multiple of the base step")
    parameters: dict[str, StartValue] = Field(default_factory=dict, description="start values by name")
    table: Annotated[str, AfterValidator(_table_path)] | None = Field(
        None,
        description="CSV file, relative to the scenario; column c holds the parameters c_1, c_2, ...",
    )
    isolate: bool = Field(False, description="run it in a process of its own")
    timeout: PositiveFloat | None = Field(
        None,
        description="with isolate: longest time [s] of a call (100 usual steps, 30 at the least)",
    )

    @model_validator(mode="after")
    def _timeout_needs_a_process(self) -> "FmuEntry":
        if self.timeout is not None and not self.isolate:
            raise ValueError('timeout needs "isolate": true')
        return self


class Event(StrictModel):
    """A change during the run, with the keys of an OSP scenario file."""

    time: Annotated[float, Field(ge=0.0)] = Field(description="when [s]")
    model: str = Field(description="instance")
    variable: str
    action: Literal["override", "bias", "reset", "hold"] = Field(
        description="override the value, add to it (bias), end all changes, or freeze the present value"
    )
    value: bool | ExactInt | float | None = Field(None, description="for override and bias")


class LogOptions(StrictModel):
    """What is logged, and how often."""

    signals: Literal["all", "compact"] | list[str] = Field(
        "all",
        description="all inputs and outputs; those that metrics, pictures and the diagnosis need; or "
        "names as instance.variable, * as wildcard",
    )
    every: PositiveInt = Field(1, description="log every n-th base step")
    format: Literal["csv", "parquet"] = "csv"


class Transformation(StrictModel):
    """The transformation of a value on its way to an input: factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0


class Recording(StrictModel):
    """Inputs that get their values from a file over time."""

    path: Annotated[str, AfterValidator(_table_path)] = Field(
        description="CSV file with a column 'time' [s], relative to the scenario; rows hold over time"
    )
    inputs: dict[str, str] = Field(
        min_length=1,
        description="input as instance.variable -> column; an empty cell leaves the value of its "
        "connection, or its start value",
    )


class MetricsOptions(StrictModel):
    """The part of the run that the metrics cover."""

    start: float | None = Field(None, alias="from", ge=0.0, description="first time [s]")
    stop: float | None = Field(None, alias="to", gt=0.0, description="last time [s]")

    model_config = ConfigDict(populate_by_name=True)


class Scenario(StrictModel):
    """A co-simulation: instances, connections, faults, events, log."""

    name: Annotated[str, AfterValidator(_folder_name)] = Field(
        min_length=1, description="also the name of the result folder"
    )
    description: str = ""
    step: Step = Field(description="base step [s]")
    stop: PositiveFloat = Field(
        le=1e9, description="end of the simulation [s], a multiple of the base step"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of all random faults")
    algorithm: Literal["gauss_seidel", "jacobi"] = Field(
        "gauss_seidel",
        description="one after the other with the newest values, or all with the previous values",
    )
    fmus: dict[Annotated[str, AfterValidator(_instance_name)], FmuEntry] = Field(
        min_length=1, description="instances by name"
    )
    ship: Annotated[str, AfterValidator(_ship_name)] | None = Field(
        None,
        description="ship of the FMUs with a bare name: a shipped ship, or its .toml file, relative to "
        "the scenario (the default ship)",
    )
    native: bool | Literal["auto"] = Field(
        "auto",
        description="auto: compile the project's own FMUs, those with a bare name, and the step loop, "
        "if the system has a C compiler; true: also with zig; false: neither; results are the same",
    )
    connections: list[tuple[str, str]] = Field(
        default_factory=list,
        description="[output, input] as instance.variable; a * on both sides connects all variables "
        "whose names agree there",
    )
    optional_connections: list[tuple[str, str]] = Field(
        default_factory=list,
        description="the same, left out where an FMU has no such variable or the input is connected",
    )
    transformations: dict[str, Transformation] = Field(
        default_factory=dict,
        description="connected input -> transformation of its values, in place of a conversion of units",
    )
    recordings: list[Recording] = Field(
        default_factory=list, description="inputs from files, before faults act on them"
    )
    faults: list[AnyFault] = Field(default_factory=list)
    events: list[Event] = Field(default_factory=list)
    log: LogOptions = Field(default_factory=lambda: LogOptions.model_validate({}))
    metrics: MetricsOptions = Field(default_factory=lambda: MetricsOptions.model_validate({}))
    roles: Roles = Field(
        default_factory=Roles, description="columns that metrics and pictures read, by role"
    )

    _folder: Path = PrivateAttr(default_factory=Path.cwd)
    _notes: list[str] = PrivateAttr(default_factory=list)
    _unpacked: Unpacked | None = PrivateAttr(None)

    @property
    def folder(self) -> Path:
        """The folder to which paths in the scenario are relative."""
        return self._folder

    @property
    def ship_source(self) -> str | None:
        """The ship by its name, or by the whole path of its file; None: the usual one."""
        if self.ship is None or not self.ship.endswith(".toml"):
            return self.ship
        return str(self._folder / self.ship)

    @property
    def notes(self) -> list[str]:
        """Assumptions and omissions in reading it from the format of another tool."""
        return self._notes

    @property
    def unpacked(self) -> Unpacked | None:
        """The scratch folder that an archive was unpacked to, if there is one."""
        return self._unpacked

    def set_origin(
        self, folder: Path, notes: Sequence[str] = (), unpacked: Unpacked | None = None
    ) -> None:
        """State where the scenario comes from.

        Args:
            folder: to which its paths are relative.
            notes: assumptions and omissions, for the user.
            unpacked: scratch folder to keep for as long as the scenario.
        """
        self._folder, self._notes, self._unpacked = folder.resolve(), list(notes), unpacked


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scenario file, as published in docs/scenario.schema.json."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **TypeAdapter(Scenario).json_schema(by_alias=True),
    }
