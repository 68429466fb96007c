"""What a report is made of: a comparison or a diagnosis, and what all its forms derive of it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import degrees, isfinite
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cosim.trials import DEGREES, MEASURES

from ..assessment.trial_errors import TrialErrors, trial_errors
from ..predictors.evaluation import Evaluation
from ..predictors.measured_outputs import inseparable, named, rms
from ..predictors.uncertainty import NOISE_TOLERANCE
from ..runs import MeasuredChannel, channels_of
from ..runs.cleaning import Z95
from ..search.findings import Ranked
from ..session import Comparison, Diagnosis
from ..verdict.prediction_gain import PairedChange
from .formatting import times
from .reported_effect import ReportedEffect, reported_effects

UNITS = {m.name.removesuffix("_1"): m.unit for m in MEASURES}
# Name of an error of prediction, the unit that it is shown in, and the factor to it.
SHOWN_ERRORS = (("position", "mm", 1e3), ("heading", "°", degrees(1.0)))
# What the data of a run were used for.
USES = {"train": "training", "validate": "validation", "test": "test"}


@dataclass(frozen=True, eq=False)
class ReportData:
    """What a report is made of.

    Attributes:
        comparison: the errors on all runs.
        diagnosis: what was learned; None: the report is of a comparison alone.
        model: name of the initial model's file; None: the nominal one.
        files: names of the files that are written together.
    """

    comparison: Comparison
    diagnosis: Diagnosis | None = None
    model: str | None = None
    files: Sequence[str] = ()

    @classmethod
    def of(
        cls, result: Comparison | Diagnosis, model: Path | None = None, files: Sequence[str] = ()
    ) -> "ReportData":
        """The report of a result, by the file of the initial model and the names of all files."""
        name = None if model is None else model.name
        if isinstance(result, Diagnosis):
            return cls(result.comparison, result, name, files)
        return cls(result, None, name, files)

    @property
    def evaluations(self) -> Sequence[Evaluation]:
        return self.comparison.evaluations

    @property
    def least_used(self) -> Evaluation:
        """The first run of which least was used."""
        return max(self.evaluations, key=lambda e: [*USES].index(e.use))

    @property
    def learned(self) -> bool:
        """Whether the learned model is another than the initial one."""
        return any(e.after is not e.before for e in self.evaluations)

    def use(self, e: Evaluation) -> str:
        """What the data of a run were used for; empty where nothing was learned from any run."""
        return USES[e.use] if self.diagnosis is not None or self.learned else ""

    def called(self, e: Evaluation) -> str:
        """The name of a run, and what its data were used for."""
        return f"{e.name} ({self.use(e)})" if self.use(e) else e.name

    @cached_property
    def lengths(self) -> tuple[float, float]:
        """Of the windows of prediction, one of which may be a whole run, and of the model error [s]."""
        w = self.evaluations[0].weak_windows
        lengths = [e.windows.length for e in self.evaluations if e.windows is not None]
        return max(lengths, default=w.horizon), w.width

    @cached_property
    def how_it_predicts(self) -> tuple[str, Sequence[str]]:
        """Kind of a predictor that is not a model of this project, and how it predicts; else empty."""
        described = self.comparison.predictor.description()
        return ("", []) if described is None else (described.kind, described.sentences)

    @cached_property
    def trials(self) -> list[TrialErrors | None]:
        """Measures of each run; None: it is no trial."""
        return [trial_errors(e) for e in self.evaluations]

    @cached_property
    def measured(self) -> list[dict[str, tuple[float, float]]]:
        """Of each run: output of an actuator that is measured -> RMS of the error before and after."""
        found = []
        for e in self.evaluations:
            w, last = e.weak_windows, e.learned or e.model
            names = named(w, e.model) if e.predictor.parametric else ()
            found.append({name: (rms(w, e.model, name), rms(w, last, name)) for name in names})
        return found

    @cached_property
    def channels(self) -> list[tuple[str, list[MeasuredChannel]]]:
        """Name of each run and its channels as they were measured."""
        return [(e.name, [*channels_of(e.smoothed)]) for e in self.evaluations]

    @cached_property
    def inseparable(self) -> list[str]:
        """What the commands leave open between thrust and resistance, a sentence each."""
        windows = [e.weak_windows for e in self.evaluations]
        return [] if self.diagnosis is None else inseparable(windows, self.diagnosis.start)

    @cached_property
    def suspects(self) -> dict[str, str]:
        """Nominal coefficient that is likely wrong -> its description."""
        if (d := self.diagnosis) is None:
            return {}
        return {s.name: d.start.declared(s.name).description for s in d.learned.suspects}

    @cached_property
    def _reported(self) -> tuple[list[ReportedEffect], list[ReportedEffect]]:
        return ([], []) if self.diagnosis is None else reported_effects(self.diagnosis)

    @property
    def effects(self) -> list[ReportedEffect]:
        """The effects that are reported as found."""
        return self._reported[0]

    @property
    def possibilities(self) -> list[ReportedEffect]:
        """The effects that are only possible."""
        return self._reported[1]

    @property
    def ranking(self) -> list[Ranked]:
        """The candidates that have a score, the best first."""
        every = [] if self.diagnosis is None else self.diagnosis.learned.ranking
        return [r for r in every if isfinite(r.score)]

    @property
    def accepted(self) -> list[ReportedEffect]:
        """The effects that were found, then those that are only possible."""
        return [*self.effects, *self.possibilities]


class TrialRow(NamedTuple):
    """A measure of a run that is a trial, angles in degrees: measured, and as the models predict it."""

    run: str
    measure: str
    unit: str
    measured: float | None
    before: float | None
    after: float | None


def trial_rows(r: ReportData) -> Iterator[TrialRow]:
    """One row for each measure of each trial."""
    for e, trial in zip(r.evaluations, r.trials, strict=True):
        for name, found in (trial or {}).items():
            unit, several = UNITS[name], isinstance(found[0], list)
            factor = degrees(1.0) if unit in DEGREES else 1.0
            for k, triple in enumerate(found if several else [found], 1):
                shown = [None if x is None else factor * x for x in triple]
                label = f"{name}_{k}" if several else name
                yield TrialRow(r.called(e), label, DEGREES.get(unit, unit), *shown)


def seconds(e: Evaluation) -> float:
    """Duration of a run [s]."""
    time = e.smoothed.time
    return float(time[-1] - time[0]) + e.smoothed.track.period


class ErrorChange(NamedTuple):
    """An error before and after, in the unit of its column.

    Attributes:
        before, after: root mean square.
        is_noise: whether the noise of the measurement explains the difference.
    """

    before: float
    after: float
    is_noise: bool

    @property
    def ratio(self) -> str:
        """By which the error fell, such as ``17×``."""
        return times(self.before, self.after)

    @property
    def kind(self) -> str:
        """A ``fall``, a ``rise``, or within the ``noise``."""
        if not self.after > self.before:
            return "fall"
        return "noise" if self.is_noise else "rise"


def error_changes(r: ReportData, k: int) -> list[ErrorChange]:
    """Position [mm], heading [°] and model error [N, N, N m] of the k-th run.

    A change of predictions within two paired standard errors over the windows is noise, and a model
    error that stays within its uncertainty.
    """
    e, found = r.evaluations[k], []
    for name, _, factor in SHOWN_ERRORS:
        before, after = getattr(e.before, name), getattr(e.after, name)
        errors = [x.errors for x in (e.before, e.after)]
        squares = [np.square(getattr(x, name)) for x in errors if x is not None]
        change = PairedChange.of(squares[0], squares[-1]) if squares else None
        is_noise = change is not None and abs(change.difference) <= Z95 * change.standard_error
        found.append(ErrorChange(factor * before, factor * after, is_noise))
    noise = NOISE_TOLERANCE * np.sqrt(np.mean(np.square(r.comparison.omega_std[k]), axis=0))
    for before, after, most in zip(e.before.omega_rms, e.after.omega_rms, noise, strict=True):
        found.append(ErrorChange(float(before), float(after), bool(after <= most)))
    return found
