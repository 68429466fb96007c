"""What counts as agreement, written down before anybody looks: the file of ``--criteria``."""

import json
from datetime import datetime, timezone
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    PositiveFloat,
    ValidationError,
    model_validator,
)

from cosim import InputError
from cosim.errors import nearest
from cybership.message_text import Location, first_fault, quoted

from ..runs import UNITS

# Quantity of each signal that can be judged.
JUDGED = {"position": "length", "heading": "angle", "u": "speed", "v": "speed", "r": "rate"}

Quantity = Literal["position", "heading", "u", "v", "r"]
Positive = Annotated[PositiveFloat, Field(allow_inf_nan=False)]


class Criterion(BaseModel):
    """One requirement on the error of predictions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(min_length=1)] | None = Field(
        None, description="in the record; else made of the rest"
    )
    quantity: Quantity = Field(description="distance, heading, or velocity of the body over ground")
    horizon: Positive = Field(description="time of prediction after which the error is judged [s]")
    tolerance: Positive = Field(description="largest error, in the unit")
    unit: str = Field(description="of the tolerance, such as m, deg, m/s, kn, deg/s")
    statistic: Literal["share", "median", "rms"] = Field(
        "share",
        description="of the windows' errors: share within the tolerance, median or RMS within it",
    )
    coverage: float = Field(0.9, gt=0.0, lt=1.0, description="smallest share that is within")
    confidence: float = Field(
        0.95, gt=0.5, lt=1.0, description="of the one-sided bound that decides, and of its interval"
    )
    runs: Annotated[list[str], Field(min_length=1)] | None = Field(
        None, description="names of the runs that count; all"
    )
    within: dict[str, tuple[FiniteFloat, FiniteFloat]] = Field(
        {}, description="lowest and highest mean of u, v, r, speed, drift or a command in windows [SI]"
    )

    @model_validator(mode="after")
    def _check(self) -> "Criterion":
        units = UNITS[JUDGED[self.quantity]]
        if self.unit not in units:
            hint = nearest(self.unit, units)
            raise ValueError(f"{quoted(self.unit)} is no unit of {self.quantity}{hint}")
        if self.statistic != "share" and "coverage" in self.model_fields_set:
            raise ValueError(f"coverage is of the statistic 'share', not of '{self.statistic}'")
        for signal, (low, high) in self.within.items():
            if not low < high:
                raise ValueError(f"within.{signal}: {low:g} is not below {high:g}")
        return self

    @property
    def factor(self) -> float:
        """Of the unit, to SI."""
        return UNITS[JUDGED[self.quantity]][self.unit]

    @property
    def limit(self) -> float:
        """The tolerance [SI]."""
        return self.tolerance * self.factor

    @property
    def wanted(self) -> float:
        """The share of errors that must be within; half of them where the median must be."""
        return 0.5 if self.statistic == "median" else self.coverage

    @property
    def title(self) -> str:
        return self.name or f"{self.quantity} after {self.horizon:g} s"

    @property
    def text(self) -> str:
        """What is required, in words."""
        what = {
            "share": f"at least {100.0 * self.coverage:g} % of the windows' errors",
            "median": "the median of the windows' errors",
            "rms": "the RMS of the windows' errors",
        }[self.statistic]
        return (
            f"{what} of {self.quantity} after {self.horizon:g} s within {self.tolerance:g} {self.unit}, "
            f"at {100.0 * self.confidence:g} % confidence"
        )


class Criteria(BaseModel):
    """The content of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    purpose: str | None = Field(None, description="what the model is to be used for")
    criteria: Annotated[list[Criterion], Field(min_length=1)]


class ReadCriteria(NamedTuple):
    """Criteria as they were read.

    Attributes:
        content: of the file.
        path: of it.
        sha256: of the bytes that were read.
        modified, read: times in UTC, ISO 8601.
    """

    content: Criteria
    path: str
    sha256: str
    modified: str
    read: str


def read_criteria(path: str | Path) -> ReadCriteria:
    """The criteria of a file.

    Raises:
        InputError: it has none; says what is wrong.
    """
    path = Path(path)
    try:
        changed, text = path.stat().st_mtime, path.read_bytes()
        content = Criteria.model_validate(json.loads(text))
    except ValidationError as error:
        raise InputError(f"'{path}': {first_fault(error, _nearest_key, special=_special)}") from None
    except FileNotFoundError:
        raise InputError(f"no such criteria: '{path}'; cybership criteria prints some") from None
    except RecursionError:
        raise InputError(f"'{path}' cannot be read: it is nested too deeply") from None
    except (OSError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as criteria: {error}") from None
    modified = datetime.fromtimestamp(changed, timezone.utc)
    return ReadCriteria(content, str(path), sha256(text).hexdigest(), _stamp(modified), now())


def now() -> str:
    """The time, UTC, ISO 8601."""
    return _stamp(datetime.now(timezone.utc))


def _stamp(time: datetime) -> str:
    return time.isoformat(timespec="seconds")


def _nearest_key(location: Location) -> str:
    return nearest(str(location[-1]), (Criteria if len(location) == 1 else Criterion).model_fields)


def _special(kind: str, location: Location, value: object) -> str:
    if kind == "literal_error" and location[-1] == "quantity":
        return f"'{value}' cannot be judged{nearest(str(value), JUDGED)}"
    return ""


def template() -> dict[str, Any]:
    """A first file, whose numbers are to be replaced."""
    first = {"quantity": "position", "horizon": 8.0, "tolerance": 0.1, "unit": "m", "coverage": 0.9}
    second = {"quantity": "heading", "horizon": 8.0, "tolerance": 5.0, "unit": "deg", "coverage": 0.9}
    return {"purpose": "what the model is to be used for", "criteria": [first, second]}


def json_schema() -> dict[str, Any]:
    """JSON Schema of the file."""
    return Criteria.model_json_schema()
