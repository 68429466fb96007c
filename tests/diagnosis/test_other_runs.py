"""Values of single runs as what is known of other runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import ttest_1samp
from support.planted import voyages

from diagnosis import Model
from diagnosis.predictors.parameter_set import read_model, write_model
from diagnosis.predictors.ship_model import of_run
from diagnosis.runs.run_constants import CHANCE
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.other_runs import has_a_side, shrunk_mean, with_other_runs
from diagnosis.session import begin

FOULED = {of_run("delta_X_absu_u", f"run{k}"): x for k, x in enumerate((-2.0, -3.0, -4.0))}
CURRENTS = {of_run("V_n", f"run{k}"): x for k, x in enumerate((0.1, 0.1, 0.2))}
FAILURES = {of_run("bow_outage_start_1", f"run{k}"): x for k, x in enumerate((10.0, 40.0))}


def test_what_all_runs_have_is_their_mean_and_what_has_no_side_is_nothing():
    assert shrunk_mean(np.array([0.3, 0.3])) == pytest.approx(0.3)
    assert shrunk_mean(np.array([0.3, -0.3])) == 0.0
    values = np.array([1.0, 2.0, 3.0])
    assert 0.0 < shrunk_mean(values) < 2.0
    assert shrunk_mean(-5.0 * values) == pytest.approx(-5.0 * shrunk_mean(values))


@pytest.mark.parametrize("common", [0.0, 1.0, 3.0])
def test_other_runs_are_predicted_nearly_as_well_as_by_the_better_of_mean_and_nothing(common):
    """In the mean over ships whose runs differ with a standard deviation of 1."""
    rng = np.random.default_rng(0)
    drawn = rng.normal(common, 1.0, (4000, 4))
    of_runs, other = drawn[:, :3], drawn[:, 3]
    found = np.mean([(o - shrunk_mean(v)) ** 2 for v, o in zip(of_runs, other, strict=True)])
    by_mean, by_nothing = np.mean((other - of_runs.mean(axis=1)) ** 2), np.mean(other**2)
    assert found < 1.2 * min(by_mean, by_nothing)
    assert found < max(by_mean, by_nothing)


def test_runs_with_values_keep_them_and_others_have_the_mean_with_a_variance_that_covers_them():
    before = Model().plus(FOULED)
    nothing = JointPosterior([], [], np.zeros(0), np.zeros((0, 0)))
    after, posterior = with_other_runs(before, nothing)
    for k in range(3):
        assert after.during(f"run{k}").vessel == before.during(f"run{k}").vessel
    mean = shrunk_mean(np.array([-2.0, -3.0, -4.0]))
    assert after.during("another").value("delta_X_absu_u") == pytest.approx(mean)
    assert posterior.names == ["vessel.delta_X_absu_u"]
    assert posterior.units == ["N.s2/m2"]
    assert posterior.mean == pytest.approx([mean])
    expected = sum((x - mean) ** 2 for x in (-2.0, -3.0, -4.0)) / 2.0
    assert posterior.covariance == pytest.approx(np.array([[expected]]))


def test_a_value_that_was_fitted_already_keeps_its_covariance():
    before = Model(vessel={"delta_X_absu_u": -1.0}).plus(FOULED)
    covariance = np.array([[1.0, 0.5], [0.5, 2.0]])
    known = JointPosterior(
        ["vessel.m", "vessel.delta_X_absu_u"], ["kg", "N.s2/m2"], np.array([14.0, -1.0]), covariance
    )
    after, posterior = with_other_runs(before, known)
    mean = -1.0 + shrunk_mean(np.array([-2.0, -3.0, -4.0]))
    assert posterior.mean == pytest.approx([14.0, mean])
    assert after.value("delta_X_absu_u") == pytest.approx(mean)
    added = posterior.covariance - covariance
    assert added[1, 1] > 0.5
    assert np.count_nonzero(added) == 1
    assert np.array_equal(known.covariance, [[1.0, 0.5], [0.5, 2.0]]), "the given one stays"


def test_weather_has_no_usual_side_but_may_come_and_a_failure_is_of_its_run():
    nothing = JointPosterior([], [], np.zeros(0), np.zeros((0, 0)))
    after, posterior = with_other_runs(Model().plus(CURRENTS), nothing)
    assert after.value("V_n") == 0.0
    assert posterior.std["V_n"] == pytest.approx(np.sqrt(0.06 / 2.0))
    failed = Model().plus(FAILURES)
    after, posterior = with_other_runs(failed, nothing)
    assert posterior.names == []
    assert np.isnan(after.value("bow_outage_start_1")) == np.isnan(failed.value("bow_outage_start_1"))
    assert after.during("another") is after


def test_one_run_says_nothing_of_others():
    one = Model().plus({of_run("mass", "run0"): 1.0})
    nothing = JointPosterior([], [], np.zeros(0), np.zeros((0, 0)))
    after, posterior = with_other_runs(one, nothing)
    assert after.value("mass") == one.value("mass")
    assert posterior.names == []


def test_the_file_has_the_mean_for_any_run_and_times_of_the_first(tmp_path):
    nothing = JointPosterior([], [], np.zeros(0), np.zeros((0, 0)))
    model, _ = with_other_runs(Model().plus(FOULED | CURRENTS | FAILURES), nothing)
    write_model(tmp_path / "model.ssv", model)
    found = read_model(tmp_path / "model.ssv")
    assert found.runs == model.runs
    assert found.value("delta_X_absu_u") == model.value("delta_X_absu_u")
    text = (
        (tmp_path / "model.ssv")
        .read_text()
        .partition("<ssv:Parameters")[2]
        .partition("</ssv:Parameters")[0]
    )
    assert "bow_outage_start_1" in text
    assert "V_n" not in text


@pytest.mark.slow
def test_a_test_run_is_predicted_with_the_mean_of_the_runs_before():
    """Fouling that differs from run to run: the runs keep their own values, the other one has the mean."""
    fouling = (-3.0, -9.0, -6.0)  # N s2/m2
    every = [voyages(k + 1, 60.0, ship={"delta_X_absu_u": x})[k] for k, x in enumerate(fouling)]
    d = begin(every[:2], every[2:], 0.02).diagnose()
    assert [f.id for f in d.learned.effects] == ["X_|u|u"]
    model = d.learned.model
    for run, x in zip(("run0", "run1"), fouling, strict=False):
        assert model.during(run).value("delta_X_absu_u") == pytest.approx(x, abs=0.8)
    own = [model.during(run).value("delta_X_absu_u") for run in ("run0", "run1")]
    assert model.value("delta_X_absu_u") == pytest.approx(shrunk_mean(np.array(own)))
    name = "vessel.delta_X_absu_u"
    k = d.posterior.names.index(name)
    assert np.sqrt(d.posterior.covariance[k, k]) > 2.0
    test = d.comparison.evaluations[-1]
    assert test.after.position < 0.6 * test.before.position


@given(st.lists(st.floats(-1.0, 1.0).map(lambda x: round(x, 3)), min_size=2, max_size=8, unique=True))
def test_values_have_a_side_by_student_s_t(values):
    assert has_a_side(np.array(values)) == (ttest_1samp(values, 0.0).pvalue < CHANCE)


def test_weather_that_is_alike_in_all_runs_is_expected_in_others():
    alike = {of_run("V_e", f"run{k}"): x for k, x in enumerate((0.19, 0.21, 0.22, 0.22, 0.21))}
    after, _ = with_other_runs(Model().plus(alike), JointPosterior.nothing())
    assert after.value("V_e") == pytest.approx(0.21, abs=0.001)
