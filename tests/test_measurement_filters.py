"""Channels that are measured behind a low-pass filter: predicted as filtered, undone, and found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from support.measured import sail, smoothed

from diagnosis import Model, Windows, diagnose
from diagnosis.predictors.prediction import filtered, true_motion
from diagnosis.predictors.shooting import Shooting
from diagnosis.predictors.weak_form import HORIZON, weak_windows

LAGS = {"position_lag": 0.7, "heading_lag": 0.4}
BEHIND = Model(measurement=LAGS)


def behind_filters(run, position_lag=0.0, heading_lag=0.0):
    """A run with channels behind filters of first order, sample by sample, as an instrument has them."""
    pose, h = np.array(run.pose), float(np.median(np.diff(run.time)))
    pose[:, 2] = np.unwrap(pose[:, 2])
    for k, lag in enumerate((position_lag, position_lag, heading_lag)):
        if lag:
            kept = np.exp(-h / lag)
            pose[:, k] = pose[0, k] + lfilter([1.0 - kept], [1.0, -kept], pose[:, k] - pose[0, k])
    return replace(run, pose=pose)


def test_a_filter_gives_the_response_to_a_ramp_and_comes_to_its_lag():
    """y = s (t - T (1 - exp(-t/T))) for y' = (s t - y)/T, y(0) = 0."""
    shooting = Shooting([smoothed(sail(40.0)[0])], HORIZON)
    first, h = shooting.starts.first(lambda s: s.eta), 0.3
    t = h * np.arange(40.0)
    poses = first[None, :, None] + 0.2 * t[:, None, None, None]
    found = filtered(poses, BEHIND, shooting.starts, h) - first[None, :, None]
    for k, lag in enumerate(BEHIND.lags):
        expected = 0.2 * (t - lag * (1.0 - np.exp(-t / lag)))
        np.testing.assert_allclose(found[:, k, 0, 0], expected, atol=1e-12)
        assert found[-1, k, 0, 0] == pytest.approx(0.2 * (t[-1] - lag), rel=1e-6)


def test_the_motion_behind_a_filter_is_that_before_it():
    """A sine through (1 + T s)^-1 has the gain cos(a) and the lag a = atan(w T): both are undone."""
    t, w = np.linspace(0.0, 30.0, 200), 0.5
    eta, eta_dot, eta_ddot = [], [], []
    for lag in BEHIND.lags:
        a = np.arctan(w * lag)
        eta.append(np.cos(a) * np.sin(w * t - a))
        eta_dot.append(w * np.cos(a) * np.cos(w * t - a))
        eta_ddot.append(-(w**2) * np.cos(a) * np.sin(w * t - a))
    (x, y, psi), (u, v, r) = true_motion(eta, eta_dot, eta_ddot, BEHIND)
    for true in (x, y, psi):
        np.testing.assert_allclose(true[0], np.sin(w * t), atol=1e-12)
    speed = w * np.cos(w * t)
    np.testing.assert_allclose(r[0], speed, atol=1e-6)
    np.testing.assert_allclose(np.hypot(u, v)[0], np.sqrt(2.0) * np.abs(speed), atol=1e-6)


def test_a_model_with_the_filters_predicts_what_they_give():
    run = behind_filters(sail(noise=0.0)[0], **LAGS)
    windows = Windows([smoothed(run)])
    without, within = (windows.errors(m).over_all() for m in (Model(), BEHIND))
    assert without[0] > 0.02
    assert within[0] < 0.1 * without[0]
    assert within[1] < 0.1 * without[1]


def test_models_that_differ_in_their_filters_are_predicted_each_by_its_own():
    windows = Windows([smoothed(sail(40.0)[0])])
    models = [Model(), BEHIND, Model({"delta_X_u": -1.0}, measurement=LAGS)]
    for found, model in zip(windows.residuals_of_each(models), models, strict=True):
        np.testing.assert_allclose(found, windows.residuals(model), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(("channel", "lag"), [("heading_lag", 1.0), ("position_lag", 0.5)])
def test_a_filter_is_found_in_addition_to_the_hidden_effect(channel, lag):
    """A filter that is computed once a sample lags half a sample less than its time constant."""
    h, hidden = 0.1, {"delta_X_u": -2.0}
    made = [sail(120.0, h=h, ship=hidden, seed=seed)[0] for seed in (1, 2)]
    runs = [weak_windows(smoothed(behind_filters(run, **{channel: lag}))) for run in made]
    found = {e.id: e for e in diagnose(runs).content.effects}
    assert {*found} == {channel, "X_u"}
    assert found["X_u"].confidence > 0.9
    assert found[channel].confidence >= 0.5
    assert found[channel].coefficients[channel].value == pytest.approx(lag - h / 2.0, rel=0.1)
    assert found["X_u"].coefficients["delta_X_u"].value == pytest.approx(-2.0, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("thrusters", [{"lag": 0.5}, {"delay": 0.4}])
def test_no_filter_is_found_where_none_is(thrusters):
    """Thrusters that lag are its opposite: the force is late, and not the measurement."""
    made = [sail(120.0, h=0.1, thrusters=thrusters, seed=seed)[0] for seed in (1, 2)]
    found = {e.id for e in diagnose([weak_windows(smoothed(run)) for run in made]).content.effects}
    assert found == {*thrusters}
