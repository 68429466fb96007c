"""Turns what was found into the content of the JSON files."""

import platform
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fmus.effects import EFFECTS

from . import results
from .advice import advice, separation_note
from .evidence import Evidence
from .selection import Finding
from .session import Confronted, Diagnosed
from .where import Profile, Region, Where
from .words import Told, equation, sentence, unit

LIBRARIES = ("cybership", "numpy", "scipy")
# Files know no XN and YN.
AXES: dict[str, results.Axes] = {"X": "X", "Y": "Y", "N": "N", "XY": "XY"}
NOTHING = "Nothing is missing that these data show."


def comparison(found: Confronted, model: Path | None, files: Sequence[str]) -> results.Comparison:
    """The content of ``comparison.json``.

    Args:
        found: runs held against a model.
        model: its file; None: the nominal one.
        files: names of what is written with it.
    """
    return results.Comparison(
        data=_data(found.evidence),
        errors=[_errors(e) for e in found.evidence],
        where=_where(found.before),
        **_made(found, model, files),
    )


def diagnosis(found: Diagnosed, model: Path | None, files: Sequence[str]) -> results.Diagnosis:
    """The content of ``diagnosis.json``, arguments as of :func:`comparison`."""
    told = [_effect(found, f, s) for f, s in zip(found.learned.findings, found.shares, strict=True)]
    s = found.stability
    return results.Diagnosis(
        verdict=found.verdict,
        sentence=" ".join(e.sentence for e in told) or NOTHING,
        effects=told,
        suspect_coefficients=[
            results.SuspectResult(name=x.name, z=x.z, value=x.value) for x in found.learned.suspects
        ],
        ranking=[results.RankedResult(id=r.id, score=r.score, q2=r.q2) for r in found.learned.ranking],
        data=_data(found.runs.evidence),
        errors=[_errors(e) for e in found.runs.evidence],
        where=_where(found.runs.before),
        where_after=_where(found.runs.after),
        stability=results.StabilityResult(
            nominal_min_dissipation=s.nominal_min_dissipation,
            learned_min_dissipation=s.learned_min_dissipation,
            bounded=s.bounded,
            region=s.region,
            mass_definite=s.mass_definite,
            notes=list(s.notes),
        ),
        prior=found.prior,
        seed=found.seed,
        **_made(found.runs, model, files),
    )


def _made(found: Confronted, model: Path | None, files: Sequence[str]) -> dict[str, Any]:
    versions = {"python": platform.python_version()} | {name: version(name) for name in LIBRARIES}
    runs = [e.name for e in found.evidence]
    return {
        "runs": runs,
        "model": None if model is None else model.name,
        "files": list(files),
        "versions": versions,
    }


def _data(evidence: Sequence[Evidence]) -> results.Data:
    runs = []
    for e in evidence:
        time, track = e.smoothed.time, e.smoothed.track
        seconds = float(time[-1] - time[0]) + track.period
        runs.append(
            results.RunData(
                run=e.name,
                held_out=e.held_out,
                seconds=seconds,
                notes=list(e.smoothed.notes),
                **e.smoothed.counts._asdict(),
            )
        )
    totals = {name: sum(getattr(r, name) for r in runs) for name in results.Counts.model_fields}
    return results.Data(runs=runs, **totals)


def _errors(e: Evidence) -> results.RunErrors:
    b, a = e.before, e.after
    return results.RunErrors(
        run=e.name,
        held_out=e.held_out,
        window_position_rmse=results.Change(before=b.position, after=a.position),
        window_heading_rmse=results.Change(before=b.heading, after=a.heading),
        omega_rms=results.AxesChange(before=b.omega_rms.tolist(), after=a.omega_rms.tolist()),
    )


def _where(found: Where) -> results.WhereResult:
    return results.WhereResult(
        sentences=list(found.sentences),
        regions=[_region(r) for r in found.regions],
        profiles=[_profile(p) for p in found.profiles],
    )


def _region(r: Region) -> results.RegionResult:
    return results.RegionResult(
        axis=r.axis,
        by=r.kind.id,
        unit=r.kind.unit,
        run=r.run,
        low=r.low,
        high=r.high,
        rms=r.rms,
        elsewhere=r.elsewhere,
        share_of_time=r.share,
        sentence=r.sentence,
    )


def _profile(p: Profile) -> results.ProfileResult:
    return results.ProfileResult(
        axis=p.axis,
        by=p.kind.id,
        unit=p.kind.unit,
        run=p.run,
        ends=p.ends.tolist(),
        rms=p.rms.tolist(),
        uncertainty=p.uncertainty.tolist(),
        share_of_time=p.share.tolist(),
    )


def _effect(found: Diagnosed, f: Finding, share: float) -> results.EffectResult:
    effect = EFFECTS[f.id]
    coefficients = {
        name: results.Coefficient(value=value, unit=unit(effect, name), ci95=f.ci95.get(name))
        for name, value in f.values.items()
    }
    return results.EffectResult(
        id=f.id,
        axis=AXES.get(effect.axis, "XYN"),
        coefficients=coefficients,
        confidence=f.confidence,
        share_of_error=share,
        indistinguishable=list(f.alike),
        advice=advice(f.id, f.alike),
        sentence=sentence(Told(effect, f.values, found.speeds)),
        equation=equation(effect, f.values, f.ci95),
        separation=separation_note(f.id, f.alike),
    )
