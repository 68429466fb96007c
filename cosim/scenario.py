"""The scenario file: what it may hold, and messages for what it may not."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Union

from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    PositiveFloat,
    PositiveInt,
    PrivateAttr,
    TypeAdapter,
    ValidationError,
    model_validator,
)

from . import faults
from .errors import InputError, nearest
from .exchange.reading import is_system, read_system

if TYPE_CHECKING:
    AnyFault = faults.Fault
else:
    AnyFault = Annotated[
        Union[tuple(faults.KINDS.values())],  # noqa: UP007 - made from the registry
        Field(discriminator="kind"),
    ]
# What a double can count without gaps.
Whole = Annotated[int, Field(ge=-(2**53), le=2**53)]
Value = bool | Whole | float | str
# Below a microsecond, differences of time drown in rounding.
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


def _table_path(path: str) -> str:
    if not path.isprintable() or not path.endswith(".csv") or len(path) > 1000:
        raise ValueError(f"{path[:100]!r} is not the name of a .csv file")
    return path


class Strict(BaseModel):
    """Refuses keys that it does not know."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class FmuEntry(Strict):
    """One instance: which FMU, how often it steps, with what parameters."""

    path: Annotated[str, AfterValidator(_fmu_path)] = Field(
        description="the project's FMU by bare name, or a path relative to the scenario"
    )
    step: Step | None = Field(None, description="own step [s], a multiple of the base step")
    parameters: dict[str, Value] = Field(default_factory=dict, description="start values by name")
    table: Annotated[str, AfterValidator(_table_path)] | None = Field(
        None,
        description="CSV file, relative to the scenario; column c holds the parameters c_1, c_2, ...",
    )
    isolate: bool = Field(False, description="run it in a process of its own")
    timeout: PositiveFloat | None = Field(
        None, description="with isolate: longest time [s] that one call may take (60)"
    )

    @model_validator(mode="after")
    def _timeout_needs_a_process(self) -> "FmuEntry":
        if self.timeout is not None and not self.isolate:
            raise ValueError('timeout needs "isolate": true')
        return self


class Event(Strict):
    """A change during the run, with the keys of an OSP scenario file."""

    time: Annotated[float, Field(ge=0.0)] = Field(description="when [s]")
    model: str = Field(description="instance")
    variable: str
    action: Literal["override", "bias", "reset", "hold"] = Field(
        description="give it a value, add to it, end all that, or keep the value it has"
    )
    value: bool | Whole | float | None = Field(None, description="for override and bias")


class LogOptions(Strict):
    """What is logged, and how often."""

    signals: Literal["all"] | list[str] = Field(
        "all", description="all inputs and outputs, or names as instance.variable, * as wildcard"
    )
    every: PositiveInt = Field(1, description="log every n-th base step")
    format: Literal["csv", "parquet"] = "csv"


class Transformation(Strict):
    """What becomes of a value on its way: factor * value + offset."""

    factor: float = 1.0
    offset: float = 0.0


class MetricsOptions(Strict):
    """The part of the run that the metrics cover."""

    start: float | None = Field(None, alias="from", ge=0.0, description="first time [s]")
    stop: float | None = Field(None, alias="to", gt=0.0, description="last time [s]")

    model_config = ConfigDict(extra="forbid", populate_by_name=True)


class Scenario(Strict):
    """A co-simulation: instances, connections, faults, events, log."""

    name: Annotated[str, AfterValidator(_folder_name)] = Field(
        min_length=1, description="also the name of the result folder"
    )
    description: str = ""
    step: Step = Field(description="base step [s]")
    stop: PositiveFloat = Field(
        le=1e9, description="end of the simulation [s], a multiple of the base step"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="of all random faults")
    algorithm: Literal["gauss_seidel", "jacobi"] = Field(
        "gauss_seidel",
        description="one after the other with the newest values, or all at once with those of before",
    )
    fmus: dict[Annotated[str, AfterValidator(_instance_name)], FmuEntry] = Field(
        min_length=1, description="instances by name"
    )
    connections: list[tuple[str, str]] = Field(
        default_factory=list,
        description="[output, input] as instance.variable; a * on both sides connects all variables "
        "whose names agree there",
    )
    transformations: dict[str, Transformation] = Field(
        default_factory=dict,
        description="connected input -> what becomes of values on their way there, in place of a "
        "conversion of units",
    )
    faults: list[AnyFault] = Field(default_factory=list)
    events: list[Event] = Field(default_factory=list)
    log: LogOptions = Field(default_factory=lambda: LogOptions.model_validate({}))
    metrics: MetricsOptions = Field(default_factory=lambda: MetricsOptions.model_validate({}))

    _folder: Path = PrivateAttr(default_factory=Path.cwd)
    _notes: list[str] = PrivateAttr(default_factory=list)
    _unpacked: Any = PrivateAttr(None)

    @property
    def folder(self) -> Path:
        """What paths in the scenario are relative to."""
        return self._folder

    @property
    def notes(self) -> list[str]:
        """What was assumed or left out when it was read from the format of another tool."""
        return self._notes


def load_scenario(
    source: str | Path | dict[str, Any], changes: Mapping[str, Any] | None = None
) -> Scenario:
    """A scenario from a JSON file or from the same content as a dict, or a system of other tools.

    Args:
        source: path of the file; a dict is read as if it lay in the working directory. An SSP archive,
            an OSP directory or its OspSystemStructure.xml is a scenario as well.
        changes: keys that beat those of the file; None does not count.

    Raises:
        InputError: missing file, no JSON, unknown key, wrong type or value; names the place.
    """
    chosen = {key: value for key, value in (changes or {}).items() if value is not None}
    if isinstance(source, dict):
        return _validate(source | chosen, "scenario", Path.cwd())
    path = Path(source)
    if is_system(path):
        system = read_system(path)
        for key in ("step", "stop"):
            if key not in system.content | chosen:
                raise InputError(f"'{path}' does not say its {key}; give it by --{key} SECONDS")
        scenario = _validate(system.content | chosen, f"'{path}'", system.folder)
        scenario._notes, scenario._unpacked = system.notes, system.unpacked
        return scenario
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"), object_pairs_hook=_once)
        json.dumps(content, ensure_ascii=False).encode()
    except FileNotFoundError:
        near = [p.name for p in path.parent.glob("*.json")] if path.parent.is_dir() else []
        raise InputError(f"no such scenario: '{path}'{nearest(path.name, near)}") from None
    except InputError as error:
        raise InputError(f"'{path}': {error}") from None
    except json.JSONDecodeError as error:
        raise InputError(f"'{path}' is not JSON: {error}") from None
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"'{path}' cannot be read: {error}") from None
    if isinstance(content, dict):
        content |= chosen
    return _validate(content, f"'{path}'", path.parent)


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object; a key that stands there twice would silently win over the first."""
    names = [name for name, _ in pairs]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"the key '{name}' stands twice in one object")
    return dict(pairs)


def _validate(content: Any, name: str, folder: Path) -> Scenario:
    try:
        scenario = Scenario.model_validate(content)
    except ValidationError as error:
        raise InputError(_message(error, name)) from None
    scenario._folder = folder.resolve()
    return scenario


def _message(error: ValidationError, name: str) -> str:
    """The first thing that is wrong, in one line, with how many more there are."""
    problems = error.errors()
    first = problems[0]
    place = ""
    for part in first["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif part not in faults.KINDS and not str(part).startswith(_INTERNAL):
            place += f".{part}" if place else str(part)
    text = first["msg"].removeprefix("Value error, ")
    if first["type"] == "extra_forbidden":
        text = f"unknown key{nearest(str(first['loc'][-1]), _keys(first['loc']))}"
    elif first["type"] == "union_tag_invalid":
        wrong = first.get("ctx", {}).get("tag", "")
        text = f"unknown kind '{wrong}'{nearest(str(wrong), faults.KINDS)}"
    elif first["type"] == "union_tag_not_found":
        text = "needs a 'kind'" + nearest("", faults.KINDS)
    elif first["type"] == "missing":
        text = "is missing"
    more = f" (and {len(problems) - 1} more)" if len(problems) > 1 else ""
    return f"{name}: {place or 'the content'}: {text}{more}"


# Parts of a place that come from how a type is checked, not from the file.
_INTERNAL = ("function-", "constrained-", "bool", "int", "float", "str", "tuple", "list[")


def _keys(location: tuple[int | str, ...]) -> list[str]:
    """The keys allowed where an unknown one stood."""
    first = location[0] if len(location) > 1 else ""
    classes: dict[Any, type[BaseModel]] = {
        "fmus": FmuEntry,
        "events": Event,
        "log": LogOptions,
        "metrics": MetricsOptions,
        "transformations": Transformation,
        "faults": faults.KINDS.get(str(location[-2]) if len(location) > 1 else "", faults.Fault),
    }
    fields = classes.get(first, Scenario).model_fields
    return [field.alias or name for name, field in fields.items()]


def json_schema() -> dict[str, Any]:
    """The JSON Schema of a scenario file, as published in docs/scenario.schema.json."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **TypeAdapter(Scenario).json_schema(by_alias=True),
    }


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=2))
