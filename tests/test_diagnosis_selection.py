"""From a measured run to the model error and to the effect that is missing."""

import numpy as np
import pytest
from support.cases import slow
from support.cse1 import EFFECTS
from support.measured import learn, sail, smoothed

from diagnosis.predictors import Model, omega, weak_windows
from diagnosis.predictors.weak_form import kernel, kernel_integral, kernel_moment
from diagnosis.search import forward_selection
from diagnosis.search.prior import MEASURED, NominalPrior
from diagnosis.search.refinement import RefinedModel, TrainingSet
from diagnosis.search.shortlist import LENGTH, NEW, novelty, rank, reweighted
from diagnosis.verdict.confidence import probability


def data(seconds=96.0, **hidden):
    """Windows of a run of the ship with something hidden in it, and the true velocity."""
    run, nu = sail(seconds, 0.05, **hidden)
    return weak_windows(smoothed(run)), nu


def rms(x):
    return np.sqrt(np.mean(np.square(x), axis=0))


def test_kernel_has_unit_area_and_its_own_derivatives():
    s = np.linspace(-1.0, 1.0, 20001)
    assert np.trapezoid(kernel(s), s) == pytest.approx(1.0, abs=1e-9)
    assert np.gradient(kernel_integral(s), s) == pytest.approx(kernel(s), abs=1e-4)
    assert np.gradient(kernel_moment(s), s) == pytest.approx(s * kernel(s), abs=1e-4)
    assert kernel_integral(1.0) - kernel_integral(-1.0) == pytest.approx(1.0)


def test_windows_are_exact_for_straight_signals_however_uneven_the_samples():
    run, _ = sail(60.0, 0.02)
    rng = np.random.default_rng(0)
    kept = np.sort(rng.choice(np.arange(1, run.time.size - 1), run.time.size // 4, replace=False))
    w = weak_windows(smoothed(run.rows(np.concatenate([[0], kept, [run.time.size - 1]]))))
    one, t = np.ones(w.run.time.size), w.run.time
    np.testing.assert_allclose(w.smooth @ one, 1.0, rtol=1e-12)
    np.testing.assert_allclose(w.held @ one, 1.0, rtol=1e-12)
    np.testing.assert_allclose(w.slope @ one, 0.0, atol=1e-12)
    np.testing.assert_allclose(w.smooth @ t, w.middle, rtol=1e-12)
    np.testing.assert_allclose(w.slope @ t, 1.0, rtol=1e-9)


# Of each kind one: drag, mass, environment, measurement, thrusters by a switch, with memory, nonlinear.
HIDDEN = [
    {"ship": {"delta_X_u": -3.0}},
    {"ship": {"mass": 3.0}},
    {"ship": {"V_n": 0.05, "V_e": -0.03}},
    {"ship": {"marker_offset_dx": 0.1, "marker_offset_dy": -0.05}},
    {"thrusters": {"bow_failure_time": 40.0}},
    {"thrusters": {"lag": 0.4}},
    {"thrusters": {"deadband": 0.05}},
]


@pytest.mark.parametrize("hidden", HIDDEN, ids=lambda h: "-".join(n for g in h.values() for n in g))
def test_model_error_vanishes_for_the_true_model_and_only_for_it(hidden):
    w, _ = data(**hidden)
    changes = {name: x for group in hidden.values() for name, x in group.items()}
    wrong, right = rms(omega(w, Model())), rms(omega(w, Model().plus(changes)))
    assert (right < [0.008, 0.012, 0.003]).all()
    assert (wrong / [0.008, 0.012, 0.003]).max() > 2.0


@pytest.mark.quick
def test_model_error_is_the_force_that_was_hidden():
    """Two ways to the same: the weak form of the pose, and the force by the true velocity."""
    w, nu = data(ship={"delta_X_u": -3.0})
    force = np.column_stack(np.broadcast_arrays(-3.0 * nu[:, 0], 0.0, 0.0))
    assert rms(omega(w, Model()) - w.smooth @ force).max() < 0.01


def test_the_effect_whose_place_is_searched_is_refined_with_the_best():
    """Coefficients that were fitted without it may make it one of many, as long as it is linear."""
    w, _ = data(ship={"delta_X_u": -3.0})
    prior = NominalPrior.of(Model(), MEASURED)
    t, at = TrainingSet([w], None, prior), RefinedModel.at(Model(), prior)
    ranking = rank(t, at, set())
    ids = [ranking.candidates[s.candidate].effect.id for s in ranking.order]
    late = ids[LENGTH + 3]
    for present, more in (("", set()), (late, {late}), (ids[0], set())):
        weighed = reweighted(t, at, ranking, present)
        assert weighed is not None
        assert (late in weighed[-1].ids) == bool(more)
        assert len(weighed[-1].ids) == LENGTH + len(more)


@pytest.mark.numerical
@pytest.mark.parametrize(
    ("hidden", "effect"),
    [
        slow(({"ship": {"delta_N_r": 1.0}}, "N_r")),
        ({"thrusters": {"bow_failure_time": 40.0}}, "bow_failure"),
        slow(({"thrusters": {"loss_yaw": 0.3}}, "loss_yaw")),
    ],
)
def test_the_hidden_effect_is_found_first(hidden, effect):
    w, _ = data(**hidden)
    found_first(w, effect)


def found_first(w, effect):
    """The first finding, which is the effect or like it."""
    learned = learn([w], prior=0.0)
    first = learned.effects[0]
    assert first.id == effect or effect in first.alike
    assert learned.ranking[0].id == first.id
    assert rms(omega(w, learned.model)).max() < 0.3 * rms(omega(w, Model())).max()
    return first


@pytest.mark.numerical
def test_the_hidden_drag_is_found_first_and_its_interval_covers_the_truth():
    w, _ = data(ship={"delta_X_u": -3.0})
    finding = found_first(w, "X_u")
    low, high = finding.ci95["delta_X_u"]
    assert finding.id == "X_u"
    assert low < -3.0 < high
    assert high - low < 0.2
    assert probability(finding.evidence) > 0.9


@pytest.mark.numerical
def test_nothing_is_found_where_nothing_is_missing():
    w, _ = data()
    learned = learn([w], 0.1)
    assert list(learned.effects) == []
    assert {r.id for r in learned.ranking} <= set(EFFECTS)


def test_coefficients_within_the_prior_are_no_finding():
    off = {"X_u": -0.6, "Y_v": -1.45, "N_r": -2.0, "Y_r": -6.9}
    w, _ = data(ship=off)
    assert list(learn([w], prior=0.1).effects) == []


@pytest.mark.slow
@pytest.mark.parametrize(("harm", "found"), [([True, False, True], 2), ([True, True], 0)])
def test_an_effect_that_harms_alone_stays_with_the_next_or_goes(monkeypatch, harm, found):
    """One of two causes may harm the runs in which the other acts most, and both together do not."""
    stated = iter(harm)
    monkeypatch.setattr(forward_selection, "harmful", lambda *_: next(stated, True))
    pair = {"ship": {"delta_X_u": -3.0}, "thrusters": {"loss_yaw": 0.3}}
    learned = learn([data(**pair)[0]], 0.0)
    assert len(learned.effects) == found
    assert {f.id for f in learned.effects} == ({"X_u", "loss_yaw"} if found else set())


def test_a_later_ranking_uses_the_columns_of_an_earlier_one():
    w, _ = data()
    prior = NominalPrior.of(Model(), 0.1)
    t, nothing, made = TrainingSet([w], None, prior), np.zeros(prior.size), {}
    first = rank(t, RefinedModel(Model(), nothing), set(), made)
    drag = RefinedModel(Model(), nothing, {"delta_X_u": -1.0}, np.zeros((1, 1)))
    later, anew = rank(t, drag, {"X_u"}, made), rank(t, drag, {"X_u"})
    of = [{c.effect.id: c for c in step.candidates} for step in (first, later, anew)]

    def kept(effect, step):
        return step[effect].shapes[0].columns is of[0][effect].shapes[0].columns

    assert kept("loss_yaw", of[1])
    for effect in ("curve_vsp_x(c)", "mass", "current", "clock_offset"):
        assert not kept(effect, of[1]), "it follows from the model's motion or error"
    assert of[1].keys() == of[2].keys() == of[0].keys() - {"X_u"}
    for effect in ("loss_yaw", "Y_v", "Y_r"):
        pairs = zip(of[1][effect].shapes, of[2][effect].shapes, strict=True)
        for old, new in pairs:
            np.testing.assert_allclose(old.columns, new.columns, atol=1e-6 * np.abs(new.columns).max())
    turned = RefinedModel(Model(), nothing, {"heading_offset": 0.3}, np.zeros((1, 1)))
    other = rank(t, turned, {"heading_offset"}, made)
    assert not kept("loss_yaw", {c.effect.id: c for c in other.candidates})


@pytest.mark.quick
def test_what_a_curve_has_in_it_is_no_candidate_beside_it():
    """A loss of surge force is a straight curve; what needs the yaw moment or the speed is not.

    Seen in a model error that is large against the noise: a small share of its own is enough.
    """
    w, _ = data()
    effect = EFFECTS["curve_vsp_x(c)"]
    names = [p.name for p in effect.parameters if p.name in effect.coefficients]
    curve = dict(zip(names, 0.1 * np.linspace(-1.0, 1.0, len(names)) ** 3, strict=True))
    prior = NominalPrior.of(Model(), 0.1)
    free = np.zeros((len(names), len(names)))
    at = RefinedModel(Model(), np.zeros(prior.size), curve, free)
    step = rank(TrainingSet([w], None, prior), at, {effect.id})
    new = {
        c.effect.id: novelty(step.table, k, len(names)) * step.size >= NEW
        for k, c in enumerate(step.candidates)
    }
    assert not new["loss_surge"]
    assert new["loss_yaw"]
    assert new["X_u"]
    assert new["curve_vsp_y(c)"]
    assert {step.candidates[j.candidate].effect.id for j in step.order} == {e for e in new if new[e]}
    assert all(novelty(step.table, k, 0) == 1.0 for k in range(len(new))), "beside nothing all is new"
