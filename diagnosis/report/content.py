"""Content of the JSON files, made from the results of the diagnosis."""

import platform
from collections.abc import Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from fmus.effects.text import Found

from ..assessment.trial_errors import trial_errors
from ..predictors.evaluation import Evaluation
from ..predictors.measured_outputs import inseparable, named, rms
from ..predictors.ship_model import of_one_run, parameter_and_run
from ..search.findings import Finding
from ..search.prediction_fit.disturbance_summary import Unrecorded
from ..session import Comparison, Diagnosis
from . import result_keys
from .finding_text import advice, equation, sentence, separation_note, unit
from .headline import headline

T = TypeVar("T")
Z95 = 1.96  # standard deviations, 95 % of a normal distribution
LIBRARIES = ("cybership", "numpy", "scipy")
# Effects on other sets of axes count as XYN in the files.
AXES: dict[str, result_keys.Axes] = {"X": "X", "Y": "Y", "N": "N", "XY": "XY"}


def comparison_content(
    comparison: Comparison, model: Path | None, files: Sequence[str]
) -> result_keys.ComparisonContent:
    """The content of ``comparison.json``.

    Args:
        comparison: the errors of a model on some runs.
        model: its file; None: the nominal one.
        files: names of the files that are written together.
    """
    return result_keys.ComparisonContent(**_of_both(comparison, model, files))


def diagnosis_content(
    diagnosis: Diagnosis, model: Path | None, files: Sequence[str]
) -> result_keys.DiagnosisContent:
    """The content of ``diagnosis.json``.

    Args:
        diagnosis: what was learned.
        model: file of the initial model; None: the nominal one.
        files: names of the files that are written together.
    """
    learned, comparison, prior = diagnosis.learned, diagnosis.comparison, diagnosis.prior
    effects, possibilities = _effects(diagnosis)
    suspects = [
        result_keys.SuspectResult(
            name=s.name,
            z=s.z,
            value=s.value,
            description=diagnosis.start.declared(s.name).description,
        )
        for s in learned.suspects
    ]
    return result_keys.DiagnosisContent(
        verdict=diagnosis.verdict,
        sentence=headline(
            diagnosis.verdict,
            effects,
            possibilities,
            suspects,
            diagnosis.remainder.beyond_chance,
            diagnosis.calibrated,
        ),
        remainder=result_keys.RemainderResult.model_validate(diagnosis.remainder),
        effects=effects,
        possibilities=possibilities,
        withdrawn=[result_keys.WithdrawnResult.model_validate(w) for w in diagnosis.withdrawn],
        calibrated=diagnosis.calibrated,
        unrecorded=_unrecorded(diagnosis.unrecorded),
        correlation=result_keys.CorrelationResult(
            names=list(diagnosis.posterior.names),
            matrix=diagnosis.posterior.correlation.tolist(),
            together=diagnosis.posterior.together,
        ),
        inseparable=inseparable([e.weak_windows for e in comparison.evaluations], diagnosis.start),
        suspect_coefficients=suspects,
        coefficients=list(coefficients(diagnosis)),
        ranking=[result_keys.RankedResult.model_validate(r) for r in learned.ranking],
        where_after=result_keys.WhereResult.model_validate(comparison.after),
        stability=result_keys.StabilityResult.model_validate(diagnosis.stability),
        prior=dict(prior) if isinstance(prior, Mapping) else prior,
        seed=diagnosis.seed,
        **_of_both(comparison, model, files),
    )


def coefficients(diagnosis: Diagnosis) -> Iterator[result_keys.CoefficientChange]:
    """The nominal coefficients that are not zero, then what else was fitted."""
    start, model, std = diagnosis.start, diagnosis.learned.model, diagnosis.posterior.std
    known = start.ship.coefficients
    for name in dict.fromkeys([*known, *std]):
        before, after = start.value(name), model.value(name)
        if before == after == 0.0:
            continue
        half = Z95 * std[name] if name in std else None
        yield result_keys.CoefficientChange(
            name=f"{start.owner(parameter_and_run(name)[0])}.{name}",
            unit=start.declared(name).unit,
            before=before,
            after=after,
            ci95=None if half is None else (after - half, after + half),
            origin=known[name].origin if name in known else "learned",
        )


def write_coefficients(content: result_keys.DiagnosisContent, csv: Path, tex: Path) -> None:
    """Write the table of all coefficients as CSV and as LaTeX (booktabs)."""
    import pandas as pd

    rows = [c.model_dump() for c in content.coefficients]
    table = pd.DataFrame(rows, columns=[*result_keys.CoefficientChange.model_fields])
    ends = [interval or (None, None) for interval in table.pop("ci95")]
    table.insert(4, "ci95_low", [low for low, _ in ends])
    table.insert(5, "ci95_high", [high for _, high in ends])
    table.to_csv(csv, index=False)
    table.to_latex(tex, index=False, escape=True, float_format="%.4g", na_rep="--")


def _unrecorded(u: Unrecorded) -> result_keys.UnrecordedResult:
    return result_keys.UnrecordedResult(
        size=u.push.size.tolist(),
        time=u.push.time.tolist(),
        values=dict(u.differing),
        stretches=[result_keys.StretchResult(**s._asdict()) for s in u.stretches],
        sentence=u.sentence,
    )


def _of_both(comparison: Comparison, model: Path | None, files: Sequence[str]) -> dict[str, Any]:
    """What both files say of the runs, and of their origin."""
    evaluations = comparison.evaluations
    return {
        "data": _data(evaluations),
        "windows": _lengths(evaluations),
        "sensors": [s for e in evaluations for s in sensor_results(e)],
        "errors": [_errors(e) for e in evaluations],
        "where": result_keys.WhereResult.model_validate(comparison.before),
        "fmu": fmu_result(comparison),
        "runs": [e.name for e in evaluations],
        "model": None if model is None else model.name,
        "files": list(files),
        "versions": versions(),
    }


def versions() -> dict[str, str]:
    """Of all that makes numbers."""
    return {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}


def _lengths(evaluations: Sequence[Evaluation]) -> result_keys.WindowLengths:
    """Of the windows, of which one may be a whole run."""
    w = evaluations[0].weak_windows
    lengths = [e.windows.length for e in evaluations if e.windows is not None]
    return result_keys.WindowLengths(prediction=max(lengths, default=w.horizon), model_error=w.width)


def fmu_result(comparison: Comparison) -> result_keys.FmuResult | None:
    """How a predictor that is not a model of this project predicts the runs; None: it is one."""
    described = comparison.predictor.description()
    return None if described is None else result_keys.FmuResult(**vars(described))


def _data(evaluations: Sequence[Evaluation]) -> result_keys.Data:
    runs = []
    for e in evaluations:
        time, track = e.smoothed.time, e.smoothed.track
        seconds = float(time[-1] - time[0]) + track.period
        runs.append(
            result_keys.RunData(
                run=e.name,
                held_out=e.held_out,
                seconds=seconds,
                notes=list(e.smoothed.notes),
                **e.smoothed.counts._asdict(),
            )
        )
    totals = {
        name: sum(getattr(r, name) for r in runs) for name in result_keys.SampleCounts.model_fields
    }
    return result_keys.Data(runs=runs, **totals)


def sensor_results(e: Evaluation) -> Iterator[result_keys.SensorResult]:
    """Faults of a run's channels."""
    for f in e.smoothed.sensors.findings if e.smoothed.sensors else ():
        yield result_keys.SensorResult.model_validate({"run": e.name, **vars(f)})


def _errors(e: Evaluation) -> result_keys.RunErrors:
    b, a = e.before, e.after
    return result_keys.RunErrors(
        run=e.name,
        held_out=e.held_out,
        window_position_rmse=result_keys.Change(before=b.position, after=a.position),
        window_heading_rmse=result_keys.Change(before=b.heading, after=a.heading),
        omega_rms=result_keys.AxesChange(before=b.omega_rms.tolist(), after=a.omega_rms.tolist()),
        measured={
            name: result_keys.MeasuredError(
                rms_before=rms(e.weak_windows, e.model, name),
                rms_after=rms(e.weak_windows, e.learned or e.model, name),
            )
            for name in (named(e.weak_windows, e.model) if e.predicted_by.parametric else ())
        },
        coverage_90=None if e.bands is None else e.bands.coverage(a.residuals),
        trial=trial_errors(e),
    )


def _effects(
    diagnosis: Diagnosis,
) -> tuple[list[result_keys.EffectResult], list[result_keys.PossibilityResult]]:
    """The findings, and what is only possible."""
    learned, ship = diagnosis.learned, diagnosis.start.ship
    found, possible = [], []
    for f, share, alone, told in zip(
        learned.effects, diagnosis.shares, diagnosis.unique, diagnosis.believed, strict=True
    ):
        result = _effect(diagnosis, f, share, alone)
        if told:
            found.append(result)
        else:
            possible.append((result, ship.effects[f.id].search.by == "regression"))
    possible += [(_effect(diagnosis, f, f.share, None), False) for f in diagnosis.dropped]
    results = [result_keys.PossibilityResult(**r.model_dump(), in_model=here) for r, here in possible]
    return found, results


def _effect(
    diagnosis: Diagnosis, f: Finding, share: float, unique: float | None
) -> result_keys.EffectResult:
    effects = diagnosis.start.ship.effects
    effect = effects[f.id]
    # Of a coefficient the addition counts, of any other parameter of the effect its value.
    present = {n: 0.0 if n in effect.coefficients else diagnosis.start.value(n) for n in f.values}
    values = {n: x + present[n] for n, x in f.values.items()}
    ci95 = {n: (low + present[n], high + present[n]) for n, (low, high) in f.ci95.items()}
    coefficients = {
        _plain(name, f): result_keys.Coefficient(
            value=value,
            unit=unit(effect, name),
            ci95=ci95.get(name),
            run=parameter_and_run(name)[1] or None,
        )
        for name, value in values.items()
    }
    return result_keys.EffectResult(
        id=f.id,
        axis=AXES.get(effect.axis, "XYN"),
        coefficients=coefficients,
        confidence=f.confidence,
        share_of_error=share,
        indistinguishable=list(f.alike),
        advice=advice(f.id, f.alike, effects),
        sentence=_sentence(diagnosis, f, values),
        equation=equation(effect, _shown(diagnosis, values), _shown(diagnosis, ci95)),
        separation=separation_note(f.id, f.alike),
        share_unique=unique,
        doubt=f.doubt,
    )


def _plain(name: str, f: Finding) -> str:
    """The name of a value in the files: plain, but of the second run on in which alone it holds."""
    parameter, run = parameter_and_run(name)
    return parameter if run in f.of_runs[:1] else name


def _sentence(diagnosis: Diagnosis, f: Finding, values: Mapping[str, float]) -> str:
    """A finding in words; what holds in single runs, one after the other."""

    def told(own: Mapping[str, float]) -> str:
        return sentence(Found(diagnosis.start.ship.effects[f.id], own, diagnosis.speeds))

    shown = _shown(diagnosis, values)
    runs = [run for run in f.of_runs if shown is values]
    return " ".join(f"Run {run}: {told(of_one_run(values, run))}" for run in runs) or told(shown)


def _shown(diagnosis: Diagnosis, values: Mapping[str, T]) -> Mapping[str, T]:
    """Values by their names; where there is one run only, without it."""
    if len(diagnosis.comparison.evaluations) > 1:
        return values
    return {parameter_and_run(name)[0]: value for name, value in values.items()}
