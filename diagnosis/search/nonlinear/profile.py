"""Intervals of parameters in which an effect is not smooth, such as the radius of a circle of force.

A slope by such a parameter depends on its step, so that neither Gauss-Newton steps nor the curvature of
the cost mean anything. Of a single one the profile of the cost, all else fitted anew at each value, has
the best value and the interval (W. Q. Meeker, L. A. Escobar, Teaching about approximate confidence
regions based on maximum likelihood estimation, The American Statistician 49, 1995). Of several there is
none.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from ...predictors.ship_model import parameter_and_run
from ...runs.cleaning import Z95
from ..candidates import SMALL, model_error
from ..conclusion import AcceptedEffect
from ..refinement import (
    CandidateStart,
    Refined,
    RefinedModel,
    TrainingSet,
    bounded,
    nuisance_of,
    refine,
    slope,
)

REACH = 1.5  # 1, factor to both sides within which the best value is looked for; chosen

Interval = tuple[float, float]


def profiled(
    t: TrainingSet, at: RefinedModel, p: AcceptedEffect
) -> tuple[RefinedModel, dict[str, Interval]]:
    """The most likely model by profiles of an effect's rough parameters, and their intervals.

    Args:
        t: what is fitted to.
        at: the most likely model so far.
        p: the effect.

    Returns:
        The model, and the interval of each rough parameter; NaN of several.
    """
    rough = [n for n in p.names if is_rough(t, at, n)]
    if len(rough) != 1:
        return at.holding(rough), dict.fromkeys(rough, (np.nan, np.nan))
    (name,) = rough
    trial = _profile(t, at, p, name)
    present = at.start.value(name) + at.values[name]
    ends = sorted((present / REACH, present * REACH))
    finest = {"xatol": SMALL * (ends[1] - ends[0])}
    found: Any = minimize_scalar(lambda x: trial(x).cost, bounds=ends, method="bounded", options=finest)
    best = min((trial(present), trial(float(found.x))), key=lambda r: r.cost)
    start = at.start.value(name)
    present = start + best.estimate.values[name]
    size = REACH * max(abs(present), SMALL * at.start.unit(name))
    low, high = (_end(trial, best.cost, present, present + k * size) for k in (-1.0, 1.0))
    own = [at.fitted.index(n) for n in p.names if n in at.fitted and n != name]
    last = replace(best.estimate.fitting(at.precision[own][:, own]), held=at.held | {name})
    return last, {name: (low - start, high - start)}


def is_rough(t: TrainingSet, at: RefinedModel, name: str) -> bool:
    """Whether slopes by a parameter to both sides differ by more than half, so that they are none."""
    parameter, run = parameter_and_run(name)
    effects = at.start.ship.effects.values()
    effect = next(e for e in effects if parameter in {q.name for q in e.parameters})
    if run or effect.linear or effect.search.smooth:
        return False
    model, left = at.model(t.prior), t.error(at)
    size = max(abs(at.start.value(name) + at.values[name]), SMALL * model.unit(name))
    below = model.plus({name: -SMALL * size})
    sides = slope(t, model, left, name, size), slope(t, below, model_error(t.data, below), name, size)
    return bool(np.linalg.norm(sides[0] - sides[1]) > np.linalg.norm(sides[1]) / 2.0)


def _profile(
    t: TrainingSet, at: RefinedModel, p: AcceptedEffect, name: str
) -> Callable[[float], Refined]:
    """The model with a parameter held at a value, all else fitted anew."""
    beside = at.without(p.names)
    nuisance = nuisance_of(t, beside, t.error(beside))
    others = [n for n in p.names if n != name]

    @cache
    def trial(value: float) -> Refined:
        held = bounded(at.start, name, value - at.start.value(name))
        values: Mapping[str, float] = {**{n: at.values[n] for n in p.names}, name: held}
        return refine(
            t, beside, nuisance, CandidateStart(values, others, np.zeros((len(others), len(others))))
        )

    return trial


def _end(trial: Callable[[float], Refined], least: float, value: float, end: float) -> float:
    """Where the cost rises by Z95**2 between a value and an end; the end if nowhere."""

    def beyond(x: float) -> float:
        return trial(x).cost - least - Z95**2

    if beyond(end) <= 0.0:
        return end
    return float(brentq(beyond, value, end, xtol=SMALL * abs(end - value)))  # pyright: ignore
