"""Content of ``comparison.json`` and ``diagnosis.json``: parts of the results, by their own names.

All numbers are in SI; a number that is not finite, or not known, is null.
"""

import platform
from collections.abc import Collection, Iterator, Mapping, Sequence
from importlib.metadata import version
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

from typing_extensions import deprecated

from ..assessment.regions import ErrorRegions
from ..predictors.evaluation import Evaluation
from ..predictors.ship_model import parameter_and_run
from ..runs import by_name, channels_of
from ..runs.cleaning import Z95
from ..session import CalibratedModel, Comparison, Diagnosis
from ..verdict.prediction_gain import PredictionGain
from .formatting import as_json, finite
from .headline import (
    contradicted_by_tests,
    first_sentences,
    gain_of_calibration,
    gain_of_search,
    reading_of_commands,
    worse_than_constant_velocities,
)
from .report_data import SHOWN_ERRORS, ReportData, seconds

LIBRARIES = ("cybership", "numpy", "scipy")
# Attributes that the files hold; KEY=ATTRIBUTE where a key has another name.
COUNTS = "samples frozen dropped spikes used"
COVARIATE = "by=covariate.id unit=covariate.unit run"
REGION = f"axis {COVARIATE} low high rms elsewhere share_of_time=share sentence"
PROFILE = f"axis {COVARIATE} ends=edges rms uncertainty share_of_time=share"
SENSOR = "channel kind value unit ci95 from=start to=end sentence alike repaired aside"
EFFECT = (
    "id axis coefficients confidence share_of_error indistinguishable advice sentence equation "
    "separation share_unique doubt"
)
RANKED = "id score q2 beyond behind behind_std"
STABILITY = (
    "nominal_min_dissipation learned_min_dissipation bounded region mass_definite closed_loop notes"
)
CHANGE = "before after difference standard_error"
UNRECORDED = "size=disturbance.size time=disturbance.time values=differing stretches sentence"
ERRORS = {
    "window_position_rmse": "position",
    "window_heading_rmse": "heading",
    "omega_rms": "omega_rms",
}


class Content(dict[str, Any]):
    """The content of a JSON file, whose keys are attributes as well, at any depth."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    @classmethod
    def of(cls, value: Any) -> Any:
        """A value in the types of JSON, mappings as contents."""
        if isinstance(value, Mapping):
            return cls((name, cls.of(each)) for name, each in value.items())
        return [*map(cls.of, value)] if isinstance(value, list) else value

    @property
    def accepted(self) -> list["Content"]:
        """The effects that were found, then those that are only possible."""
        return [*self["effects"], *self["possibilities"]]

    @deprecated("The content is a dictionary.")
    def model_dump(self, mode: str = "json", exclude: Collection[str] = ()) -> dict[str, Any]:
        return {name: value for name, value in self.items() if name not in exclude}

    @deprecated("Use json.dumps.")
    def model_dump_json(self, indent: int | None = None) -> str:
        return as_json(self, indent)


@deprecated("Use diagnosis.Content.")
class ComparisonContent(Content):
    """The content of ``comparison.json``."""


@deprecated("Use diagnosis.Content.")
class DiagnosisContent(Content):
    """The content of ``diagnosis.json``."""


@deprecated("Use diagnosis.Content.")
class EffectResult(Content):
    """An effect in ``diagnosis.json``."""


def comparison_content(comparison: Comparison, model: Path | None, files: Sequence[str]) -> Content:
    """The content of ``comparison.json``.

    Args:
        comparison: the errors of a model on some runs.
        model: file of the initial model; None: the nominal one.
        files: names of the files that are written together.
    """
    return file_content(ReportData.of(comparison, model, files))


def diagnosis_content(diagnosis: Diagnosis, model: Path | None, files: Sequence[str]) -> Content:
    """The content of ``diagnosis.json``; arguments as of :func:`comparison_content`."""
    return file_content(ReportData.of(diagnosis, model, files))


def file_content(r: ReportData) -> Content:
    """The content of the JSON file of a report."""
    prediction, model_error = r.lengths
    runs = {
        "data": _data(r.evaluations),
        "windows": {"prediction": prediction, "model_error": model_error},
        "sensors": [s for e in r.evaluations for s in sensor_results(e)],
        "errors": [*_errors(r)],
        "constant_velocities": " ".join(worse_than_constant_velocities(r)),
        "where": _where(r.comparison.before),
    }
    names, fmu = [e.name for e in r.evaluations], fmu_result(r.comparison)
    origin = {"runs": names, "model": r.model, "files": list(r.files), "versions": versions()}
    if r.diagnosis is None:
        return Content.of(finite(runs | {"fmu": fmu} | origin))
    d, learned = r.diagnosis, r.diagnosis.learned
    found = {
        "verdict": d.verdict,
        "sentence": first_sentences(r),
        "commands": " ".join(reading_of_commands(d)),
        "test_runs": " ".join(contradicted_by_tests(r)),
        "gain": gain_content(d.gain, gain_of_search(r)),
        "remainder": {
            "significant": d.remainder.significant,
            "axes": {axis: part(a, "rms uncertainty share") for axis, a in d.remainder.axes.items()},
            "sentence": d.remainder.sentence,
        },
        "effects": [part(e, EFFECT) for e in r.effects],
        "possibilities": [part(e, f"{EFFECT} in_model") for e in r.possibilities],
        "withdrawn": [part(w, "id reason") for w in d.withdrawn],
        "calibrated": d.calibrated,
        "unrecorded": part(d.unrecorded, UNRECORDED),
        "correlation": part(d.posterior, "names matrix=correlation together"),
        "inseparable": r.inseparable,
        "suspect_coefficients": [
            part(s, "name z value") | {"description": r.suspects[s.name]} for s in learned.suspects
        ],
        "coefficients": [*coefficients(d)],
        "ranking": [part(c, RANKED) for c in learned.ranking],
    }
    last = {
        "where_after": _where(r.comparison.after),
        "fmu": fmu,
        "stability": part(d.stability, STABILITY),
        "prior": d.prior,
        "seed": d.seed,
    }
    return Content.of(finite(found | runs | last | origin))


def calibration_content(calibrated: CalibratedModel, r: ReportData, left_out: Sequence[str]) -> Content:
    """The content of ``calibrated.json``.

    Args:
        calibrated: the calibrated model.
        r: the report of its comparison with the initial model.
        left_out: what the command did not do, a sentence each.
    """
    known = {
        "gain": gain_content(calibrated.gain, gain_of_calibration(calibrated, r)),
        "coefficients": [*coefficients(calibrated)],
        "moved": calibrated.learned.moved,
        "correlation": part(calibrated.posterior, "names matrix=correlation together"),
        "prior": calibrated.prior,
        "commands": " ".join(reading_of_commands(calibrated)),
        "left_out": [*left_out],
    }
    return Content.of(finite(known | file_content(r)))


def gain_content(gain: PredictionGain | None, sentences: Sequence[str]) -> dict[str, Any] | None:
    """What a model gains over another [m], [m2], [rad], [rad2]; None: not known."""
    if gain is None:
        return None
    changes = {n: part(getattr(gain, n), CHANGE) for n in ("position", "heading")}
    return part(gain, "gained over where windows") | changes | {"sentence": " ".join(sentences)}


def part(of: Any, keys: str) -> dict[str, Any]:
    """Attributes of an object by the keys of the files."""
    pairs = (key.split("=") for key in keys.split())
    return {pair[0]: attrgetter(pair[-1])(of) for pair in pairs}


class CoefficientChange(NamedTuple):
    """A value of the model at first and with what was learned, and where the first is from."""

    name: str
    unit: str
    before: float
    after: float
    ci95: tuple[float, float] | None
    origin: str


def coefficients(diagnosis: Diagnosis | CalibratedModel) -> Iterator[CoefficientChange]:
    """The nominal coefficients that are not zero, then what else was fitted."""
    start, model, std = diagnosis.start, diagnosis.learned.model, diagnosis.posterior.std
    known = start.ship.coefficients
    for name in dict.fromkeys([*known, *std]):
        before, after = start.value(name), model.value(name)
        if before == after == 0.0:
            continue
        half = Z95 * std[name] if name in std else None
        yield CoefficientChange(
            f"{start.owner(parameter_and_run(name)[0])}.{name}",
            start.declared(name).unit,
            before,
            after,
            None if half is None else (after - half, after + half),
            known[name].origin if name in known else "learned",
        )


def write_coefficients(diagnosis: Diagnosis, csv: Path, tex: Path) -> None:
    """Write the table of all coefficients as CSV and as LaTeX (booktabs)."""
    import pandas as pd

    table = pd.DataFrame(coefficients(diagnosis), columns=CoefficientChange._fields)
    ends = [interval or (None, None) for interval in table.pop("ci95")]
    table.insert(4, "ci95_low", [low for low, _ in ends])
    table.insert(5, "ci95_high", [high for _, high in ends])
    table.to_csv(csv, index=False)
    table.to_latex(tex, index=False, escape=True, float_format="%.4g", na_rep="--")


def versions() -> dict[str, str]:
    """Of all that makes numbers."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def fmu_result(comparison: Comparison) -> Content | None:
    """How a predictor that is not a model of this project predicts the runs; None: it is one."""
    described = comparison.predictor.description()
    return None if described is None else Content.of(finite(vars(described)))


def sensor_results(e: Evaluation) -> Iterator[Content]:
    """Faults of a run's channels."""
    for f in e.smoothed.sensors.findings if e.smoothed.sensors else ():
        yield Content.of(finite({"run": e.name} | part(f, SENSOR)))


def _data(evaluations: Sequence[Evaluation]) -> dict[str, Any]:
    """Numbers of samples of all runs together, and of each, with its duration [s] and notes on it."""
    counts = [part(e.smoothed.counts, COUNTS) for e in evaluations]
    channels = [[*channels_of(e.smoothed)] for e in evaluations]
    runs = [
        c
        | part(e, "run=name held_out")
        | {"seconds": seconds(e), "notes": list(e.smoothed.notes)}
        | {"channels": {x.name: finite(x.content()) for x in of}}
        for c, e, of in zip(counts, evaluations, channels, strict=True)
    ]
    every = {x.name: finite(x.content()) for x in by_name(chain(*channels))}
    total = {name: sum(c[name] for c in counts) for name in COUNTS.split()}
    return total | {"channels": every, "runs": runs}


def _errors(r: ReportData) -> Iterator[dict[str, Any]]:
    """Errors of prediction [m], [rad] and RMS of the model error [N, N, N m] on each run."""
    for e, measured, trial in zip(r.evaluations, r.measured, r.trials, strict=True):
        use = {} if r.diagnosis is None else {"use": e.use}
        rms = {name: part(e, f"before=before.{of} after=after.{of}") for name, of in ERRORS.items()}
        outputs = {name: {"rms_before": b, "rms_after": a} for name, (b, a) in measured.items()}
        coverage = None if e.bands is None else e.bands.coverage(e.after.residuals)
        names = [name for name, *_ in SHOWN_ERRORS]
        steady = e.constant_velocities and dict(
            zip(names, e.constant_velocities.over_all(), strict=True)
        )
        simplest = {"constant_velocities": steady}
        rest = simplest | {"measured": outputs, "coverage_90": coverage, "trial": trial}
        yield {"run": e.name, "held_out": e.held_out} | use | rms | rest


def _where(r: ErrorRegions) -> dict[str, Any]:
    return {
        "sentences": r.sentences,
        "regions": [part(region, REGION) for region in r.regions],
        "profiles": [part(profile, PROFILE) for profile in r.profiles],
    }
