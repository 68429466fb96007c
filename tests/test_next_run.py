"""The design of the next run: information of rival hypotheses, library of manoeuvres, plan, command."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import multivariate_normal
from support.command import command
from support.foreign import needs_compiler
from support.measured import sail, table_of
from support.oscillator import build_oscillator

import cosim
import diagnosis
import diagnosis.design.spread as spread_of
from benchmarks import next_pool, next_run
from benchmarks.hidden_effects.draw import LARGEST, SMALLEST
from cosim import InputError
from cosim.fmu import ConfinedFmu, FmuModel
from diagnosis import Model, design_run, learn
from diagnosis.design import (
    DIMENSIONS,
    Basin,
    Limits,
    Question,
    plan_next,
    prepared,
    rehearsal,
    write_run,
)
from diagnosis.design.designing import Designer, limits_of
from diagnosis.design.hypotheses import knowledge, rivals
from diagnosis.design.information import (
    Hypothesis,
    Knowledge,
    Prediction,
    a_optimal,
    box_hill,
    buzzi_ferraris,
    certainty,
    d_optimal,
    inseparable,
    projected,
)
from diagnosis.design.manoeuvre_library import LIBRARY, PlanStep, Reach, poses, sequence, usual
from diagnosis.design.planned_motion import PlannedMotion
from diagnosis.design.rehearsal import Rehearsal, RehearsedEffect
from diagnosis.design.spread import drawn, followed
from diagnosis.predictors import ship_with
from diagnosis.predictors.fmu.fmu_playback import Playback, PlaybackRequest
from diagnosis.predictors.thrust import LONGEST_STEP
from diagnosis.predictors.weak_form import commanded
from diagnosis.runs.cleaning import BRIEF
from diagnosis.search.candidates import model_error
from diagnosis.search.gram import Nuisance
from diagnosis.search.prior import NominalPrior

NUMBERS = DIMENSIONS - 2  # of a manoeuvre
Q, OWN = 3, 2  # nuisance parameters, and those of each of two hypotheses
SECONDS = 60.0  # of a planned run
REACH = Reach(0.15, 0.2, 2.5, 1.0, -0.5, 0.5)


def regressors(rng, rows):
    return rng.standard_normal((rows, Q + 2 * OWN))


def linear(seed=0, rows=12, alike=False):
    """Two hypotheses on old data of a linear problem, and the regressors and data of it."""
    rng = np.random.default_rng(seed)
    X = regressors(rng, rows)
    if alike:
        X[:, Q + OWN :] = X[:, Q : Q + OWN]
    y = X[:, : Q + OWN] @ rng.standard_normal(Q + OWN) + rng.standard_normal(rows)
    nuisance, first = np.arange(Q), np.arange(Q, Q + OWN)
    own = [first, first + OWN]
    h = [Hypothesis((n,), np.concatenate([nuisance, o]), o) for n, o in zip("ab", own, strict=True)]
    precision = np.diag([*[1.0] * Q, *[0.1] * (2 * OWN)])
    prior = np.zeros(len(precision))
    return Knowledge(h, np.array([0.5, 0.5]), X.T @ X, X.T @ y, precision, prior, 1.0), X, y, rng


def gram(rng, rows=20, alike=False):
    X = regressors(rng, rows)
    if alike:
        X[:, Q + OWN :] = X[:, Q : Q + OWN]
    return X.T @ X


def test_the_evidence_is_the_density_of_the_data():
    k, X, y, _ = linear()
    direct = []
    for h in k.hypotheses:
        A, s = X[:, h.columns], h.columns
        V = np.eye(len(y)) + A @ np.linalg.inv(k.precision[np.ix_(s, s)]) @ A.T
        direct.append(multivariate_normal(np.zeros(len(y)), V).logpdf(y))
    assert np.diff(k.log_evidence) == pytest.approx(np.diff(direct), rel=1e-9)


def test_the_projection_is_the_refit_by_brute_force():
    k, X, _, rng = linear()
    new = regressors(rng, 20)
    z = rng.standard_normal(X.shape[1])
    together = np.concatenate([X, new])
    for i, j in ((0, 1), (1, 0)):
        data = together[:, k.hypotheses[i].own] @ z[k.hypotheses[i].own]
        s = k.hypotheses[j].columns
        # The prior of the rival's parameters as further rows.
        A = np.concatenate([together[:, s], np.sqrt(k.precision[np.ix_(s, s)])])
        b = np.concatenate([data, np.zeros(s.size)])
        left = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
        assert projected(k, i, j, z, together.T @ together) == pytest.approx(left @ left, rel=1e-9)


def test_identical_candidates_cannot_be_discriminated():
    k, _, _, rng = linear(alike=True)
    G = gram(rng, alike=True)
    p = Prediction.of(k, G)
    assert p.log_ratio(0, 1) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert box_hill(k, G) == pytest.approx(0.0, abs=1e-9)
    z = k.estimates[0].mean
    assert projected(k, 0, 1, z, np.zeros_like(G)) < 1e-9
    assert inseparable(k, [G]) == [(0, 1)]
    different = gram(rng, 4000)
    assert inseparable(k, [different]) == []
    assert certainty(k, different) > 0.9 > 0.1 > certainty(k, G)


def test_information_grows_with_each_run():
    k, _, _, rng = linear()
    G, more = gram(rng), gram(rng)
    assert 0.0 < d_optimal(k, G) < d_optimal(k, G + more)
    assert -1.0 < a_optimal(k, G) < a_optimal(k, G + more) < 0.0
    assert 0.0 < box_hill(k, G) < box_hill(k, G + more)
    assert d_optimal(k, np.zeros_like(G)) == pytest.approx(0.0, abs=1e-12)
    assert a_optimal(k, np.zeros_like(G)) == pytest.approx(-1.0)
    z = k.estimates[0].mean
    assert projected(k, 0, 1, z, k.G) <= projected(k, 0, 1, z, k.G + G) + 1e-12


def test_precision_criteria_agree_with_the_posterior_of_stacked_rows():
    k, X, _, rng = linear()
    new = regressors(rng, 20)
    k = replace(k, weights=np.array([0.9, 0.1]))
    s = k.hypotheses[0].columns
    P = k.precision[np.ix_(s, s)]
    rows = [X[:, s], np.concatenate([X, new])[:, s]]
    before, after = (np.linalg.inv(A.T @ A + P) for A in rows)
    volume = 0.5 * np.log(np.linalg.det(before) / np.linalg.det(after))
    assert d_optimal(k, new.T @ new) == pytest.approx(volume, rel=1e-9)
    ratio = np.mean(np.diag(after) / np.diag(before))
    assert a_optimal(k, new.T @ new) == pytest.approx(-ratio, rel=1e-9)


def test_precision_criteria_agree_with_pyomo_doe():
    """A straight line whose slope and offset are estimated from five outputs at given places."""
    pyo = pytest.importorskip("pyomo.environ", reason="pyomo is not installed (group `design`)")
    pytest.importorskip("highspy", reason="highspy is not installed (group `design`)")
    from pyomo.contrib.doe import DesignOfExperiments

    places, std, before = np.array([0.0, 1.0, 2.5, 4.0, 7.0]), 0.3, np.array([[2.0, 0.3], [0.3, 5.0]])

    class Line:
        def get_labeled_model(self):
            m = pyo.ConcreteModel()
            m.n = pyo.RangeSet(0, len(places) - 1)
            m.x = pyo.Var(m.n, initialize=dict(enumerate(places)))
            m.a, m.b = pyo.Var(initialize=1.5), pyo.Var(initialize=-0.7)
            m.y = pyo.Var(m.n, initialize=0.0)
            m.line = pyo.Constraint(m.n, rule=lambda m, n: m.y[n] == m.a + m.b * float(places[n]))
            m.none = pyo.Objective(expr=0.0)  # HiGHS asks for one
            m.a.fix()
            m.b.fix()
            m.x.fix()
            m.experiment_outputs = pyo.Suffix(direction=pyo.Suffix.LOCAL)
            m.experiment_outputs.update((m.y[n], None) for n in m.n)
            m.measurement_error = pyo.Suffix(direction=pyo.Suffix.LOCAL)
            m.measurement_error.update((m.y[n], std) for n in m.n)
            m.experiment_inputs = pyo.Suffix(direction=pyo.Suffix.LOCAL)
            m.experiment_inputs.update((m.x[n], None) for n in m.n)
            m.unknown_parameters = pyo.Suffix(direction=pyo.Suffix.LOCAL)
            m.unknown_parameters.update((v, pyo.value(v)) for v in (m.a, m.b))
            return m

    doe = DesignOfExperiments(
        Line(),
        solver=pyo.SolverFactory("appsi_highs"),
        prior_FIM=before,
        scale_nominal_param_value=False,
    )
    information = np.array(doe.compute_FIM(method="sequential"))
    X = np.column_stack([np.ones(places.size), places]) / std
    h = Hypothesis(("line",), np.arange(2), np.arange(2))
    k = Knowledge([h], np.ones(1), np.zeros((2, 2)), np.zeros(2), before, np.zeros(2), 1.0)
    grown = np.linalg.slogdet(information)[1] - np.linalg.slogdet(before)[1]
    assert d_optimal(k, X.T @ X) == pytest.approx(0.5 * grown, rel=1e-6)
    ratio = np.diag(np.linalg.inv(information)) / np.diag(np.linalg.inv(before))
    assert a_optimal(k, X.T @ X) == pytest.approx(-np.mean(ratio), rel=1e-6)


def test_the_log_ratio_and_t_agree_with_all_rows_of_the_run():
    k, _, _, rng = linear()
    new = regressors(rng, 9)
    p = Prediction.of(k, new.T @ new)
    means, covariances = [], []
    for h, e in zip(k.hypotheses, k.estimates, strict=True):
        A = new[:, h.columns]
        means.append(new @ e.mean)
        covariances.append(np.eye(len(new)) + A @ e.covariance @ A.T)
    y = rng.multivariate_normal(means[0], covariances[0], 40000)
    first, second = (
        multivariate_normal(m, V).logpdf(y) for m, V in zip(means, covariances, strict=True)
    )
    mean, std = p.log_ratio(0, 1)
    assert mean == pytest.approx(np.mean(first - second), abs=5.0 * std / 200.0)
    assert std == pytest.approx(np.std(first - second), rel=0.05)
    d, S = means[0] - means[1], np.linalg.inv(sum(covariances))
    # Rows outside the span of the regressors have the noise alone: each adds 1 to the trace.
    r = len(p.mean[0])
    direct = (d @ S @ d + 2.0 * np.trace(S) - (len(new) - r)) / r
    assert buzzi_ferraris(k, new.T @ new) == pytest.approx(direct, rel=1e-9)


@pytest.mark.parametrize("name", LIBRARY)
def test_every_manoeuvre_goes_from_rest_to_rest_within_its_speeds(name):
    h, T = 0.05, 90.0
    t = np.arange(0.0, T + h, h)
    for seed in range(5):
        numbers = np.random.default_rng(seed).random(NUMBERS).tolist()
        pose = LIBRARY[name](t, T, numbers, REACH)
        assert pose.shape == (t.size, 3)
        assert np.isfinite(pose).all()
        assert pose[0] == pytest.approx(0.0, abs=1e-9)
        rate = np.gradient(pose, h, axis=0)
        assert np.hypot(rate[:, 0], rate[:, 1]).max() < 1.6 * REACH.speed
        assert np.abs(rate[:, 2]).max() < 1.6 * REACH.rate
        for end in (rate[0], rate[-1]):
            assert end == pytest.approx(0.0, abs=0.02 * REACH.rate)
        assert np.hypot(*(pose[-1, :2])) < 0.02  # where it began


def test_a_sequence_takes_all_the_time_without_a_jump():
    for seed in range(10):
        plan = sequence(np.random.default_rng(seed).random(4 * (NUMBERS + 2)), 240.0)
        pose = poses(plan, 240.0, 0.1, REACH)
        assert len(pose) == 2401
        steps = np.abs(np.diff(pose, axis=0)).max(axis=0)
        assert (steps < 0.1 * 2.0 * np.array([REACH.speed, REACH.speed, REACH.rate])).all()


def test_the_margin_is_that_of_the_corners_of_the_hull():
    basin = Basin((0.0, 6.0), (-2.0, 2.0))
    hull = np.array([[1.0, 0.5], [-1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]])
    eta = np.array([[3.0, 0.0, 0.0], [3.0, 0.0, np.pi / 2.0], [5.5, 0.0, 0.0]])
    assert basin.margin(eta, hull) == pytest.approx([1.5, 1.0, -0.5])
    gone = np.array([[0.0, 0.0, np.inf], [np.nan, 0.0, 0.0]])
    assert (basin.margin(gone, hull) == -np.inf).all(), "a ship that ran away"


def content(first="X_|u|u", others=("X_uu",), confidence=0.5):
    effect = {"id": first, "indistinguishable": list(others), "confidence": confidence}
    effect["advice"] = f"To discriminate {first} from {others[0]}: run astern."
    return {"verdict": "ambiguous", "effects": [effect], "possibilities": [], "ranking": []}


def ahead(t):
    return np.column_stack([0.3 + 0.1 * np.sin(0.3 * t), 0.0 * t, 0.05 * np.sin(0.2 * t)])


@pytest.fixture(scope="module")
def question():
    """Two candidates that a run ahead leaves open: drag by |u|u and by uu."""
    run, _ = sail(64.0, h=0.05, ship={"delta_X_absu_u": -4.0}, given=ahead)
    data = diagnosis.load(table_of(run))
    return Question(data, content(), Model(), 0.1, Limits(SECONDS, size=(6.0, 6.0)))


@pytest.fixture(scope="module")
def designer(question):
    prior = NominalPrior.of(question.start, question.prior)
    space, k = knowledge(question.data, question.start, prior, rivals(question.content))
    model = space.model(k.hypotheses[0], k.estimates[0].mean)
    return Designer(question.data, space, model, question.limits), k


def test_running_astern_discriminates_what_running_ahead_does_not(designer):
    d, k = designer
    assert {h.ids for h in k.hypotheses} == {("X_|u|u",), ("X_uu",)}
    assert k.weights == pytest.approx(0.5, abs=1e-3)
    astern = d.scored(k, [[PlanStep("legs", (0.5,) * NUMBERS, SECONDS, 0.0)]])[0]
    around = d.scored(k, [usual("circle", SECONDS)])[0]
    assert astern.excess == around.excess == 0.0
    assert astern.score > 0.9 > 0.1 > around.score
    d.tried[:] = [around]
    assert d.inseparable(k) == [(0, 1)]
    d.tried[:] = [around, astern]
    assert d.inseparable(k) == []


@pytest.fixture(scope="module")
def rehearsed(question, designer):
    """What learn would report, a run astern and one around."""
    d, k = designer
    plans = (
        d.scored(k, [[PlanStep("legs", (0.5,) * NUMBERS, SECONDS, 0.0)]])[0],
        d.scored(k, [usual("circle", SECONDS)])[0],
    )
    return Rehearsal(question.data, d.space, k), *(d.windows(s.motion) for s in plans)


@pytest.mark.slow
def test_the_stated_probability_is_that_of_scores_and_caps_of_learn(rehearsed, monkeypatch):
    r, astern, around = rehearsed
    assert r.sure([astern], 0, 20) > 0.9 > 0.1 > r.sure([around], 0, 20)
    assert r.confidences([around, astern], 0, 4).min() > r.confidences([around], 0, 4).max()
    # What learn reports of such data with at most even odds is not expected to become certain.
    monkeypatch.setattr(rehearsal, "doubt_of_data", lambda runs: "samples are rare")
    assert r.confidences([astern], 0, 5).max() <= 0.5


def test_a_cause_outside_the_candidates_makes_no_outcome_certain(rehearsed):
    """Where even the likeliest candidate leaves much of the model error, the truth is not listed."""
    r, astern, _ = rehearsed
    wrong = replace(r, k=replace(r.k, weights=np.array([1.0, 0.0])))
    assert wrong.listed > 0.95
    y = r.measured.y * np.where(np.arange(len(r.measured.y)) // 30 % 2, 0.5, 1.5)[:, None]
    other = replace(wrong)  # its size changes from one half minute to the next
    vars(other)["measured"] = r.measured._replace(y=y)
    assert other.listed < 0.5
    assert other.sure([astern], 0, 2) < 0.5


def test_what_a_confidence_without_a_rival_leaves_open_is_no_candidate(question):
    """Other coefficients, or nothing: a plan cannot be more probable to decide than a candidate holds."""
    prior = NominalPrior.of(question.start, 0.1, 0.1)
    alone, among = content(others=("X_uu",)), content()
    alone["effects"][0]["indistinguishable"] = []
    for asked, listed in ((alone, 0.5), (among, 1.0)):
        space, k = knowledge(question.data, question.start, prior, rivals(asked))
        assert k.listed == listed
        r = Rehearsal(question.data, space, k)
        assert r.listed <= listed
        assert any("listed candidate" in text for text in r.doubts) == (r.listed < 0.95)


def test_an_effect_that_the_runs_do_not_excite_changes_no_other_one(rehearsed):
    """Its force is zero in all of them; the diagnosis may have it all the same."""
    r, *_ = rehearsed
    h = r.k.hypotheses[0]
    trial = RehearsedEffect.of(r.wide, r.measured, r.measured.y, h, h.ids[0])
    known = trial.nuisance
    idle = Nuisance(
        np.concatenate([known.columns, np.zeros_like(known.columns[..., :1])], axis=2),
        np.pad(known.precision, (0, 1)),
        np.append(known.offset, 0.0),
        np.append(known.unit, 1.0),
    )
    _, values, std = replace(trial, nuisance=idle).judged(r.measured.y)
    _, expected, expected_std = trial.judged(r.measured.y)
    assert values == pytest.approx(expected)
    assert std == pytest.approx(expected_std)


@pytest.mark.slow
def test_the_trial_of_an_effect_is_that_of_the_search(question, rehearsed):
    """On the old runs alone a trial has the score differences and the evidence of the diagnosis."""
    r, *_ = rehearsed
    found = diagnosis.diagnose(question.data, prior=question.prior).learned.effects[0]
    h = next(h for h in r.k.hypotheses if h.ids == (found.id,))
    trial = RehearsedEffect.of(r.wide, r.measured, r.measured.y, h, found.id)
    mine = trial.finding(r.measured.y, np.random.default_rng(0))
    assert mine.evidence is not None
    assert found.evidence is not None
    assert {c.effect.id for c in trial.rivals} >= {found.id, *found.alike}
    assert mine.evidence.bagged == pytest.approx(found.evidence.bagged, abs=0.05)
    assert mine.values == pytest.approx(found.values, rel=0.05)


def test_what_the_actuators_cannot_do_is_not_proposed(designer):
    d, k = designer
    fast = replace(d, tried=[])
    fast.reach = d.reach._replace(speed=3.0, rate=3.0)
    found = fast.scored(k, [[PlanStep("legs", (1.0,) * NUMBERS, SECONDS, 0.0)]])[0]
    assert found.excess > 0.0
    assert found.score < -1.0, "below any plan that keeps the limits"
    assert not found.gram.any()


def test_the_planned_motion_is_what_its_thrust_gives():
    """A ship that is pushed by the computed force alone follows the target."""
    from fmus.signals import Force
    from fmus.vessel import vessel

    basin, h, model = Basin((0.0, 9.0), (0.0, 9.0)), 0.01, Model()
    motion = PlannedMotion.along(
        poses([PlanStep("zigzag", (0.5,) * NUMBERS, 40.0, 0.4)], 40.0, h, REACH), h, basin
    )
    tau = motion.thrust(model)
    s = vessel.State._make([*map(float, motion.eta[0]), 0.0, 0.0, 0.0, 0.0])
    for row in tau[:1000]:
        s = vessel.integrate(s, Force(*map(float, row)), model.hull.hull, h)
    assert (s.x, s.y, s.psi) == pytest.approx(motion.eta[1000], abs=0.01)


def test_a_faster_motion_has_the_same_track(designer):
    d, _ = designer
    slow = d.motions([[PlanStep("legs", (0.5,) * NUMBERS, 20.0, 0.0)]], (1.0, 1.0), BRIEF)[0]
    fast = slow.faster(1.2)
    h = float(fast.time[1] - fast.time[0])
    assert fast.eta == pytest.approx(slow.eta)
    assert fast.eta_dot == pytest.approx(np.gradient(slow.eta, h, axis=0))
    assert fast.eta_ddot == pytest.approx(np.gradient(fast.eta_dot, h, axis=0))


def test_a_plan_keeps_a_margin_to_the_speed_at_which_a_ship_diverges(designer, monkeypatch):
    """A ship that is lost at any speed above that of the plan is outside of every basin."""
    d, k = designer
    s = d.scored(k, [[PlanStep("legs", (0.5,) * NUMBERS, SECONDS, 0.0)]])[0]
    track = d.motions([s.steps], s.size, BRIEF)[0]

    def lost(models, motion):
        eta = np.tile(track.eta, (len(models), 1, 1))
        if motion.time[-1] < 0.99 * track.time[-1]:
            eta[3, -1, 0] = np.nan
        return eta

    monkeypatch.setattr(spread_of, "followed", lost)
    assert np.sort(d.spread(k, s, 0).margin)[0] == -np.inf
    with pytest.raises(InputError, match="leaves the basin"):
        d.checked(k, [s], 0)


def test_hidden_ships_of_the_benchmark_have_the_size_that_is_drawn(question):
    cell = next_run.Cell("cse1", ("X_|u|u",), 0)
    ship = next_run.hidden_ship(cell, question.data, 1.0)
    start, name = cell.start, "delta_X_absu_u"
    off = [ship.value(n) / start.value(n) - 1.0 for n in start.ship.coefficients if start.value(n)]
    assert 0.05 < np.abs(off).max() <= 0.1 + 1e-9
    data = question.data
    with_it = model_error(data, start.plus({name: ship.value(name) - start.value(name)}))
    share = next_run._rms(model_error(data, start) - with_it) / next_run._rms(commanded(data, start))
    assert SMALLEST < np.nanmax(share[:1]) < LARGEST
    half = next_run.hidden_ship(cell, data, 0.5)
    assert half.value(name) == pytest.approx(0.5 * ship.value(name))


def test_runs_needed_are_counted_at_first_and_for_all_larger_numbers():
    class FourRuns(next_pool.Pool):
        def __init__(self):
            self.runs = [SimpleNamespace(run=SimpleNamespace(name=n)) for n in "abcd"]

        def by(self, criterion, first):
            return [first, *(n for n in range(4) if n != first)]

        def error(self, chosen):
            return [3.0, 1.05, 1.2, 1.0][len(chosen) - 1]

    found = [*next_pool.rows(FourRuns(), 1, 0, lambda: None)]
    assert [r["order"] for r in found] == ["d-optimal", "a-optimal", "random"]
    assert {(r["first_near"], r["stays_near"]) for r in found} == {(2, 4)}
    assert {r["runs"][0] for r in found} == {found[0]["runs"][0]}


def test_the_loop_of_many_models_is_that_of_each_alone(designer):
    d, k = designer
    models = drawn(d.space, k, 0, np.random.default_rng(0))[:3]
    motion = d.motions([[PlanStep("legs", (0.5,) * NUMBERS, 20.0, 0.0)]], (1.0, 1.0), BRIEF)[0]
    short = PlannedMotion(*(x[:60] for x in (motion.time, motion.eta, motion.eta_dot, motion.eta_ddot)))
    together = followed(models, short)
    for n, model in enumerate(models):
        assert followed([model], short)[0] == pytest.approx(together[n], abs=1e-9)


@pytest.mark.slow
def test_no_simulated_ship_leaves_the_basin(designer):
    """A plan that keeps the basin with the spread of its draws keeps it with draws of another seed."""
    d, k = designer
    rng = np.random.default_rng(3)
    plans = (d.scored(k, [sequence(rng.random(2 * (NUMBERS + 2)), SECONDS)])[0] for _ in range(50))
    kept = next(s for s in plans if s.excess == 0.0 and d.spread(k, s, 0).margin.min() > 0.0)
    assert d.spread(k, kept, 99).margin.min() > 0.0


@pytest.mark.slow
def test_a_plan_is_written_and_its_scenario_runs(question, tmp_path, monkeypatch):
    monkeypatch.setattr(rehearsal.Rehearsal.sure, "__defaults__", (30,))  # draws, in place of 100
    plan = plan_next(question)
    assert plan.runs[0].sure > 0.9
    assert plan.runs[0].spread.margin.min() > 0.0
    assert plan.inseparable == []
    files = plan.write(tmp_path)
    assert sorted(files) == sorted(p.name for p in tmp_path.iterdir())
    stated = json.loads((tmp_path / "next.json").read_text())
    assert set(stated) >= {"runs", "inseparable"}
    assert set(stated["runs"][0]) >= {"scenario", "commands", "minutes", "sure"}
    result = cosim.simulate(tmp_path / "scenario_1.json", tmp_path / "run", stop=10.0, pictures=False)
    assert result.status == "done"
    assert result.metrics["e_pos_max"] < 0.2


@pytest.fixture
def folder(tmp_path):
    """Result of a diagnosis that does not state its runs."""
    (tmp_path / "diagnosis.json").write_text(json.dumps(content()))
    return tmp_path


def test_without_a_posterior_the_advice_is_that_of_the_diagnosis(folder):
    done = command(design_run.main, folder, "--out", folder / "plan")
    assert done.returncode == 0
    assert "run astern" in done.stdout
    stated = json.loads((folder / "plan" / "next.json").read_text())
    assert stated["runs"] == []
    assert stated["advice"] == [content()["effects"][0]["advice"]]


@pytest.mark.parametrize(
    ("task", "options", "words"),
    [
        (None, ["--minutes", "-1"], "minutes"),
        (None, ["--runs", "0"], "from 1 to 9"),
        ({"runs": []}, [], "task"),
        ({"runs": ["missing.csv"]}, [], "missing.csv"),
        (None, ["--criterion", "certanty"], "did you mean 'certainty'?"),
        (
            {"runs": ["missing.csv"]},
            ["--simulate", "nothere.ssv"],
            "no such parameter set: 'nothere.ssv'",
        ),
        ({"runs": ["missing.csv"]}, ["--basin", "6x"], "basin"),
        ({"runs": ["missing.csv"]}, ["--basin", "6x-4"], "basin"),
        ({"runs": ["missing.csv"]}, ["--basin", "none.json"], "none.json"),
    ],
)
def test_bad_input_is_one_message(folder, task, options, words):
    if task is not None:
        (folder / "posterior.json").write_text(json.dumps({"task": task}))
    done = command(design_run.main, folder, "--out", folder / "plan", *options)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert not (folder / "plan").exists()


def test_a_folder_without_a_diagnosis_is_named(tmp_path):
    (tmp_path / "log.json").write_text("{}")
    for given in (tmp_path, tmp_path / "log.json"):
        done = command(design_run.main, given, "--out", tmp_path / "plan")
        assert done.returncode == 2
        assert done.stderr.endswith(
            f"no diagnosis in '{given}': give the result folder of cybership learn\n"
        )


def test_parameters_of_an_fmu_without_its_runs_are_refused(tmp_path):
    stated = {"verdict": "ambiguous", "parameters": [], "effects": [], "possibilities": []}
    (tmp_path / "diagnosis.json").write_text(json.dumps(stated))
    done = command(design_run.main, tmp_path, "--out", tmp_path / "plan")
    assert done.returncode == 2
    assert "learn again" in done.stderr
    assert not (tmp_path / "plan").exists()


@pytest.mark.slow
@needs_compiler
def test_inputs_of_an_fmu_are_designed_for_its_parameters(tmp_path):
    """A run at one level does not determine mass and damper, the designed run does."""
    fmu = build_oscillator(tmp_path)
    playback = Playback(ConfinedFmu(FmuModel(fmu)), ["f"], ["x"])
    t, h = 0.05 * np.arange(201), 0.05
    force = np.where(t < 0.05, 1.0, 2.0)

    def outputs(values, force):
        return playback.run(PlaybackRequest(h, values, force[:-1, None])).outputs[:, 0]

    true = {"m": 2.1, "c": 11.0, "d": 0.9}
    x = outputs(true, force) + 0.05 * np.random.default_rng(0).standard_normal(t.size)
    pd.DataFrame({"time": t, "f": force, "x": x}).to_csv(tmp_path / "run.csv", index=False)
    each = [{"name": n, "value": v, "log": True, "prior": {"rel_std": 0.3}} for n, v in true.items()]
    (tmp_path / "parameters.json").write_text(json.dumps({"parameters": each}))
    options = ["--model", fmu, "--parameters", tmp_path / "parameters.json", "--out", tmp_path / "d"]
    assert command(learn.main, tmp_path / "run.csv", *options).returncode == 0
    done = command(design_run.main, tmp_path / "d", "--minutes", "0.5", "--out", tmp_path / "plan")
    assert done.returncode == 0, done.stderr
    stated = json.loads((tmp_path / "plan" / "next.json").read_text())
    assert stated["runs"][0]["commands"] == "commands_1.csv"
    table = pd.read_csv(tmp_path / "plan" / "commands_1.csv")
    assert table["f"].between(1.0, 2.0).all()
    assert table["time"].iloc[-1] == pytest.approx(30.0, abs=0.1)
    # The stated intervals are those of the slopes of the run that is written, added to the first.
    rows = []
    for name, value in true.items():
        low, high = ({**true, name: value * f} for f in (0.999, 1.001))
        both = [outputs(v, f) for f in (force, table["f"].to_numpy()) for v in (low, high)]
        slope = [(b - a) / (0.002 / 0.3) / 0.05 for a, b in (both[:2], both[2:])]
        rows.append(np.concatenate(slope))
    playback._fmu.close()
    J = np.column_stack(rows)
    std = np.sqrt(np.diag(np.linalg.inv(J.T @ J + np.eye(3))))
    for row, s, value in zip(stated["parameters"], std, true.values(), strict=True):
        before, after = row["half_width"]
        assert after < before
        assert after == pytest.approx(1.96 * 0.3 * value * s, rel=0.3)


def test_rivals_of_two_effects_are_pairs_of_candidates(question):
    two = content()
    two["effects"].append({**two["effects"][0], "id": "N_r", "indistinguishable": ["N_|r|r"]})
    prior = NominalPrior.of(question.start, question.prior)
    _, k = knowledge(question.data, question.start, prior, rivals(two))
    expected = {(x, n) for x in ("X_|u|u", "X_uu") for n in ("N_r", "N_|r|r")}
    assert {h.ids for h in k.hypotheses} == expected
    assert k.weights.sum() == pytest.approx(1.0)


def test_basins_by_size_and_by_file(tmp_path):
    assert limits_of(4.0, "6x4").size == (6.0, 4.0)
    assert limits_of(4.0, (6, 4)).size == (6.0, 4.0)
    file = tmp_path / "basin.json"
    file.write_text('{"north": [0, 10], "east": [-3, 3]}')
    assert limits_of(2.0, file).basin == Basin((0.0, 10.0), (-3.0, 3.0))
    for bad in ('{"north": [10, 0], "east": [-3, 3]}', '{"north": [0, 1]}', "{"):
        file.write_text(bad)
        with pytest.raises(InputError, match=r"basin\.json"):
            limits_of(2.0, file)


def test_a_basin_smaller_than_the_ship_and_an_unknown_criterion_are_refused(question):
    with pytest.raises(InputError, match="too small"):
        plan_next(replace(question, limits=Limits(SECONDS, size=(1.0, 1.0))))
    with pytest.raises(InputError, match="certainty"):
        plan_next(replace(question, criterion="certain"))
    with pytest.raises(InputError, match="minutes or more"):
        plan_next(replace(question, limits=Limits(5.0)))


def steered(name, amplitude):
    """A run of another ship at one thrust, with rudder or moment to both sides in turn, and its orders."""
    craft = ship_with((), name)
    t = np.arange(0.0, 120.0, 0.2) * craft.scale.time
    sign = np.where((t / (8.0 * craft.scale.time)) % 2.0 < 1.0, 1.0, -1.0)
    orders = np.zeros((t.size, len(craft.thrusters.inputs().request)))
    orders[:, 0], orders[:, -1] = amplitude[0], amplitude[1] * sign
    still = np.zeros((t.size, 3))
    (eta,) = followed([Model(ship=craft)], PlannedMotion(t, still, still, still, orders))
    eta += 0.002 * craft.scale.length * np.random.default_rng(0).standard_normal(eta.shape)
    names = ("tau_X", "tau_Y", "tau_N") if craft.description.allocates else craft.commands
    frame = pd.DataFrame(np.column_stack([t, eta, orders]), columns=["time", "x", "y", "psi", *names])
    model = Model(ship=craft)
    return Question(
        diagnosis.load(frame, model=model), content(others=("X_u",)), model, 0.1,
        Limits(120.0 * craft.scale.time, size=(200.0, 200.0)), ship=name,
    )  # fmt: skip


@pytest.fixture(
    scope="module",
    params=[("kvlcc2", (9.0, 0.15)), pytest.param(("otter", (60.0, 8.0)), marks=pytest.mark.slow)],
)
def steering(request):
    return prepared(steered(*request.param))


def test_a_ship_with_rudder_or_two_propellers_is_asked_what_it_can_do(steering):
    d, _ = steering
    assert set(d.library) == {"straight", "turn", "swing", "stop", "spiral", "order steps"}
    rng, craft = np.random.default_rng(1), d.model.ship
    for _ in range(2):
        plan = sequence(rng.random(2 * DIMENSIONS), d.limits.seconds, d.library)
        asked = d.motions([plan], (1.0, 1.0), BRIEF * d.scale)[0].orders
        if craft.description.allocates:
            assert not asked[:, 1].any()  # no force sideways
        else:
            low, high = np.array(craft.layout.limits(craft.nominal_drive.params)).T
            assert (asked >= low).all()
            assert (asked <= high).all()
            assert np.abs(asked[:, 1]).max() <= np.radians(35.0) + 1e-9


def test_steps_of_the_thrust_discriminate_what_one_speed_does_not(steering):
    d, k = steering
    steps = d.scored(k, [[PlanStep("straight", (0.0, 0.5, 1.0, 0.0, 0.0), d.limits.seconds, 0.0)]])[0]
    around = d.usual(k, "circle")
    assert steps.excess == around.excess == 0.0
    assert steps.score > around.score


@pytest.mark.parametrize("names", [None, ["rudder_delta", "propeller_n"]])
def test_a_planned_run_is_a_scenario_that_plays_its_table(names, tmp_path):
    """Set points and the force that they need, or orders, each to the input of its name."""
    rng, ship, h = np.random.default_rng(0), "kvlcc2" if names else None, 2.0 * LONGEST_STEP
    time = h * np.arange(51)
    eta, eta_dot, eta_ddot, tau = rng.standard_normal((4, time.size, 3))
    eta += [7034000.0, 569000.0, 0.0]  # in map coordinates set points are as fine
    orders = rng.standard_normal((time.size, 2)) if names else None
    motions = {
        ("steps", 0.5, h): SimpleNamespace(
            time=time,
            eta=eta,
            eta_dot=eta_dot,
            eta_ddot=eta_ddot,
            orders=orders,
            thrust=lambda m: m * tau,
        )
    }
    noise = np.array([0.01, 0.02, 0.003])
    d = SimpleNamespace(
        scale=2.0, model=3.0, motions=lambda plans, *how: [motions[(*plans, *how)]], limits=SimpleNamespace(seconds=2.0),
        orders=SimpleNamespace(names=names) if names else None,
        data=[SimpleNamespace(smoothed=SimpleNamespace(noise=noise))],
    )  # fmt: skip
    write_run(d, SimpleNamespace(steps="steps", size=0.5), 7, tmp_path, ship)
    table = pd.read_csv(tmp_path / "commands_7.csv")
    moves = [f"{n}_t{order}" for order in ("", "_dot", "_ddot") for n in ("x", "y", "psi")]
    shown = ["x", "y", "psi", *names] if names else [*moves, "tau_X", "tau_Y", "tau_N"]
    parts = [eta, orders] if names else [eta, eta_dot, eta_ddot, 3.0 * tau]
    assert [*table] == ["time", *shown]
    np.testing.assert_allclose(table, np.column_stack([time, *parts]), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(table.iloc[:, 1:3], eta[:, :2], rtol=0.0, atol=1e-3)
    scenario = cosim.load_scenario(tmp_path / "scenario_7.json")
    assert (scenario.name, scenario.step, scenario.stop) == ("next_7", h, 2.0)
    assert [*scenario.fmus["vessel"].parameters.values()] == [*eta[0]]
    (played,) = scenario.recordings
    given = "thrusters" if names else "controller"
    assert played.path == "commands_7.csv"
    assert played.inputs == {f"{given}.{name}": name for name in names or moves}
    (fault,) = scenario.faults
    assert fault.std == [*noise]
    assert "guidance" not in scenario.fmus


@pytest.mark.slow
@pytest.mark.parametrize("steering", [("kvlcc2", (9.0, 0.15))], indirect=True)
def test_orders_of_a_plan_give_its_track(steering, tmp_path):
    d, k = steering
    found = d.scored(k, [[PlanStep("swing", (0.5,) * NUMBERS, d.limits.seconds, 0.3)]])[0]
    write_run(d, found, 1, tmp_path, d.model.ship.name)
    scenario = tmp_path / "scenario_1.json"
    stop = 400 * json.loads(scenario.read_text())["step"]
    result = cosim.simulate(scenario, tmp_path / "run", stop=stop, pictures=False)
    assert result.status == "done"
    track = pd.read_csv(tmp_path / "commands_1.csv")
    log = pd.read_csv(tmp_path / "run" / "log.csv")
    # The likeliest model is hardly the nominal one, which the scenario has.
    assert np.interp(stop, track["time"], track["x"]) == pytest.approx(log["vessel.x"].iloc[-1], abs=0.5)
