"""The findings of a diagnosis with what is said of them, for terminal, page and files alike."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeVar

import numpy as np

from fmus.effects.force import damping_sentence
from fmus.effects.text import Found, towards

from ..assessment.stability import force
from ..execution.short_text import SHOWN
from ..predictors import Model
from ..predictors.ship_model import of_one_run, parameter_and_run
from ..runs.run_constants import DIGITS
from ..runs.sensors.constants import LEAST
from ..search.conclusion import interval
from ..search.findings import Finding
from ..search.nonlinear.multistart import limits
from ..search.shortlist import TIE
from ..session import Diagnosis
from .finding_text import advice, equation, sentence, separation_note, unit

T = TypeVar("T")
OTHERWISE = 2.0  # 1, ratio of two forces of which one does not stand for the other (chosen)
OF_ERROR = "of the squared error with the coefficients"
OF_POWER = "of the power of the model error, on the axis with the most"
AXES = ("X", "Y", "N", "XY")  # effects on other sets of axes count as XYN


class ReportedCoefficient(NamedTuple):
    """An addition to the nominal value, and its 95 % interval; None where there is none.

    ``run`` is the one in which alone it holds, such as the time of a failure; None: it holds in all.
    """

    value: float
    unit: str
    ci95: tuple[float, float] | None
    run: str | None


@dataclass(frozen=True, eq=False)
class ReportedEffect:
    """A finding, and what is said of it; attributes as in ``diagnosis.json``.

    Attributes:
        in_model: whether ``model.ssv`` has it.
        by_power: whether the share is that of the power of the model error, as of waves.
    """

    id: str
    axis: str
    coefficients: Mapping[str, ReportedCoefficient]
    confidence: float
    share_of_error: float
    indistinguishable: Sequence[str]
    advice: str
    sentence: str
    equation: str
    separation: str
    share_unique: float | None = None
    doubt: str = ""
    in_model: bool = True
    by_power: bool = False

    @property
    def of(self) -> str:
        """What the share is of."""
        return OF_POWER if self.by_power else OF_ERROR


def reported_effects(d: Diagnosis) -> tuple[list[ReportedEffect], list[ReportedEffect]]:
    """The effects that are reported as found, and those that are only possible."""
    found, possible = [], []
    for f, share, unique, stated in zip(d.learned.effects, d.shares, d.unique, d.believed, strict=True):
        fitted = d.start.ship.effects[f.id].search.by == "regression"
        (found if stated else possible).append(_reported(d, f, share, unique, stated or fitted))
    for f in d.dropped:
        fitted = all(is_fitted(d, n) for n in f.values)
        possible.append(_reported(d, _as_fitted(d, f) if fitted else f, f.share, None, fitted))
    return found, possible


def _as_fitted(d: Diagnosis, f: Finding) -> Finding:
    """An effect that was dropped, with the values that the learned model has all the same."""
    values = {n: d.learned.model.value(n) - d.start.value(n) for n in f.values}
    std = d.posterior.std
    return replace(
        f, values=values, ci95={n: interval(x, std[n]) for n, x in values.items() if n in std}
    )


def further_fitted_values(d: Diagnosis) -> list[str]:
    """What a calibrated model has of actuators, measurement and water, in words, a sentence each.

    An angle that matters in no manoeuvre is left out, and what is within its own uncertainty.
    """
    stated, learned, std = [], d.learned.model, d.posterior.std
    nominal = d.start.ship.coefficients
    for effect in d.start.ship.effects.values():
        values = {n: learned.value(n) for n in effect.coefficients if n not in nominal}
        known = any(
            is_fitted(d, n)
            and abs(x) >= max(TIE * std.get(n, 0.0), LEAST if unit(effect, n) == "rad" else 0.0)
            for n, x in values.items()
        )
        if effect.kind != "force" and known:
            stated.append(sentence(Found(effect, values, d.speeds)))
    return stated


def is_fitted(d: Diagnosis, name: str) -> bool:
    """Whether the learned model has another value of a parameter than the initial one."""
    return d.learned.model.value(name) != d.start.value(name)


def within_range(start: Model, name: str, value: float, low: float, high: float) -> tuple[float, float]:
    """The part of an interval about a value in which its parameter may be."""
    lowest, highest = limits(start.declared(name))
    return max(low, min(lowest, value)), min(high, max(highest, value))


def _reported(
    d: Diagnosis, f: Finding, share: float, unique: float | None, in_model: bool
) -> ReportedEffect:
    effects = d.start.ship.effects
    effect = effects[f.id]
    # Of a coefficient the addition counts, of any other parameter of the effect its value.
    own = effect.coefficients
    present = {n: 0.0 if parameter_and_run(n)[0] in own else d.start.value(n) for n in f.values}
    values = {n: x + present[n] for n, x in f.values.items()}
    ci95 = {
        n: within_range(d.start, n, values[n], low + present[n], high + present[n])
        for n, (low, high) in f.ci95.items()
    }
    coefficients = {
        _plain(n, f): ReportedCoefficient(
            x, unit(effect, n), ci95.get(n), parameter_and_run(n)[1] or None
        )
        for n, x in values.items()
    }
    return ReportedEffect(
        f.id,
        effect.axis if effect.axis in AXES else "XYN",
        coefficients,
        f.confidence,
        share,
        list(f.alike),
        advice(f.id, f.alike, effects),
        _sentence(d, f, values),
        equation(effect, _shown(d, values), _shown(d, ci95)),
        separation_note(f.id, f.alike),
        unique,
        f.doubt,
        in_model,
        effect.search.by == "spectrum",
    )


def _plain(name: str, f: Finding) -> str:
    """The name of a value in the files: plain, but of the second run on in which alone it holds."""
    parameter, run = parameter_and_run(name)
    return parameter if run in f.of_runs[:1] else name


def _sentence(d: Diagnosis, f: Finding, values: Mapping[str, float]) -> str:
    """A finding in words; what holds in single runs, one after the other, of the first ones."""

    def stated(own: Mapping[str, float]) -> str:
        return sentence(Found(d.start.ship.effects[f.id], own, d.speeds))

    shown = _shown(d, values)
    runs = [run for run in f.of_runs if shown is values]
    each = [f"Run {run}: {stated(of_one_run(values, run))}" for run in runs[:SHOWN]]
    if more := len(runs[SHOWN:]):
        each.append(f"diagnosis.json has {more} more.")
    said = " ".join(each) or stated(shown)
    return said + of_whole_hull(f, d.start, d.learned.model, d.speeds)


def of_whole_hull(f: Finding, start: Model, learned: Model, speeds: tuple[float, float, float]) -> str:
    """By what the force of the whole hull differs, if a change of one coefficient says something else.

    Other coefficients of the axis are fitted with it, and may take away most of what it adds.

    Args:
        f: the finding.
        start, learned: the initial and the learned model.
        speeds: u, v, r that the ship reached [m/s, m/s, rad/s].
    """
    axis, _, term = f.id.partition("_")
    if start.ship.effects[f.id].wording.sentence is not damping_sentence or f.of_runs:
        return ""
    nu = np.array([[speed if name in term else 0.0 for name, speed in zip("uvr", speeds, strict=True)]])
    own, whole = (
        float((force(model, nu) - force(start, nu))[0, AXES.index(axis)])
        for model in (start.plus(f.values), learned)
    )
    if whole * own > 0.0 and 1.0 / OTHERWISE < whole / own < OTHERWISE:
        return ""
    if abs(whole) < DIGITS * abs(own):  # a finding that is not in the learned model
        return ""
    size = towards(whole, "N m" if axis == "N" else "N", axis)
    return f" With all coefficients that are fitted, the force of the hull there differs by {size}."


def _shown(d: Diagnosis, values: Mapping[str, T]) -> Mapping[str, T]:
    """Values by their names; where there is one run only, without it."""
    if len(d.comparison.evaluations) > 1:
        return values
    return {parameter_and_run(name)[0]: value for name, value in values.items()}
