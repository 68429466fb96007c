"""What counts as agreement, written down before anybody looks: the file of ``--criteria``."""

from datetime import datetime
from hashlib import sha256
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeFloat,
    PositiveFloat,
    model_validator,
)

from cosim import InputError
from cosim.errors import nearest
from cosim.scenario import read_model
from cybership.message_text import Location, quoted

from ..runs import UNITS

# Quantity of each signal that can be judged.
JUDGED = {"position": "length", "heading": "angle", "u": "speed", "v": "speed", "r": "rate"}

# Unit of what ``operating_range`` may name, of commands that of the ship.
MOTION = {"u": "m/s", "v": "m/s", "r": "rad/s", "speed": "m/s", "drift": "rad"}

Quantity = Literal["position", "heading", "u", "v", "r"]
Positive = Annotated[PositiveFloat, Field(allow_inf_nan=False)]


class Criterion(BaseModel):
    """One requirement on the error of predictions."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    name: Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f]+$")] | None = (
        Field(None, description="title in the record (made of the other keys)")
    )
    quantity: Quantity = Field(description="distance, heading, or velocity of the body over ground")
    horizon: Positive = Field(description="time of prediction at which the error is judged [s]")
    tolerance: Positive = Field(description="largest error, in 'unit'")
    unit: str = Field(description="of the tolerance, such as m, deg, m/s, kn, deg/s")
    statistic: Literal["fraction", "median", "rms"] = Field(
        "fraction",
        description="statistic of the errors: fraction within the tolerance, or median or RMS within it",
    )
    coverage: float = Field(0.9, gt=0.0, lt=1.0, description="smallest fraction within the tolerance")
    confidence: float = Field(
        0.95,
        gt=0.5,
        lt=1.0,
        description="confidence of the one-sided bound that decides, and of its interval",
    )
    runs: Annotated[list[str], Field(min_length=1)] | None = Field(
        None, description="names of the runs that count (default: all)"
    )
    operating_range: dict[str, tuple[FiniteFloat, FiniteFloat]] = Field(
        {}, description="lowest and highest mean of u, v, r, speed, drift or a command in a window [SI]"
    )

    training_runs: bool = Field(
        False, description="count training runs of the model too, which are not counted otherwise"
    )

    @model_validator(mode="after")
    def _check(self) -> "Criterion":
        units = UNITS[JUDGED[self.quantity]]
        if self.unit not in units:
            hint = nearest(self.unit, units)
            raise ValueError(f"{quoted(self.unit)} is not a unit of {self.quantity}{hint}")
        if self.statistic != "fraction" and "coverage" in self.model_fields_set:
            raise ValueError(f"coverage belongs to the statistic 'fraction', not to '{self.statistic}'")
        for signal, (low, high) in self.operating_range.items():
            if not low < high:
                raise ValueError(f"operating_range.{signal}: {low:g} is not below {high:g}")
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
            "fraction": f"at least {100.0 * self.coverage:g} % of the windows' errors",
            "median": "the median of the windows' errors",
            "rms": "the RMS of the windows' errors",
        }[self.statistic]
        return (
            f"{what} of {self.quantity} after {self.horizon:g} s within {self.tolerance:g} {self.unit}, "
            f"at {100.0 * self.confidence:g} % confidence{''.join(f'; {r}' for r in self.restrictions)}"
        )

    @property
    def restrictions(self) -> list[str]:
        """What narrows or widens the data that count, a part of a sentence each."""
        limits = [
            f"{s} from {low:g} to {high:g} {MOTION.get(s, '(SI)')}"
            for s, (low, high) in self.operating_range.items()
        ]
        stated = [] if self.runs is None else [f"only runs {', '.join(self.runs)}"]
        stated += [f"only windows with a mean of {' and '.join(limits)}"] if limits else []
        return stated + ["training runs of the model count"] * self.training_runs


Text = Annotated[str, Field(min_length=1, max_length=1000)]  # chosen: a paragraph


class Particulars(BaseModel):
    """What ITTC 7.5-02-06-03 and DNV-RP-0513 ask for, and no data tell; printed as "not given" else."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    document: Text | None = Field(None, description="number of the document")
    client: Text | None = Field(None, description="reader of the record")
    assessor: Text | None = Field(None, description="author of the judgement")
    model: Text | None = Field(None, description="name of the model")
    model_version: Text | None = Field(None, description="its version")
    lineage: Text | None = Field(
        None, description="author of the model, and the data that it was made from"
    )
    ship: Text | None = Field(None, description="name, type and main dimensions of the ship")
    loading: Text | None = Field(None, description="mass, centre of gravity, radius of gyration")
    draught: Text | None = Field(None, description="forward and aft")
    depth: Text | None = Field(None, description="of the water")
    sea: Text | None = Field(None, description="wind, waves and current during the runs")
    calibration: Text | None = Field(
        None, description="calibration of the sensors: date, author, reference"
    )

    @property
    def lines(self) -> dict[str, str]:
        """Each in words, in order."""
        return {name.replace("_", " "): text or "not given" for name, text in dict(self).items()}


class InputStd(BaseModel):
    """Standard uncertainty of what acts on the ship and no data tell."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    current: Annotated[NonNegativeFloat, Field(allow_inf_nan=False)] | None = Field(
        None, description="standard deviations of its north and its east velocity [m/s]"
    )
    wind: Annotated[NonNegativeFloat, Field(allow_inf_nan=False)] | None = Field(
        None, description="standard deviations of its north and its east force [N]"
    )


class Criteria(BaseModel):
    """The content of the file."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    purpose: str | None = Field(None, description="intended use of the model")
    particulars: Particulars = Field(
        default_factory=lambda: Particulars.model_validate({}), description="head of the record"
    )
    input_std: InputStd = Field(
        default_factory=lambda: InputStd.model_validate({}),
        description="standard deviations of the inputs, for u_input of the record",
    )
    criteria: Annotated[list[Criterion], Field(min_length=1)]


class ReadCriteria(NamedTuple):
    """Criteria as they were read.

    Attributes:
        content: of the file.
        path: of it.
        sha256: of the bytes that were read.
        modified, read: local times with their offset, ISO 8601.
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
    what = "criteria (cybership criteria prints a template)"
    try:
        changed, raw = path.stat().st_mtime, path.read_bytes()
    except OSError as error:
        raise InputError(f"no such {what}: '{path}' ({error.strerror})") from None
    content = read_model(path, Criteria, what, _special, renamed="criteria", raw=raw)
    modified = datetime.fromtimestamp(changed).astimezone().isoformat(timespec="seconds")
    return ReadCriteria(content, str(path), sha256(raw).hexdigest(), modified, now())


def now() -> str:
    """The time of this computer with its offset, ISO 8601."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def _special(kind: str, location: Location, value: object) -> str:
    if kind == "literal_error" and location[-1] == "quantity":
        return f"'{value}' cannot be judged{nearest(str(value), JUDGED)}"
    return ""


def template() -> dict[str, Any]:
    """A first file, whose numbers are to be replaced."""
    first = {"quantity": "position", "horizon": 8.0, "tolerance": 0.1, "unit": "m", "coverage": 0.9}
    second = {"quantity": "heading", "horizon": 8.0, "tolerance": 5.0, "unit": "deg", "coverage": 0.9}
    given = dict.fromkeys(Particulars.model_fields)
    return {
        "purpose": "intended use of the model",
        "particulars": given,
        "criteria": [first, second],
    }


def json_schema() -> dict[str, Any]:
    """JSON Schema of the file."""
    return Criteria.model_json_schema()
