"""Schema of ``validation.json``: numbers in SI, but those of a criterion in its unit."""

from typing import Literal

from ..report.result_keys import FmuResult, Number, Part, SensorResult

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


class FileResult(Part):
    """A file: what it was for, its path as it was given, its SHA-256 (of a log's folder: of the log)."""

    role: str
    path: str
    sha256: str


class CriteriaResult(Part):
    """The file of the criteria, when it was last changed and when it was read (UTC), and its content."""

    path: str
    sha256: str
    modified: str
    read: str
    purpose: str | None


class RangeResult(Part):
    """What the data cover of a signal."""

    signal: str
    unit: str
    least: Number
    q05: Number
    median: Number
    q95: Number
    greatest: Number


class BudgetResult(Part):
    """Standard uncertainties of the error at the horizon, in the criterion's unit; null: unknown.

    The combined ones hold what is known: u_input of initial state, parameters and process noise, u_val
    of u_num, u_input and u_D (the measurement).
    """

    u_D: Number
    initial_state: Number
    parameters: Number
    process_noise: Number
    u_input: Number
    u_num: Number
    u_val: Number
    unknown: list[str]


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
    tolerance: Number
    windows: int
    independent: Number
    E: Number
    rms: Number
    largest: Number
    estimate: Number
    low: Number
    high: Number
    budget: BudgetResult | None


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
    fmu: FmuResult | None
    files: list[FileResult]
    criteria: CriteriaResult
    judgements: list[JudgementResult]
    validity: list[RangeResult]
    sensors: list[SensorResult]
    notes: list[str]
    not_covered: list[str]
    reports: tuple[FileResult, ...] = ()
    public_key: str | None = None
