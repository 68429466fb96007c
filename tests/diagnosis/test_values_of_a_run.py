"""Values that hold in one run alone, such as the current of its day."""

from types import SimpleNamespace

import numpy as np
import pytest
from support.planted import voyages

from diagnosis import Model
from diagnosis.predictors import omega
from diagnosis.predictors.parameter_set import read_model, write_model
from diagnosis.predictors.ship_model import of_run, parameter_and_run
from diagnosis.predictors.shooting import Shooting
from diagnosis.search.candidates import candidate, changed_error, model_error
from diagnosis.search.forward_selection import ForwardSelection, better_with_one_value
from diagnosis.search.map_regression import Scored
from diagnosis.search.shortlist import of_one_value

NORTH, WEST = {"V_n": 0.06}, {"V_e": -0.06}  # m/s
START = Model()


def runs(*currents):
    """Runs of 60 s, each in a current of its own."""
    return [voyages(k + 1, 60.0, ship=current)[k] for k, current in enumerate(currents)]


@pytest.fixture(scope="module")
def data():
    return runs(NORTH, WEST)


OF_DAYS = {
    of_run("V_n", "run0"): 0.06,
    of_run("V_e", "run1"): -0.06,
    of_run("loss_bow", "run1"): 0.2,
    of_run("mass", "run0"): 1.0,
    of_run("marker_offset_dx", "run1"): 0.05,
}


def test_a_value_of_a_run_is_that_of_its_part_of_the_ship_in_that_run_alone():
    model = Model(vessel={"V_n": 0.01}).plus(OF_DAYS)
    assert model.during("run0").vessel == {"V_n": pytest.approx(0.07), "mass": 1.0}
    assert model.during("run1").vessel == {"V_n": 0.01, "V_e": -0.06, "marker_offset_dx": 0.05}
    assert model.during("run1").thrusters == {"loss_bow": 0.2}
    assert model.during("another") is model
    assert model.value(of_run("V_n", "run1")) == model.value("V_n") == 0.01


def test_a_model_with_values_of_runs_is_read_as_it_was_written(tmp_path):
    model = Model(vessel={"V_e": 0.02}).plus(OF_DAYS)
    write_model(tmp_path / "model.ssv", model)
    found = read_model(tmp_path / "model.ssv")
    assert found.runs == model.runs
    assert found.vessel == model.vessel


def test_a_current_of_one_run_changes_the_error_of_that_run_as_one_of_all_does(data):
    base, changed = model_error(data, START), START.plus({"V_n": 0.03})
    name = of_run("V_n", "run0")
    found = changed_error(data, START, base, {name: 0.03}, name)
    first = data[0].middle.size
    assert np.array_equal(found[:first], omega(data[0], changed))
    assert np.array_equal(found[first:], base[first:])
    assert not np.array_equal(found[:first], base[:first])
    assert np.array_equal(
        changed_error(data, START, base, {"V_n": 0.03}, "V_n"), model_error(data, changed)
    )


def test_a_current_is_tried_for_all_runs_and_for_each(data):
    e = START.ship.effects["current"]
    base = model_error(data, START)
    of_all, of_each = candidate(data, START, base, e).shapes
    (one,) = of_one_value([candidate(data, START, base, e)], START.ship)
    assert [s.fitted for s in one.shapes] == [of_all.fitted]
    assert [parameter_and_run(n) for n in of_each.fitted] == [
        (n, run) for run in ("run0", "run1") for n in ("V_n", "V_e")
    ]
    assert of_each.columns[..., :2] + of_each.columns[..., 2:] == pytest.approx(of_all.columns)
    alone = candidate(data[:1], START, base[: data[0].middle.size], e).shapes
    assert len(alone) == 1, "of one run both are the same"
    drag = START.ship.effects["X_u"]
    assert len(candidate(data, START, base, drag).shapes) == 1


def test_predictions_and_their_slopes_are_those_of_the_current_of_their_run(data):
    shots = Shooting([w.smoothed for w in data], data[0].horizon)
    model = START.plus(OF_DAYS)
    names = [*OF_DAYS]
    found = shots.around(model, dict.fromkeys(names, 1e-4))
    for k in (0, 1):
        own, of = model.during(f"run{k}"), shots.run == k
        alone = Shooting([data[k].smoothed], data[0].horizon)
        plain = alone.around(own, {parameter_and_run(n)[0]: 1e-4 for n in names})
        assert found.residuals[of] == pytest.approx(plain.residuals, abs=1e-12)
        assert found.motion.slope[of] == pytest.approx(plain.motion.slope, abs=1e-9)
        assert found.motion[of].by_mass == pytest.approx(
            np.broadcast_to(plain.motion.by_mass, (of.sum(), 1, 3, 3))
        )
        for n, name in enumerate(names):
            here = parameter_and_run(name)[1] == f"run{k}"
            expected = plain.slopes[..., n] if here else 0.0 * plain.slopes[..., n]
            assert found.slopes[of][..., n] == pytest.approx(expected, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("other", [WEST, NORTH])
def test_a_current_is_found_of_each_run_where_it_differs(other):
    """And once where it is the same."""
    found = ForwardSelection().fit(runs(NORTH, other), START, 0.1, lambda step: None, 0)
    assert [f.id for f in found.effects][:1] == ["current"]
    first = found.effects[0]
    assert first.of_runs == (["run0", "run1"] if other is WEST else [])
    for run, current in (("run0", NORTH), ("run1", other)):
        for name in ("V_n", "V_e"):
            got = found.model.during(run).value(name)
            assert got == pytest.approx(current.get(name, 0.0), abs=0.006)


@pytest.mark.parametrize(
    ("first", "second", "losses", "stands_back"),
    [
        ("V_n@a", "delta_X_u", (2.0, 1.0), True),
        ("V_n@a", "delta_X_u", (1.0, 1.0), False),  # it foretells as much
        ("V_n@a", "mass@a", (2.0, 1.0), False),  # nor does the other have one value
        ("V_n", "delta_X_u", (2.0, 1.0), False),
        ("bow_failure_time@a", "delta_X_u", (2.0, 1.0), False),  # a time is always of a run
    ],
)
def test_values_of_each_run_stand_back_where_one_value_foretells_unseen_runs(
    first, second, losses, stands_back
):
    noise = np.random.default_rng(0).uniform(0.9, 1.1, (2, 40))
    scored = [
        Scored(k, 0, noise[k], size * noise[k], 0.0, 0.0) for k, size in zip((1, 0), losses, strict=True)
    ]
    best = SimpleNamespace(
        winner=SimpleNamespace(start=START),
        starts=[SimpleNamespace(values={second: 1.0}), SimpleNamespace(values={first: 1.0})],
        scored=scored,
    )
    assert better_with_one_value(best) is stands_back
