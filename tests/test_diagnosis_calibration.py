"""A calibrated model: all coefficients at once, by predictions, each run with constants of its own."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.measured import sail, smoothed

from diagnosis.predictors import Model, weak_windows
from diagnosis.predictors.windows import Windows
from diagnosis.search.findings import Findings
from diagnosis.search.prediction_fit.coefficient_calibration import (
    AXIS,
    CONSTANTS,
    LEFT_OUT,
    Calibration,
    Calibrator,
    begin,
)
from diagnosis.search.prediction_fit.fit import fit_to, shootings
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel
from diagnosis.verdict.coefficients import calibrated, calibrations
from diagnosis.verdict.validation_data import ValidationData

DRAG = -2.0  # N s/m, hidden
MOMENTS = (0.02, -0.02, 0.01, -0.01)  # N m, of each run, that nobody recorded
STREAM_EAST = 0.04  # m/s
SHARED = 0.03  # N m, of all runs
PRIOR = NominalPrior.of(Model())


@cache
def runs(drag=DRAG, east=0.0, axis=0.0, moment=0.0):
    """Runs of a ship that may have more drag than the model, each turned by a constant of its own.

    The water goes east [m/s]; the heading is measured about an axis that is off by an angle [rad].
    One more moment [N m] turns all.
    """
    ships = [
        {"delta_X_u": drag, "body_bias_N": moment + (own if drag else 0.0), "V_e": east}
        for own in MOMENTS
    ]
    if axis:
        ships = [ship | {"heading_offset": axis} for ship in ships]
    tracks = [smoothed(sail(seed=k, ship=ship)[0]) for k, ship in enumerate(ships)]
    named = [
        replace(s, track=replace(s.track, run=replace(s.track.run, name=f"run {k}")))
        for k, s in enumerate(tracks)
    ]
    return [weak_windows(s) for s in named]


@cache
def fit():
    at = begin(Model(), PRIOR)
    problem = Calibration(runs(), shootings(runs(), [1.0]), at, PRIOR)
    return problem, fit_to(problem, at)


def nothing_found(sigma=1.0):
    return Findings(sigma=np.full(3, sigma), estimate=RefinedModel.at(Model(), PRIOR), searched=PRIOR)


def test_what_a_model_leaves_out_is_zero_give_or_take_its_size():
    at = begin(Model(), PRIOR)
    assert set(at.values.values()) == {0.0}
    std = dict(zip(at.fitted, np.diag(at.precision) ** -0.5, strict=True))
    assert std["delta_N_uv"] == pytest.approx(LEFT_OUT["N_uv"] * Model().unit("delta_N_uv"))
    assert not {n.removeprefix("delta_") for n in std} & set(PRIOR.mean)


@pytest.mark.slow
def test_the_drag_is_found_beside_constants_of_each_run():
    _, fitted = fit()
    model = fitted.estimate.model(PRIOR)
    still = {"delta_X_u": DRAG}
    predicted = Windows([w.smoothed for w in runs()])
    before, after, true = (
        predicted.errors(m).over_all()[0] for m in (Model(), model, Model().plus(still))
    )
    assert after - true < 0.3 * (before - true)
    assert [model.value(n) for n in CONSTANTS] == [0.0, 0.0]
    assert len(fitted.fold_models) == 4


def tried(found):
    """Calibrations of some runs, judged by each run without it."""
    data = ValidationData(found, [], Model(), np.ones(3))
    return calibrations(Calibrator(nothing_found(), found, Model(), PRIOR), data)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "value", "ship"),
    [("heading_offset", AXIS, {"axis": AXIS}), ("body_bias_N", SHARED, {"moment": SHARED})],
)
def test_what_several_runs_share_is_calibrated(name, value, ship):
    """Constants of all runs would stand for it, and a run that is not known has none."""
    found = runs(0.0, **ship)
    fits = tried(found[:3])
    values = [c.findings.model.value(name) for c in fits]
    assert values == pytest.approx([0.0, value], abs=0.1 * abs(value))
    unseen = Windows([found[3].smoothed])
    alone, best = (np.ravel(unseen.errors(c.findings.model).over_all())[0] for c in fits)
    assert best < 0.5 * alone
    few = tried(found[:2])
    assert few.best is few.alone


@pytest.mark.slow
def test_what_runs_do_not_share_is_not_calibrated():
    """Each run has a moment of its own, and their mean predicts a run without it no better."""
    found = tried(runs()[:3])
    assert found.best is found.alone


@pytest.mark.slow
def test_a_constant_of_a_run_costs_less_than_what_it_does():
    problem, fitted = fit()
    known = problem.information(fitted.estimate)
    model = fitted.estimate.model(PRIOR).plus({"body_bias_N": 0.01})
    with_constants = problem.squares(0, known.weights[0], model)
    without = super(Calibration, problem).squares(0, known.weights[0], model)
    assert with_constants < 0.9 * without


@pytest.mark.slow
def test_it_is_kept_where_runs_left_out_are_predicted_better():
    """Of three runs, the fewest that are left out whole."""
    out = calibrated(nothing_found(), ValidationData(runs()[:3], [], Model(), np.ones(3)), PRIOR)
    assert out is not None
    assert not out.findings.effects
    assert not out.findings.suspects
    assert "vessel.X_u" in out.posterior.names
    assert abs(out.findings.model.value("V_e")) < 1e-3, "still water"


@pytest.mark.slow
def test_a_current_is_in_the_calibrated_model_where_runs_left_out_show_it():
    out = calibrated(
        nothing_found(), ValidationData(runs(east=STREAM_EAST), [], Model(), np.ones(3)), PRIOR
    )
    assert out is not None
    water = [out.findings.model.value(n) for n in ("V_n", "V_e")]
    assert water == pytest.approx([0.0, STREAM_EAST], abs=0.15 * STREAM_EAST)


@pytest.mark.slow
def test_nothing_is_calibrated_without_a_remainder_or_of_few_runs():
    assert calibrated(nothing_found(), ValidationData(runs(0.0), [], Model(), np.ones(3)), PRIOR) is None
    assert (
        calibrated(nothing_found(), ValidationData(runs()[:2], [], Model(), np.ones(3)), PRIOR) is None
    )
