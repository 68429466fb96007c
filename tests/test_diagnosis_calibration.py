"""A calibrated model: all coefficients at once, by predictions."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.stats import multivariate_normal
from support.measured import sail, smoothed

from diagnosis.predictors import Model, weak_windows
from diagnosis.predictors.shooting import Shooting
from diagnosis.predictors.windows import Windows
from diagnosis.search.candidates import model_error
from diagnosis.search.findings import Finding, Findings
from diagnosis.search.prediction_fit.coefficient_calibration import (
    LEFT_OUT,
    Calibration,
    as_missed,
    begin,
)
from diagnosis.search.prediction_fit.fit import (
    PredictionFit,
    disturbance_of,
    fit_to,
    shootings,
    whitened,
)
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.refit import prediction_bands
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel
from diagnosis.verdict.coefficients import Calibrations
from diagnosis.verdict.validation_data import ValidationData

DRAG = -2.0  # N s/m, hidden
MOMENTS = (0.02, -0.02, 0.01, -0.01)  # N m, of each run, that nobody recorded
STREAM_EAST = 0.04  # m/s
PRIOR = NominalPrior.of(Model())


@cache
def runs(drag=DRAG, east=0.0):
    """Runs of a ship that may have more drag than the model, each turned by a constant of its own.

    The water goes east [m/s].
    """
    ships = [{"delta_X_u": drag, "body_bias_N": own if drag else 0.0, "V_e": east} for own in MOMENTS]
    tracks = [smoothed(sail(h=0.05, seed=k, ship=ship)[0]) for k, ship in enumerate(ships)]
    named = [
        replace(s, track=replace(s.track, run=replace(s.track.run, name=f"run {k}")))
        for k, s in enumerate(tracks)
    ]
    return [weak_windows(s) for s in named]


@cache
def fit():
    at = begin(Model(), PRIOR)
    problem = Calibration(runs(), shootings(runs(), Model(), [1.0]), at, PRIOR)
    return problem, fit_to(problem, at)


class Unscaled(Calibration):
    """The same fit with the disturbance that the model error shows."""

    share = PredictionFit.share


def nothing_found(sigma=1.0):
    return Findings(sigma=np.full(3, sigma), estimate=RefinedModel.at(Model(), PRIOR), searched=PRIOR)


def test_what_a_model_leaves_out_is_zero_give_or_take_its_size():
    at = begin(Model(), PRIOR)
    assert set(at.values.values()) == {0.0}
    std = dict(zip(at.fitted, np.diag(at.precision) ** -0.5, strict=True))
    assert std["delta_N_uv"] == pytest.approx(LEFT_OUT["N_uv"] * Model().unit("delta_N_uv"))
    assert not {n.removeprefix("delta_") for n in std} & set(PRIOR.mean)


@pytest.mark.slow
def test_the_drag_is_found_though_a_moment_that_nobody_recorded_turns_each_run():
    _, fitted = fit()
    model = fitted.estimate.model(PRIOR)
    still = {"delta_X_u": DRAG}
    predicted = Windows([w.smoothed for w in runs()])
    before, after, true = (
        predicted.errors(m).over_all()[0] for m in (Model(), model, Model().plus(still))
    )
    assert after - true < 0.3 * (before - true)
    assert len(fitted.fold_models) == 4


@pytest.mark.slow
def test_the_disturbance_is_scaled_to_what_the_windows_miss():
    """Its share of the information is the mean square of whitened residuals over the expected one."""
    problem, fitted = fit()
    at, (windows,) = fitted.estimate, problem.windows
    plain = Unscaled(runs(), problem.windows, at, PRIOR).information(at)
    share = np.trace(problem.information(at).G) / np.trace(plain.G)
    model = at.model(PRIOR)
    (spread,), around = plain.spreads, problem.around(windows, model)
    W = problem.whitening(windows, spread, around.residuals)
    _, pushes = disturbance_of(runs(), model_error(runs(), model), problem.std)
    expected = np.einsum("wii->", problem.scatter(windows, around, W, pushes))
    assert share == pytest.approx(np.sum(whitened(W, around.residuals) ** 2) / expected, rel=2e-3)


def test_early_errors_count_as_much_as_late_ones():
    """Errors that grow with time and differ between runs leave whitened residuals of one size."""
    windows = Shooting([w.smoothed for w in runs()[:2]], 8.0)
    problem = Calibration(runs()[:2], [windows], begin(Model(), PRIOR), PRIOR)
    size = np.array([1.0, 3.0])[windows.run][:, None, None] * windows.since[:, None]
    squares = (size * [1.0, 1.0, 0.2]) ** 2
    found = problem.missed(windows, squares, np.ones(squares.shape[:2], bool))
    assert squares / found == pytest.approx(np.ones(squares.shape))


@pytest.mark.slow
def test_bands_are_as_wide_as_predictions_of_runs_left_out_are_off():
    """However large a disturbance the residual force shows."""
    problem, fitted = fit()
    model, posterior = fitted.estimate.model(PRIOR), JointPosterior.of(fitted, PRIOR)
    found = as_missed(problem, fitted, model, posterior)
    for times in (0.2, 5.0):
        other = replace(
            fitted, disturbance=replace(fitted.disturbance, size=times * fitted.disturbance.size)
        )
        assert as_missed(problem, other, model, posterior).size == pytest.approx(found.size, rel=1e-6)
    squares = []
    for w, left_out in zip(runs(), fitted.fold_models, strict=True):
        windows = Windows([w])
        bands = prediction_bands(w.smoothed, windows, model, posterior, found)
        V = np.einsum("nii->ni", bands.at_samples)
        squares.append(windows.residuals(left_out) ** 2 / V)
    assert np.concatenate(squares).mean() == pytest.approx(1.0, rel=0.2)


def in_place_of_nothing(data):
    """The calibrated model of some runs in which no effect was found."""
    found = nothing_found()
    decides = ValidationData(data, [], Model(), np.ones(3))
    return Calibrations(found, decides, PRIOR, None).in_place_of(found)


@pytest.mark.slow
def test_it_is_kept_where_runs_left_out_are_predicted_better():
    """Of three runs, the fewest that are left out whole."""
    out = in_place_of_nothing(runs()[:3])
    assert out is not None
    assert not out.findings.effects
    assert out.findings.suspects
    for s in out.findings.suspects:
        assert s.z == out.findings.moved[s.name]
        assert s.value == pytest.approx(out.findings.model.value(s.name))
    assert "vessel.X_u" in out.posterior.names
    assert abs(out.findings.model.value("V_e")) < 1e-3, "still water"


@pytest.mark.slow
@pytest.mark.parametrize("as_well", [True, False])
def test_effects_none_of_which_is_a_finding_give_way_to_what_predicts_as_well(as_well):
    data, nothing = ValidationData(runs()[:3], [], Model(), np.ones(3)), nothing_found()
    calibrations = Calibrations(nothing, data, PRIOR, None)
    known = calibrations.in_place_of(nothing)
    true = [Model().plus({"delta_X_u": DRAG, "body_bias_N": N}) for N in MOMENTS[:3]]
    folds = known.findings.fold_models if as_well else true
    found = Finding("lag", {"lag": 0.1}, {}, 0.0, [], 0.5, 0.5, Model())
    out = calibrations.in_place_of(replace(nothing, effects=[found], fold_models=folds))
    assert out is (known if as_well else None), "it is fitted once"


@pytest.mark.slow
def test_a_current_is_in_the_calibrated_model_where_runs_left_out_show_it():
    out = in_place_of_nothing(runs(east=STREAM_EAST))
    assert out is not None
    water = [out.findings.model.value(n) for n in ("V_n", "V_e")]
    assert water == pytest.approx([0.0, STREAM_EAST], abs=0.15 * STREAM_EAST)


@pytest.mark.slow
def test_nothing_is_calibrated_without_a_remainder_or_of_few_runs():
    assert in_place_of_nothing(runs(0.0)) is None
    assert in_place_of_nothing(runs()[:2]) is None


def test_the_misfit_is_twice_the_negative_log_density_of_the_residuals_of_all_windows():
    """By scipy's normal density, the variance of what the model misses included."""
    windows = Shooting([w.smoothed for w in runs()[:2]], 8.0)
    at = RefinedModel.at(Model(), PRIOR)
    problem = PredictionFit(runs()[:2], [windows], at, PRIOR)
    start, drag = Model(), Model().plus({"delta_X_u": DRAG})
    spread = problem.spread(windows, problem.around(windows, start))

    def density(model):
        r = windows.residuals(model)
        missed = problem.missed(windows, r**2, np.ones(r.shape[:2], bool))
        flat, V = r.reshape(len(r), -1), np.broadcast_to(missed, r.shape).reshape(len(r), -1)
        found = [
            multivariate_normal(cov=S + np.diag(v)).logpdf(x) + 0.5 * x.size * np.log(2.0 * np.pi)
            for x, v, S in zip(flat, V, spread, strict=True)
        ]
        return -2.0 * sum(found)

    for model in (start, drag):
        assert problem.misfit(windows, spread, model) == pytest.approx(density(model), rel=1e-4)
    assert problem.misfit(windows, spread, drag) < problem.misfit(windows, spread, start)
