"""The content of ``comparison.json`` and ``diagnosis.json``.

All numbers are in SI; where a number is not finite, or not known, there is null.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict


def _finite(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


Number = Annotated[float | None, BeforeValidator(_finite)]
Axes = Literal["X", "Y", "N", "XY", "XYN"]


class Part(BaseModel):
    """A part of a result."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Counts(Part):
    """Samples, and what became of them: used is the rest."""

    samples: int
    frozen: int
    dropped: int
    spikes: int
    used: int


class RunData(Counts):
    """One run's samples, how long it is [s], and what was found in it, a line each."""

    run: str
    held_out: bool
    seconds: Number
    notes: list[str]


class Data(Counts):
    """The samples of all runs together, and of each."""

    runs: list[RunData]


class Change(Part):
    """Of the model at first and at last; the same where nothing was learned."""

    before: Number
    after: Number


class AxesChange(Part):
    """The same for X, Y, N."""

    before: list[Number]
    after: list[Number]


class RunErrors(Part):
    """Errors of a run: window prediction error [m], [rad], and RMS of the model error [N, N, N m]."""

    run: str
    held_out: bool
    window_position_rmse: Change
    window_heading_rmse: Change
    omega_rms: AxesChange


class RegionResult(Part):
    """Where the model is clearly worse than elsewhere; an open end is null."""

    axis: str
    by: str
    unit: str
    run: str | None
    low: Number
    high: Number
    rms: Number
    elsewhere: Number
    share_of_time: Number
    sentence: str


class ProfileResult(Part):
    """RMS of the model error of an axis over a covariate, bin by bin, with its uncertainty."""

    axis: str
    by: str
    unit: str
    run: str | None
    ends: list[Number]
    rms: list[Number]
    uncertainty: list[Number]
    share_of_time: list[Number]


class WhereResult(Part):
    """Where the model fails: a sentence for each axis, all clear regions, and all profiles."""

    sentences: list[str]
    regions: list[RegionResult]
    profiles: list[ProfileResult]


class Comparison(Part):
    """The content of ``comparison.json``; at its end what it was made with."""

    data: Data
    errors: list[RunErrors]
    where: WhereResult
    runs: list[str]
    model: str | None
    files: list[str]
    versions: dict[str, str]


class Coefficient(Part):
    """An addition to the nominal value, and its 95 % interval; null where there is none."""

    value: Number
    unit: str
    ci95: tuple[Number, Number] | None


class EffectResult(Part):
    """An effect that was found."""

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


class SuspectResult(Part):
    """A nominal coefficient that is likely wrong: the new total, and by how many prior deviations."""

    name: str
    z: Number
    value: Number


class RankedResult(Part):
    """A candidate of the first step; a lower score is better."""

    id: str
    score: Number
    q2: Number


class StabilityResult(Part):
    """What the check of the learned model says."""

    nominal_min_dissipation: Number
    learned_min_dissipation: Number
    bounded: bool
    region: str | None
    mass_definite: bool
    notes: list[str]


class Diagnosis(Part):
    """The content of ``diagnosis.json``; at its end what it was made with."""

    verdict: Literal["found", "ambiguous", "none"]
    sentence: str
    effects: list[EffectResult]
    suspect_coefficients: list[SuspectResult]
    ranking: list[RankedResult]
    data: Data
    errors: list[RunErrors]
    where: WhereResult
    where_after: WhereResult
    stability: StabilityResult
    prior: Number
    seed: int
    runs: list[str]
    model: str | None
    files: list[str]
    versions: dict[str, str]
