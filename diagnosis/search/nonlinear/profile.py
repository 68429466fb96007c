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
from scipy.linalg import block_diag
from scipy.optimize import brentq, minimize_scalar

from ...predictors.ship_model import parameter_and_run
from ..conclusion import AcceptedEffect
from ..refinement import (
    SMALLEST_SCALE,
    Estimate,
    Refined,
    Start,
    TrainingSet,
    bounded,
    nuisance_of,
    refine,
    slope,
)
from .segmentation import LIKELY

COARSER = 30.0  # times the step of a slope, with which it is compared: 3 % of the parameter
ROUGH = 0.5  # share of itself by which a slope that means something differs between the two steps
REACH = 1.5  # factor to both sides within which the best value is looked for
TRIALS = 16  # of that search, at the most
FINEST = 1e-4  # of REACH, to which the ends of an interval are found

Interval = tuple[float, float]


def profiled(t: TrainingSet, at: Estimate, p: AcceptedEffect) -> tuple[Estimate, dict[str, Interval]]:
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
    found: Any = minimize_scalar(
        lambda x: trial(x).cost, bounds=ends, method="bounded", options={"maxiter": TRIALS}
    )
    best = min((trial(present), trial(float(found.x))), key=lambda r: r.cost)
    value = best.estimate.values[name]
    start = at.start.value(name)
    size = max(abs(start + value), SMALLEST_SCALE * at.start.unit(name))
    present = start + value
    low, high = (_end(trial, best.cost, present, present + k * REACH * size) for k in (-1.0, 1.0))
    own = [at.fitted.index(n) for n in p.names if n in at.fitted and n != name]
    precision = np.asarray(block_diag(best.estimate.precision, at.precision[own][:, own]))
    last = replace(best.estimate, precision=precision, held=at.held | {name})
    return last, {name: (low - start, high - start)}


def is_rough(t: TrainingSet, at: Estimate, name: str) -> bool:
    """Whether a slope by a parameter depends on its step, so that it is none."""
    parameter, run = parameter_and_run(name)
    effects = at.start.ship.effects.values()
    effect = next(e for e in effects if parameter in {q.name for q in e.parameters})
    if run or effect.linear or effect.search.smooth:
        return False
    model, left = at.model(t.prior), t.error(at)
    size = max(abs(at.start.value(name) + at.values[name]), SMALLEST_SCALE * model.unit(name))
    fine = slope(t, model, left, name, size)
    coarse = slope(t, model, left, name, COARSER * size)
    return float(np.linalg.norm(fine - coarse)) > ROUGH * float(np.linalg.norm(coarse))


def _profile(t: TrainingSet, at: Estimate, p: AcceptedEffect, name: str) -> Callable[[float], Refined]:
    """The model with a parameter held at a value, all else fitted anew."""
    beside = at.without(p.names)
    nuisance = nuisance_of(t, beside, t.error(beside))
    others = [n for n in p.names if n != name]

    @cache
    def trial(value: float) -> Refined:
        held = bounded(at.start, name, value - at.start.value(name))
        values: Mapping[str, float] = {**{n: at.values[n] for n in p.names}, name: held}
        return refine(t, beside, nuisance, Start(values, others, np.zeros((len(others), len(others)))))

    return trial


def _end(trial: Callable[[float], Refined], least: float, value: float, end: float) -> float:
    """Where the cost passes its least by LIKELY between a value and an end; the end if nowhere."""

    def beyond(x: float) -> float:
        return trial(x).cost - least - LIKELY

    if beyond(end) <= 0.0:
        return end
    return float(brentq(beyond, value, end, xtol=FINEST * abs(end - value)))  # pyright: ignore
