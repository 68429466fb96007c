"""What a regression is not linear in: outages by segmentation, shapes of effects from many starts, curves."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from support.cse1 import EFFECTS
from support.measured import sail, smoothed

from diagnosis import Model, Windows, omega
from diagnosis.predictors import read_model, weak_windows, write_model
from diagnosis.search.candidates import (
    SMALL,
    CandidateShape,
    additions,
    candidate,
    covered,
    curve,
    model_error,
)
from diagnosis.search.nonlinear import profile
from diagnosis.search.nonlinear.multistart import Landscape, best_values
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel, TrainingSet
from diagnosis.search.shortlist import rank, reweighted
from fmus.declare import Range, Variable
from fmus.effects import effect
from fmus.scale import REFERENCE, Scale

SPANS = [(8.0, 14.0), (25.3, 28.0), (40.0, 52.0)]


def times(device, spans, run=""):
    """Intervals as parameters of an outage, or as their values in one run."""
    pairs = [(f"{device}_outage_{end}_{k}{run and '@'}{run}", t) for k, s in enumerate(spans, 1)
             for end, t in zip(("start", "end"), s, strict=True)]  # fmt: skip
    return dict(pairs)


@pytest.mark.parametrize("device", ["bow"])
def test_intervals_of_an_outage_are_found_and_survive_a_parameter_set(device, tmp_path):
    hidden = times(device, SPANS)
    w = weak_windows(smoothed(sail(64.0, thrusters=hidden)[0]))
    model = Model()
    base = model_error([w], model)
    (shape,) = candidate([w], model, base, EFFECTS[f"{device}_outage"]).shapes
    found = shape.given
    assert set(found) == set(times(device, SPANS, "made"))
    assert [*found.values()] == pytest.approx([*hidden.values()], abs=0.3)
    assert np.sqrt(np.mean((base - shape.offset) ** 2)) < 0.1 * np.sqrt(np.mean(base**2))
    write_model(tmp_path / "model.ssv", model.plus(found))
    again = read_model(tmp_path / "model.ssv")
    assert again.thrusters == {}
    assert again.during("made").thrusters == pytest.approx(hidden, abs=0.3)


def test_what_is_tried_of_a_coefficient_is_an_addition_and_of_a_shape_the_value_itself():
    for e in EFFECTS.values():
        start = Model().plus({p.name: 0.1 for p in e.parameters if p.name not in e.coefficients})
        tried = {p.name: 0.3 for p in e.parameters}
        found = start.plus(additions(start, e, tried))
        for name, value in tried.items():
            before = start.value(name) if name in e.coefficients else 0.0
            assert found.value(name) - before == pytest.approx(value), (e.id, name)


@pytest.mark.slow
def test_a_dead_band_far_below_those_that_are_tried_is_found_and_beats_the_free_curve():
    """Of a force over the command, as the least dead band that is tried beyond zero is 0.03."""
    hidden = {"thrust_curve_ahead": 0.15, "thrust_curve_astern": -0.1, "thrust_curve_deadband": 0.01}
    w = weak_windows(smoothed(sail(64.0, thrusters=hidden)[0]))
    prior = NominalPrior.of(Model(), 0.1)
    t, at = TrainingSet([w], None, prior), RefinedModel.at(Model(), prior)
    rivals = {"thrust_curve", "curve_vsp_x(c)", "loss_surge"}
    weighed = reweighted(t, at, rank(t, at, set(EFFECTS) - rivals))
    assert weighed is not None
    best = weighed[-1]
    assert best.ids[best.scored[0].candidate] == "thrust_curve"
    assert best.starts[best.scored[0].candidate].values == pytest.approx(hidden, rel=0.2)


def test_without_an_outage_there_are_no_intervals_and_one_for_good_is_a_failure():
    for hidden in ({}, {"bow_failure_time": 30.0}):
        w = weak_windows(smoothed(sail(64.0, thrusters=hidden)[0]))
        model = Model()
        base = model_error([w], model)
        assert not candidate([w], model, base, EFFECTS["bow_outage"]).shapes


RUNS = {"a": [(12.0, 18.0), (35.0, 41.0)], "b": [], "c": [(4.0, 9.0), (22.0, 27.0), (44.3, 52.0)]}


def in_runs(thrusters):
    """Windows of a run for each name, with the thrusters that it has there."""
    made = {
        name: sail(64.0, thrusters=own, seed=k)[0] for k, (name, own) in enumerate(thrusters.items())
    }
    return [weak_windows(smoothed(replace(run, name=name))) for name, run in made.items()]


def test_outages_at_other_times_in_each_run_are_found_where_they_are():
    data = in_runs({name: times("bow", spans) for name, spans in RUNS.items()})
    model = Model()
    base = model_error(data, model)
    (shape,) = candidate(data, model, base, EFFECTS["bow_outage"]).shapes
    true = times("bow", RUNS["a"], "a") | times("bow", RUNS["c"], "c")
    assert shape.given == pytest.approx(true, abs=0.3)
    learned = model.plus(shape.given)
    assert set(learned.runs) == {"a", "c"}
    for w in data:
        left, first = (np.sqrt(np.mean(omega(w, m) ** 2)) for m in (learned, model))
        assert left < 0.1 * first or w.run.name == "b"
        assert left < 0.01, "of the run without a failure it is the noise"


def test_a_failure_for_good_begins_at_another_time_in_each_run():
    data = in_runs({"a": {"bow_failure_time": 30.0}, "b": {}, "c": {"bow_failure_time": 15.0}})
    model = Model()
    base = model_error(data, model)
    (shape,) = candidate(data, model, base, EFFECTS["bow_failure"]).shapes
    true = {"bow_failure_time@a": 30.0, "bow_failure_time@c": 15.0}
    assert shape.given == pytest.approx(true, abs=0.3)
    assert not candidate(data, model, base, EFFECTS["bow_outage"]).shapes


def test_times_of_one_run_are_left_out_of_the_predictions_of_others():
    data = in_runs({name: times("bow", spans) for name, spans in RUNS.items()})
    model = Model()
    timed = model.plus(times("bow", RUNS["a"], "a"))
    runs = [w.smoothed for w in data]
    together = Windows(runs)
    with_times, without = (together.residuals(m) for m in (timed, model))
    of_a = together.run[together.sample_window] == 0
    assert np.array_equal(with_times[~of_a], without[~of_a])
    assert np.square(with_times[of_a]).mean() < 0.1 * np.square(without[of_a]).mean()
    assert with_times[of_a] == pytest.approx(Windows(runs[:1]).residuals(timed.during("a")))
    for w in data[1:]:
        assert np.array_equal(omega(w, timed), omega(w, model))


def test_what_is_dead_most_of_the_time_is_no_outage():
    w = weak_windows(smoothed(sail(64.0, thrusters=times("vsp", [(8.0, 45.0)]))[0]))
    model = Model()
    assert not candidate([w], model, model_error([w], model), EFFECTS["vsp_outage"]).shapes
    rest = [weak_windows(smoothed(replace(sail(64.0)[0], name=name))) for name in "bc"]
    assert not candidate([w, *rest], model, model_error([w, *rest], model), EFFECTS["vsp_outage"]).shapes


def test_the_shape_of_an_effect_is_found_far_from_its_start():
    """A force towards a point of the plane beyond a slack, of which only starts are declared."""
    rng = np.random.default_rng(2)
    x, y = rng.uniform(-4.0, 4.0, (2, 200))

    def pull(k, to_x, to_y, slack):
        d = np.hypot(to_x - x, to_y - y)
        size = k * np.maximum(0.0, d - slack) / d
        return np.concatenate([size * (to_x - x), size * (to_y - y)])

    starts = {"k": 0.0, "to_x": 1.0, "to_y": 1.0, "slack": 0.5}
    least = {"slack": 0.0}
    declared = tuple(Variable(n, "m", n, s, Range(min=least.get(n)), False) for n, s in starts.items())
    tether = effect("t", "force", "XY", parameters=declared, description="tether")(pull)
    truth = {"k": 0.2, "to_x": -3.0, "to_y": 5.0, "slack": 2.0}
    of = Landscape(
        tether, lambda v: pull(**{**starts, **v}), pull(**truth), 8.0, starts, dict.fromkeys(starts, 1.0)
    )
    values, fitted = best_values(of, lambda shape: ())
    assert fitted == ["k"]
    assert values[0] == pytest.approx({n: v for n, v in truth.items() if n != "k"}, abs=1e-3)


def test_a_curve_is_fitted_where_the_data_reach_it():
    columns = np.zeros((50, 3, 21))
    columns[:, 0, 6] = 1.0
    columns[:, 0, 8] = 0.5
    columns[0, 0, 15] = 0.01
    assert np.flatnonzero(covered(columns)).tolist() == [6, 7, 8]


@pytest.mark.parametrize(("growth", "rough"), [(0.0, False), (-0.4, True)])
def test_a_slope_that_depends_on_its_step_is_none(growth, rough, monkeypatch):
    name, t = "thrust_curve_deadband", SimpleNamespace(data=(), prior=None, error=lambda at: "left")
    at = SimpleNamespace(start=Model(), values={name: 0.2}, model=lambda prior: Model())
    places = []

    def slope(given, model, left, parameter, size):
        assert (given, parameter, size) == (t, name, 0.2)
        places.append((left, model.value(name)))
        return np.full((5, 3), 1.0 + growth * len(places))

    monkeypatch.setattr(profile, "slope", slope)
    monkeypatch.setattr(profile, "model_error", lambda data, model: "left below")
    assert profile.is_rough(t, at, name) == rough
    assert places == [("left", 0.0), ("left below", pytest.approx(-0.2 * SMALL))]
    assert not profile.is_rough(t, at, "loss_surge"), "a linear one has one slope"
    assert len(places) == 2


def test_a_curve_of_a_larger_ship_bends_as_much_in_its_own_units():
    """Its nodes, its values' prior and the columns stay, with forces and units at the size of the ship."""
    rng = np.random.default_rng(2)
    force = rng.standard_normal((40, 3, 6)) * [0.0, 1.0, 1.0, 2.0, 1.0, 0.0]
    base, names = rng.standard_normal((40, 3)), [f"node_{k}" for k in range(6)]
    addition = SimpleNamespace(parameters=[SimpleNamespace(unit="N")])

    def made(scale, unit):
        forces = np.array(scale.forces)
        shape = CandidateShape({}, names, None, force * forces[:, None] / unit, np.full(6, unit))
        (found,) = curve(base * forces, shape, addition, scale)
        return found

    same, other = made(REFERENCE, 1.0), made(Scale(7.0), 50.0)
    assert other.fitted == same.fitted == names
    np.testing.assert_allclose(other.precision * 50.0**2, same.precision, rtol=1e-9)
    assert other.columns.shape == (40, 3, 6)


@pytest.mark.parametrize(
    ("unit", "reached", "fitted"),
    [
        ("1", (3, 4, 5), range(7)),  # a factor: as it is where it was last seen
        ("1", (4, 5, 6), range(7)),
        ("N", (1, 2, 3, 4, 5), range(7)),  # astern and ahead
        ("N", (4, 5), range(0)),  # no bend
        ("N", (3, 4, 5), range(3, 7)),  # ahead alone: no force at rest or astern
        ("N", (1, 2, 3), range(4)),
    ],
)
def test_a_curve_goes_on_beyond_the_data_with_its_last_value(unit, reached, fitted):
    rng = np.random.default_rng(3)
    force = np.zeros((50, 3, 7))
    force[:, 0, reached] = rng.standard_normal((50, len(reached)))
    plain = CandidateShape({}, [*"abcdefg"], None, force, np.ones(7))
    e = SimpleNamespace(parameters=[SimpleNamespace(unit=unit)])
    found = curve(rng.standard_normal((50, 3)), plain, e, REFERENCE)
    if not fitted:
        assert found == []
        return
    (shape,) = found
    assert shape.fitted == [plain.fitted[k] for k in fitted]
    values = rng.standard_normal(7)  # a solution that follows the data, and else the prior
    A = shape.columns[:, 0]
    H = 1e3 * A.T @ A + shape.precision
    got = np.linalg.solve(H, 1e3 * A.T @ (force[:, 0] @ values))
    for k, x in zip(fitted, got, strict=True):
        near = min(max(k, reached[0]), reached[-1])
        assert x == pytest.approx(values[near], abs=0.05)
