"""The content of ``validation.json``: numbers in SI, but those of a criterion in its unit.

A number that is not finite, or not known, is null in the file.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

FORM = "cybership validation record 1"
STANDING = (
    "This record uses terms of ASME V&V 20, ITTC 7.5-02-06-03 and DNV-RP-0513. "
    "It claims conformity with none of them."
)
REFERENCES = (
    "ASME V&V 20-2009: Standard for Verification and Validation in Computational Fluid Dynamics "
    "and Heat Transfer (comparison error E, u_num, u_input, u_D, u_val).",
    "ITTC Recommended Procedures 7.5-02-06-03: Validation of Manoeuvring Simulation Models "
    "(documentation of a model and of the data it is held against).",
    "DNV-RP-0513: Assurance of simulation models (criteria before the comparison, intended use, "
    "traceable records).",
    "JCGM 100:2008 (GUM): Guide to the expression of uncertainty in measurement (standard and expanded "
    "uncertainty).",
)


class Part:
    """A part of the record; a file that is read must have no other keys."""

    __pydantic_config__: ClassVar = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class FileResult(Part):
    """A file: what it was for, its path as it was given, its SHA-256 (of a log's folder: of the log)."""

    role: str
    path: str
    sha256: str


@dataclass(frozen=True, kw_only=True)
class CriteriaResult(Part):
    """The file of the criteria, when it was last changed and when it was read (UTC), and its content."""

    path: str
    sha256: str
    modified: str
    read: str
    purpose: str | None


@dataclass(frozen=True)
class RangeResult(Part):
    """What the data cover of a signal."""

    signal: str
    unit: str
    least: float | None
    q05: float | None
    median: float | None
    q95: float | None
    greatest: float | None


@dataclass(frozen=True, kw_only=True)
class BudgetResult(Part):
    """Standard uncertainties of the error at the horizon, in the criterion's unit; null: unknown.

    The combined ones hold what is known: u_input of initial state, parameters and process noise, u_val
    of u_num, u_input and u_D (the measurement).
    """

    u_D: float | None
    initial_state: float | None
    parameters: float | None
    process_noise: float | None
    u_input: float | None
    u_num: float | None
    u_val: float | None
    unknown: list[str]


@dataclass(frozen=True, kw_only=True)
class JudgementResult(Part):
    """A criterion and what the data say of it; errors in the criterion's unit.

    E: mean of measured minus predicted, of position of the distance. estimate, low, high: the share, or
    the RMS, with bounds at the criterion's confidence.
    """

    criterion: str
    requirement: str
    outcome: Literal["met", "not met", "cannot be judged"]
    reason: str
    runs: list[str]
    unit: str
    tolerance: float | None
    windows: int
    independent: float | None
    E: float | None
    rms: float | None
    largest: float | None
    estimate: float | None
    low: float | None
    high: float | None
    budget: BudgetResult | None


@dataclass(frozen=True, kw_only=True)
class RecordContent(Part):
    """The content of ``validation.json``."""

    form: str = FORM
    standing: str = STANDING
    references: tuple[str, ...] = REFERENCES
    made: str
    command: str
    versions: dict[str, str]
    model: str
    ship: str
    fmu: dict[str, Any] | None
    files: list[FileResult]
    criteria: CriteriaResult
    judgements: list[JudgementResult]
    validity: list[RangeResult]
    sensors: list[dict[str, Any]]
    notes: list[str]
    not_covered: list[str]
    reports: tuple[FileResult, ...] = ()
    public_key: str | None = None
