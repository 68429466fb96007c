"""Schema of ``comparison.json`` and ``diagnosis.json``.

All numbers are in SI; a number that is not finite, or not known, is null.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import (
    AliasChoices,
    AliasPath,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
)

from ..runs.sensors.constants import Kind


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


Number = Annotated[float | None, BeforeValidator(_finite)]
Numbers = Annotated[list[Number], BeforeValidator(list)]
# Where other names are behind those of the files.
COVARIATE, UNIT = (Field(validation_alias=AliasPath("covariate", name)) for name in ("id", "unit"))
SHARE = Field(validation_alias="share")
Axes = Literal["X", "Y", "N", "XY", "XYN"]
# Measured, before, after; or a list of these.
Triples = Annotated[list[list[Number]] | list[Number], Field(union_mode="left_to_right")]


class Part(BaseModel):
    """A part of a result, also by what has attributes of the same names."""

    model_config = ConfigDict(extra="forbid", frozen=True, from_attributes=True, populate_by_name=True)


class SampleCounts(Part):
    """Numbers of samples: all, those left out for each reason, and the rest, which is used."""

    samples: int
    frozen: int
    dropped: int
    spikes: int
    used: int


class RunData(SampleCounts):
    """Samples of one run, its duration [s], and notes on it, a line each."""

    run: str
    held_out: bool
    seconds: Number
    notes: list[str]


class Data(SampleCounts):
    """Samples of all runs together, and of each."""

    runs: list[RunData]


class Change(Part):
    """A number of the initial and of the learned model; the same where nothing was learned."""

    before: Number
    after: Number


class AxesChange(Part):
    """Numbers for X, Y, N of the initial and of the learned model."""

    before: list[Number]
    after: list[Number]


class WindowLengths(Part):
    """Length [s] of the windows of predictions, and of those of the model error."""

    prediction: Number
    model_error: Number


class MeasuredError(Part):
    """RMS of what is measured of an actuator less what the models say, in SI."""

    rms_before: Number
    rms_after: Number


class SensorResult(Part):
    """A fault of a channel that other channels of the run show, in a stretch of the log's time [s].

    alike: what would look the same. repaired: whether the channels repaired it, for all that follows.
    """

    run: str
    channel: str
    kind: Kind
    value: Number
    unit: str
    ci95: tuple[Number, Number]
    start: Annotated[Number, Field(validation_alias=AliasChoices("start", "from"))]
    end: Annotated[Number, Field(validation_alias=AliasChoices("end", "to"))]
    sentence: str
    alike: list[str]
    repaired: bool

    @model_serializer(mode="wrap")
    def _ends(self, content: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """In the files the ends have the names that Python keeps to itself."""
        told: dict[str, Any] = content(self)
        return {{"start": "from", "end": "to"}.get(name, name): told[name] for name in told}


class RunErrors(Part):
    """Window prediction error of a run [m], [rad], and RMS of the model error [N, N, N m].

    measured: ``ACTUATOR.OUTPUT`` -> its error, of outputs that are measured and not fitted.
    coverage_90: share of the windows' samples, positions and headings alike, within the 90 % band.
    trial: of a manoeuvring trial its measures, [measured, before, after] each; of what comes several
    times, as overshoots do, a list of these; null: the run is none.
    """

    run: str
    held_out: bool
    window_position_rmse: Change
    window_heading_rmse: Change
    omega_rms: AxesChange
    measured: dict[str, MeasuredError] = {}
    coverage_90: Number = None
    trial: dict[str, Triples] | None = None


class RegionResult(Part):
    """Interval of a covariate where the model error is larger than elsewhere; an open end is null."""

    axis: str
    by: Annotated[str, COVARIATE]
    unit: Annotated[str, UNIT]
    run: str | None
    low: Number
    high: Number
    rms: Number
    elsewhere: Number
    share_of_time: Annotated[Number, SHARE]
    sentence: str


class ProfileResult(Part):
    """RMS of the model error of an axis over a covariate, bin by bin, with its uncertainty."""

    axis: str
    by: Annotated[str, COVARIATE]
    unit: Annotated[str, UNIT]
    run: str | None
    ends: Annotated[Numbers, Field(validation_alias="edges")]
    rms: Numbers
    uncertainty: Numbers
    share_of_time: Annotated[Numbers, SHARE]


class WhereResult(Part):
    """Where the model fails: a sentence for each axis, all significant regions, and all profiles."""

    sentences: list[str]
    regions: list[RegionResult]
    profiles: list[ProfileResult]


class FmuResult(Part):
    """How an FMU, or another predictor that is not a model of this project, predicts the runs.

    kind: ``FMU``, ``Python function``; map: which of its variables is which signal; run_in: the first
    part [s] of each run that does not count; whole_runs: no window has a start of its own.
    """

    kind: str = "FMU"
    name: str
    sha256: str
    map: dict[str, Any]
    whole_runs: bool
    run_in: dict[str, Number]
    sentences: list[str]


class ComparisonContent(Part):
    """The content of ``comparison.json``; at its end what it was made with."""

    data: Data
    windows: WindowLengths
    sensors: list[SensorResult] = []
    errors: list[RunErrors]
    where: WhereResult
    fmu: FmuResult | None = None
    runs: list[str]
    model: str | None
    files: list[str]
    versions: dict[str, str]


class Coefficient(Part):
    """An addition to the nominal value, and its 95 % interval; null where there is none.

    ``run`` is the one in which alone it holds, such as the time of a failure; null: it holds in all.
    """

    value: Number
    unit: str
    ci95: tuple[Number, Number] | None
    run: str | None = None


class EffectResult(Part):
    """An effect that was accepted; share_unique: of the error, what nothing else explains.

    doubt: what speaks against it beside the confidence.
    """

    id: str
    axis: Axes
    coefficients: dict[str, Coefficient]
    confidence: Number
    share_of_error: Number
    indistinguishable: list[str]
    advice: str
    sentence: str
    equation: str
    separation: str
    share_unique: Number = None
    doubt: str = ""


class PossibilityResult(EffectResult):
    """An effect that was accepted, but is not believed; in_model: whether ``model.ssv`` has it."""

    in_model: bool


class AxisRemainderResult(Part):
    """What is left on an axis, its uncertainty [N or N m], and the share of the first sum of squares."""

    rms: Number
    uncertainty: Number
    share: Number


class RemainderResult(Part):
    """What the model in ``model.ssv`` leaves, and whether that is more than chance and matters."""

    significant: bool
    axes: dict[str, AxisRemainderResult]
    sentence: str


class WithdrawnResult(Part):
    """An effect that was accepted on training data and made unseen data worse."""

    id: str
    reason: str


class SuspectResult(Part):
    """A nominal coefficient that is likely wrong: its new total, how far off [prior std], what it is."""

    name: str
    z: Number
    value: Number
    description: str = ""


class RankedResult(Part):
    """A candidate of the first step; a lower score is better.

    beyond: share of what the nominal coefficients alone leave that it explains. behind, behind_std: its
    score less that of the first, and the standard error of that, paired over blocks.
    """

    id: str
    score: Number
    q2: Number
    beyond: Number
    behind: Number
    behind_std: Number


class StabilityResult(Part):
    """Result of the check of the learned model."""

    nominal_min_dissipation: Number
    learned_min_dissipation: Number
    bounded: bool
    region: str | None
    mass_definite: bool
    closed_loop: bool
    notes: list[str]


class StretchResult(Part):
    """A stretch of a run [s] in which the unrecorded force is large, and its size [N or N m]."""

    run: str
    axis: str
    start: Number
    end: Number
    size: Number


class UnrecordedResult(Part):
    """The force that is in no command and no effect: size [N, N, N m] and time [s] of X, Y, N.

    values: of which the fit to the model error and that to predictions differ by more than their
    intervals; each with both.
    """

    size: list[Number]
    time: list[Number]
    values: dict[str, tuple[Number, Number]]
    stretches: list[StretchResult]
    sentence: str


class CorrelationResult(Part):
    """Correlations of all fitted values, and the groups of those that are known only together."""

    names: list[str]
    matrix: list[list[Number]]
    together: list[list[str]]


class CoefficientChange(Part):
    """A value of the model at first and with what was learned, and where the first is from."""

    name: str
    unit: str
    before: Number
    after: Number
    ci95: tuple[Number, Number] | None
    origin: str


class DiagnosisContent(Part):
    """The content of ``diagnosis.json``; at its end what it was made with."""

    verdict: Literal["found", "ambiguous", "coefficients", "unexplained", "none"]
    sentence: str
    remainder: RemainderResult
    effects: list[EffectResult]
    possibilities: list[PossibilityResult]
    withdrawn: list[WithdrawnResult]
    calibrated: bool = False
    unrecorded: UnrecordedResult
    correlation: CorrelationResult
    inseparable: list[str] = []
    suspect_coefficients: list[SuspectResult]
    coefficients: list[CoefficientChange] = []
    ranking: list[RankedResult]
    data: Data
    windows: WindowLengths
    sensors: list[SensorResult] = []
    errors: list[RunErrors]
    where: WhereResult
    where_after: WhereResult
    fmu: FmuResult | None = None
    stability: StabilityResult
    prior: float | dict[str, float] | None
    seed: int
    runs: list[str]
    model: str | None
    files: list[str]
    versions: dict[str, str]

    @property
    def accepted(self) -> list[EffectResult]:
        """The effects that were found, then those that are only possible."""
        return [*self.effects, *self.possibilities]
