"""Commands that are logged behind a low-pass filter: undone, predicted with, and found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from support.measured import jumps, sail, smoothed

from diagnosis import Model, diagnose
from diagnosis.predictors import ship_with
from diagnosis.predictors.thrust import before_low_pass, commanded_shares
from diagnosis.predictors.weak_form import omega, weak_windows

LAG = 0.8  # s


def logged(given, h, lag=LAG):
    """Commands (n, k) as a filter gives them, row by row."""
    kept = np.exp(-h / lag)
    return given[0] + lfilter([1.0 - kept], [1.0, -kept], given - given[0], axis=0)


def filtered(run, lag=LAG):
    """A run whose commands were logged behind a filter."""
    return run.with_given(logged(run.given, float(np.median(np.diff(run.time))), lag))


@pytest.mark.parametrize("lag", [0.05, 0.4, 3.0])
def test_a_filter_of_the_commands_is_undone_exactly(lag):
    run = sail(30.0, 0.1)[0]
    undone = before_low_pass(filtered(run, lag), Model(measurement={"command_lag": lag}))
    np.testing.assert_allclose(undone, run.given, atol=1e-12)


def test_an_angle_that_goes_round_is_filtered_the_shorter_way():
    """Of a thruster that turns on through 180 degrees in steps, logged between -180 and 180 degrees."""
    ship, run = ship_with((), "gunnerus"), sail(30.0, 0.1)[0]
    turning = 0.5 * np.floor(np.arange(run.time.size) / 7.0)
    behind = logged(np.column_stack([turning, 1.0 + 0.2 * np.sin(turning)]), 0.1)
    wrapped = np.column_stack([(behind[:, 0] + np.pi) % (2.0 * np.pi) - np.pi, behind[:, 1]])
    of = replace(run, commands=wrapped, ship=ship.description)
    undone = before_low_pass(of, Model(measurement={"command_lag": LAG}, ship=ship))
    np.testing.assert_allclose(np.exp(1j * undone[:, 0]), np.exp(1j * turning), atol=1e-9)
    np.testing.assert_allclose(undone[:, 1], 1.0 + 0.2 * np.sin(turning), atol=1e-9)


def test_a_model_with_the_filter_has_the_error_of_the_run_before_it():
    """In weak form; the smoothed motion is the same, as its commands are those of the run."""
    run = sail(60.0, 0.1)[0]
    s = smoothed(run)
    behind = replace(s, track=replace(s.track, run=filtered(run)))
    own, other = (weak_windows(each) for each in (s, behind))
    expected = omega(own, Model())
    found = omega(other, Model(measurement={"command_lag": LAG}))
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(omega(other, Model()) - expected).max() > 0.05 * np.abs(run.tau_cmd).max()
    same = commanded_shares(filtered(run), Model(measurement={"command_lag": LAG}))
    np.testing.assert_allclose(same, commanded_shares(run, Model()), atol=1e-9)


@pytest.mark.slow
def test_a_filter_of_the_commands_is_found():
    """With a drag beside it, and commands that jump."""
    run = sail(120.0, 0.1, ship={"delta_X_u": -2.0}, given=jumps)[0]
    found = {e.id: e for e in diagnose([weak_windows(smoothed(filtered(run)))]).content.effects}
    assert {*found} == {"command_lag", "X_u"}
    assert found["command_lag"].coefficients["command_lag"].value == pytest.approx(LAG, rel=0.05)
    assert found["command_lag"].confidence >= 0.8


@pytest.mark.slow
@pytest.mark.parametrize("hidden", ["none", "lag"])
def test_no_filter_is_found_where_none_is(hidden):
    """Thrusters that lag are its opposite."""
    run = sail(120.0, 0.1, thrusters={"lag": 0.5} if hidden == "lag" else {}, given=jumps)[0]
    found = diagnose([weak_windows(smoothed(run))]).content.effects
    assert {e.id for e in found} == {hidden} - {"none"}
