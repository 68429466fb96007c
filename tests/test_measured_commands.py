"""Commands in a log are orders, or measured values of the actuators, whose mean over a row acts."""

import json
from functools import cache

import numpy as np
import pytest
from support.measured import commands, csv_of, sail, table_of

import diagnosis
from diagnosis import InputError
from diagnosis.runs.files.reading import row_means
from diagnosis.search.significance import Losses
from diagnosis.verdict.measured_commands import are_measured, log_odds

H, ROW = 0.1, 5  # s; steps in a row of the log
SECONDS = 120.0


def orders(t):
    """Commands that are given once a row, and held."""
    return commands(np.floor(t / (ROW * H) + 1e-9) * ROW * H)


@cache
def logged(given, seed):
    """A run of a ship with these commands, in rows of half a second."""
    run, _ = sail(SECONDS, H, given=given, seed=seed)
    return table_of(run).iloc[::ROW].reset_index(drop=True)


def session(given):
    """The session of two runs with these commands."""
    return diagnosis.begin(diagnosis.load([logged(given, 1), logged(given, 2)]))


def test_samples_are_their_mean_from_row_to_row_whatever_the_order_of_the_rows():
    time = np.array([0.0, 1.0, 3.0, 2.0])
    found = row_means(np.array([1.0, 3.0, 0.0, 7.0]), time)
    np.testing.assert_allclose(found, [2.0, 5.0, 0.0, 3.5])


def test_rows_without_a_time_of_their_own_stay():
    time = np.array([0.0, 1.0, 1.0, np.nan])
    found = row_means(np.array([1.0, 3.0, 9.0, 4.0]), time)
    np.testing.assert_allclose(found, [2.0, 3.0, 9.0, 4.0])


def test_an_angle_takes_the_shorter_way_and_a_missing_sample_changes_no_other():
    angle = np.radians([170.0, -170.0, np.nan, 10.0])
    found = np.degrees(row_means(angle, np.arange(4.0), angle=True))
    np.testing.assert_allclose(found, [180.0, -170.0, np.nan, 10.0])


def test_rows_that_are_filled_in_are_on_the_line_between_samples():
    """Of finer rows the means are those of the line, so that their mean is that of the whole row."""
    time, fine = np.arange(4.0), np.arange(0.0, 3.01, 0.25)
    values = np.array([1.0, 3.0, -2.0, 5.0])
    held = values[(fine + 1e-9).astype(int)]
    found = row_means(held, fine, sampled=np.isin(fine, time))
    np.testing.assert_allclose(found[:-1], np.interp(fine[:-1] + 0.125, time, values))
    np.testing.assert_allclose(found[:-1].reshape(3, 4).mean(axis=1), row_means(values, time)[:-1])


@pytest.mark.parametrize("measured", [True, False])
def test_a_side_car_states_that_a_command_is_measured(measured, tmp_path):
    path = csv_of(sail(10.0, H)[0], tmp_path / "a.csv")
    given = diagnosis.read(path).tau_cmd
    columns = {"tau_X": {"name": "tau_X", "measured": measured}}
    path.with_name("a.csv.json").write_text(json.dumps({"columns": columns}))
    found = diagnosis.read(path).tau_cmd
    means = 0.5 * (given[:-1, 0] + given[1:, 0])
    np.testing.assert_allclose(found[:-1, 0], means if measured else given[:-1, 0])
    np.testing.assert_array_equal(found[:, 1:], given[:, 1:])


def test_a_pose_is_no_order(tmp_path):
    path = csv_of(sail(10.0, H)[0], tmp_path / "a.csv")
    columns = {"x": {"name": "x", "measured": True}}
    path.with_name("a.csv.json").write_text(json.dumps({"columns": columns}))
    with pytest.raises(InputError, match=r"x\.measured: only a command can be"):
        diagnosis.read(path)


def test_commands_are_what_predicts_better():
    """Samples of a motion's own commands are found so, and orders stay."""
    for given, measured in ((commands, True), (orders, False)):
        task = session(given)
        found = task.with_likelier_commands()
        assert (found is not task) == measured
        assert found.calibrate().measured is measured
        assert not task.calibrate().measured


@pytest.mark.parametrize(
    ("initial", "calibrated", "taken"),
    [(0.9, 0.7, True), (0.7, 0.9, True), (1.1, 0.7, False), (0.7, 1.1, False), (0.9, 0.9, False)],
)
def test_both_models_have_to_predict_better_and_one_by_odds_of_twenty(initial, calibrated, taken):
    """By a change of all mean squares in nine windows: a tenth is 4 : 1, three tenths are 120 : 1."""
    one = Losses(np.ones(1), np.ones(9), np.ones(9))
    others = [
        one._replace(position=x * one.position, heading=x * one.heading) for x in (initial, calibrated)
    ]
    assert are_measured([one, one], others) is taken


def test_the_odds_are_a_ratio_of_likelihoods():
    """Of normal errors with an unknown standard deviation: (mean square)^(-n/2) for each component."""
    rng = np.random.default_rng(3)
    a, b = (Losses(np.ones(1), *rng.uniform(1.0, 2.0, (2, 9))) for _ in range(2))

    def likelihood(loss):
        return np.mean(loss.position) ** -9.0 * np.mean(loss.heading) ** -4.5

    assert log_odds(a, b) == pytest.approx(np.log(likelihood(b) / likelihood(a)))
    assert log_odds(a, b) == pytest.approx(-log_odds(b, a))
    lost = b._replace(position=np.full(9, np.inf))
    assert np.isfinite(log_odds(a, lost))
