"""The fit to predictions: its windows, the unrecorded force, the posterior, and the bands."""

import json
from dataclasses import replace
from functools import cache, partial
from itertools import count
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from scipy.linalg import expm
from support.measured import commands, sail, smoothed

from benchmarks.ship_effects import causes
from benchmarks.ship_effects import sail as sail_of
from diagnosis import Smoothed, load
from diagnosis.predictors import Model, ship_with, shooting, weak_windows
from diagnosis.predictors.prediction import WindowStarts, at_rest
from diagnosis.predictors.shooting import PARTS, Linear, Shooting
from diagnosis.predictors.weak_form import EVERY, HORIZON, WIDTH, kernel
from diagnosis.predictors.windows import Windows
from diagnosis.runs.run_constants import NEGLIGIBLE
from diagnosis.search.candidates import model_error
from diagnosis.search.findings import Finding, Findings, Suspect
from diagnosis.search.gram import block_folds
from diagnosis.search.prediction_fit import disturbance as pushes
from diagnosis.search.prediction_fit.disturbance import ForceDisturbance, covariance, estimate
from diagnosis.search.prediction_fit.disturbance_summary import Unrecorded, box, unrecorded
from diagnosis.search.prediction_fit.fit import PredictionFit, fit_to, shootings
from diagnosis.search.prediction_fit.joint_posterior import JointPosterior
from diagnosis.search.prediction_fit.refit import (
    RefitOutcome,
    fit_model_error,
    prediction_bands,
    to_predictions,
)
from diagnosis.search.prior import NominalPrior
from diagnosis.search.refinement import RefinedModel
from fmus.scale import REFERENCE

STEPS = {
    "N_r": 1e-3,
    "plant_F_vsp": 1e-3,
    "delta_X_u": 1e-3,
    "lag": 1e-2,
    "heading_offset": 1e-3,
    "marker_offset_dx": 1e-3,
    "position_lag": 1e-2,
    "heading_lag": 1e-2,
}
DRAG = -2.0  # N s/m, hidden
LIGHTLY_DAMPED = -0.62  # N m s/rad, hidden
DRAGGED = Model({"delta_X_u": DRAG})
NO_PUSH = ForceDisturbance(np.zeros(3), np.ones(3))


def pushed(t, axis, size, seconds=2.0):
    """The commands, with more on an axis for two seconds."""
    during = (t >= 30.0) & (t < 30.0 + seconds)
    return commands(t) + np.where(during, size, 0.0)[:, None] * np.eye(3)[axis]


def straight_on(t):
    """tau [N, N, N m] that hardly turns the ship."""
    return np.column_stack([0.2 + 0.05 * np.sin(0.05 * t), 0.0 * t, 0.0 * t])


def jolted(t, seed):
    """The same, and a moment of 0.08 N m that lasts a second, to either side, every 3 s on average."""
    rng = np.random.default_rng(seed)
    tau = straight_on(t)
    for start, sign in zip(
        np.cumsum(rng.exponential(3.0, 200)), rng.choice([-1.0, 1.0], 200), strict=True
    ):
        tau[(t >= start) & (t < start + 1.0), 2] += 0.08 * sign
    return tau


def test_what_is_given_and_the_air_are_means_over_each_step_of_each_window():
    """A value counts from halfway to the sample before to halfway to the next."""
    rng, h, steps = np.random.default_rng(0), 0.25, 6
    runs, tables, airs = [], {}, {}
    for name, n in (("a", 9), ("b", 12)):
        t = np.cumsum(rng.uniform(0.4, 0.9, n))
        tables[name] = SimpleNamespace(still=rng.normal(size=(n, 3)), slope=rng.normal(size=(n, 3, 6)))
        airs[name] = rng.normal(size=(n, 2)) if name == "a" else None
        track = SimpleNamespace(run=SimpleNamespace(name=name, power=None))
        runs.append((SimpleNamespace(time=t, track=track, air=airs[name]), np.array([0, 3])))
    starts = WindowStarts(tuple(runs), h, steps)
    windy = SimpleNamespace(given=tables, hull=SimpleNamespace(effects=SimpleNamespace(wind=0)))
    still, slope = starts.given(windy)
    air = starts.air(windy)
    assert still.shape == (steps, 3, 1, 4)
    assert slope.shape == (steps, 3, 6, 1, 4) or slope.shape == (steps, 6, 3, 1, 4)
    fine = (np.arange(2000) + 0.5) / 2000
    for w, (s, row) in enumerate((s, row) for s, rows in runs for row in rows):
        for k in range(steps):
            at = s.time[row] + h * (k + fine)
            near = np.abs(at[:, None] - s.time).argmin(axis=1)
            given = tables[s.track.run.name]
            assert still[k, :, 0, w] == pytest.approx(given.still[near].mean(axis=0), abs=5e-3)
            of = airs[s.track.run.name]
            expected = [0.0, 0.0] if of is None else of[near].mean(axis=0)
            assert air[k, :, 0, w] == pytest.approx(expected, abs=5e-3)
    assert starts.given(SimpleNamespace(given={})) is None
    calm = SimpleNamespace(hull=SimpleNamespace(effects=SimpleNamespace(wind=-1)))
    assert starts.air(calm) is None
    assert starts.power(0.0) is None


def test_power_settings_are_those_of_the_middle_of_each_step():
    t = np.arange(0.0, 5.0, 0.5)
    power = np.column_stack([t, 10.0 + t])
    runs = []
    for p in (power, None):
        track = SimpleNamespace(run=SimpleNamespace(power=p))
        runs.append((SimpleNamespace(time=t, track=track), np.array([2, 4])))
    found = WindowStarts(tuple(runs), 0.25, 3).power(0.2)
    middle = t[[2, 4]] + 0.25 * (np.arange(3)[:, None] + 0.5) - 0.2
    expected = np.floor(middle / 0.5) * 0.5
    assert found[:, 0, :2] == pytest.approx(expected)
    assert found[:, 1, :2] == pytest.approx(10.0 + expected)
    assert (found[:, :, 2:] == 1.0).all()


@cache
def windows():
    return Shooting([smoothed(sail()[0])], HORIZON)


@cache
def hidden():
    """A run of a ship with more drag than the model has."""
    return weak_windows(smoothed(sail(ship={"delta_X_u": DRAG})[0]))


@cache
def as_modelled():
    return weak_windows(smoothed(sail()[0]))


@cache
def fitted():
    prior = NominalPrior.of(Model(), {"damping": 0.1})
    at = RefinedModel(Model(), np.zeros(prior.size), {"delta_X_u": -0.5}, np.zeros((1, 1)))
    return fit_to(PredictionFit([hidden()], shootings([hidden()], Model()), at, prior), at), prior


def test_model_without_a_stretch_is_fitted_to_the_others():
    fit, _ = fitted()
    drags = [m.value("delta_X_u") for m in fit.fold_models]
    assert len(drags) == len(block_folds([hidden()]))
    assert 0.0 < np.ptp(drags) < 0.2 * abs(DRAG)
    assert drags == pytest.approx([fit.estimate.values["delta_X_u"]] * len(drags), rel=0.2)


@pytest.mark.quick
def test_slopes_are_those_of_one_model_after_the_other():
    around = windows().around(Model(), STEPS)
    first = windows().residuals(Model())
    np.testing.assert_allclose(around.residuals, first, rtol=0.0, atol=1e-12)
    for k, (name, step) in enumerate(STEPS.items()):
        alone = (first - windows().residuals(Model().plus({name: step}))) / step
        np.testing.assert_allclose(around.slopes[..., k], alone, rtol=0.0, atol=1e-9)
        assert np.abs(alone).max() > 1e-3


def test_pose_that_is_seen_is_the_mean_of_the_samples_in_reach():
    s = smoothed(sail()[0])
    rows = np.flatnonzero(s.used)[100:130]
    one, noise = shooting._seen(s, s.time[rows][None], 1e-6)
    np.testing.assert_allclose(shooting._off(one, s.track.pose[rows][None]), 0.0, atol=1e-12)
    np.testing.assert_allclose(noise[0], np.tile(s.noise**2, (30, 1)))
    h = s.time[1] - s.time[0]
    _, three = shooting._seen(s, s.time[rows][None], 1.5 * h)
    assert s.used[99:131].all()
    np.testing.assert_allclose(three[0], np.tile(s.noise**2 / 3.0, (30, 1)))
    _, none = shooting._seen(s, s.time[rows][None] + 0.5 * h, 1e-6)
    assert (none > 1e3 * noise).all()


@pytest.mark.parametrize(("start", "end"), [(4.0, 6.0), (0.5, 1.5), (9.0, 10.5)])
def test_box_is_found_by_its_means_over_windows(start, end):
    """Also where it begins before the first window's middle, or ends after the last one's."""
    width, every, size = 3.0, 0.5, 0.7
    middle = np.arange(1.0, 10.01, every)
    s = np.linspace(-1.0, 1.0, 3001)
    kernel = (1.0 - s * s) ** 3 / ((1.0 - s * s) ** 3).sum()
    times = middle[:, None] + 0.5 * width * s
    error = size * ((times >= start) & (times < end)) @ kernel
    w = SimpleNamespace(middle=middle, width=width, every=every)
    found = box(w, np.ones(middle.size, bool), error)
    assert found == pytest.approx((start, end, size), abs=0.01)


def test_predictions_do_not_depend_on_what_was_predicted_before():
    """What thrusters do is kept for models whose thrusters respond alike, and for no other."""
    data = [smoothed(sail(20.0)[0])]
    kept, late = Shooting(data, HORIZON), Model(thrusters={"lag": 2.0})
    first, second = kept.residuals(late), kept.residuals(Model())
    np.testing.assert_array_equal(second, Shooting(data, HORIZON).residuals(Model()))
    np.testing.assert_array_equal(kept.residuals(late), first)
    assert np.abs(first - second).max() > 1e-3


@pytest.mark.quick
def test_coarse_steps_predict_what_fine_ones_do():
    run = smoothed(sail(noise=0.0)[0])
    coarse = Shooting([run], HORIZON).residuals(Model(vessel={"N_r": -0.6}))[:, -1]
    fine = Windows([run])
    last = np.flatnonzero(np.diff(fine.sample_window, append=-1))
    exact = fine.residuals(Model(vessel={"N_r": -0.6}))[last]
    assert np.abs(exact).max() > 0.05
    np.testing.assert_allclose(coarse, exact, atol=0.02 * np.abs(exact).max())


@cache
def zigzag(half=750):
    """A tanker whose rudder goes to and fro every so many samples."""
    ship = ship_with((), "kvlcc2")
    way = ((10.0, 0.3 if k % (2 * half) < half else -0.3) for k in count())
    log = sail_of(ship, causes(ship)["none"], np.random.default_rng(1), None, way, seconds=90.0)
    (w,) = load(log, model=Model(ship=ship))
    return w.smoothed, Model(ship=ship)


@pytest.mark.parametrize(("half", "longest"), [(750, True), (23, False)])
def test_steps_are_short_where_commands_change_within_them(half, longest):
    """The drag of a rudder that changes sides within a step is not that of its mean angle."""
    run, model = zigzag(half)
    found, coarse = Shooting.accurate([run], 20.0, model), Shooting([run], 20.0)
    assert (found.parts == PARTS) == longest
    exact = coarse.in_parts(32 * PARTS).residuals(model)
    size = np.sqrt(np.mean(exact**2))
    near, far = (np.sqrt(np.mean((s.residuals(model) - exact) ** 2)) / size for s in (found, coarse))
    assert near < 2.0 * NEGLIGIBLE
    assert (far < 2.0 * NEGLIGIBLE) == longest


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_difference_of_velocity_goes_on_as_the_motion_about_a_prediction(axis):
    """With the rudder's damping: without it a tanker of this kind turns away ever faster."""
    run, model = zigzag()
    step = np.array([1e-2, 1e-2, 1e-3])[axis]
    psi, zero = run.eta[:, 2], np.zeros(run.time.size)
    ways = [
        (np.cos(psi), np.sin(psi), zero),
        (-np.sin(psi), np.cos(psi), zero),
        (zero, zero, zero + 1.0),
    ]
    other = replace(run, eta_dot=run.eta_dot + step * np.column_stack(ways[axis]))
    of, beside = (Shooting([r], 20.0) for r in (run, other))
    poses = [s.measured - s.residuals(model) for s in (of, beside)]
    found = (poses[1] - poses[0]) / step
    off = []
    for slopes, moved in zip(of.around(model, {}).motion.slope, found, strict=True):
        state, expected = np.eye(6)[3 + axis], []
        for F in slopes:
            state = expm(of.every * F) @ state
            expected.append(state[:3])
        size = np.abs(expected).max(axis=0)
        off.append(np.sqrt(np.mean(np.square((moved - expected) / size), axis=0)))
    assert np.median(off, axis=0).max() < 0.05, "but for a window in which the ship only begins to move"


def test_lasting_push_moves_a_ship_at_rest_by_half_the_acceleration_times_time_squared():
    slope = np.zeros((1, 8, 6, 6))
    slope[:, :, [0, 1, 2], [3, 4, 5]] = 1.0
    motion = Linear(slope, np.diag([0.1, 0.2, 0.5]), 0.25)
    V = covariance(
        motion, np.zeros((1, 6, 6)), ForceDisturbance(np.array([1.0, 2.0, 3.0]), np.full(3, 1e9))
    )
    moved = 0.5 * np.array([0.1, 0.4, 1.5]) * 2.0**2
    np.testing.assert_allclose(np.sqrt(np.diag(V[0, -1, :, -1])), moved, rtol=1e-5)
    at_half = V[0, 3, :, -1] / V[0, -1, :, -1].diagonal()
    np.testing.assert_allclose(at_half.diagonal(), 0.25, rtol=1e-5)


def test_unrecorded_force_stays_as_large_as_it_is_and_is_forgotten_in_its_time():
    push, every = ForceDisturbance(np.array([1.0, 2.0, 3.0]), np.array([0.2, 2.0, 12.0])), 0.5
    motion = Linear(np.zeros((1, 3, 6, 6)), np.zeros((3, 3)), every)
    over, added = pushes._steps(motion, push)
    kept = over[0, 0, 6:, 6:]
    assert kept == pytest.approx(np.diag(np.exp(-every / push.time)), rel=1e-6)
    size = np.diag(push.size**2)
    assert (kept @ size @ kept.T + added[0, 0, 6:, 6:]).diagonal() == pytest.approx(
        push.size**2, rel=1e-3
    )
    assert not added[0, 0, :6, :6].any(), "nothing else is pushed"
    apart = ForceDisturbance(np.array([[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]]), push.time)
    _, each = pushes._steps(Linear(np.zeros((2, 3, 6, 6)), np.zeros((3, 3)), every), apart)
    assert each[0] == pytest.approx(added[0])
    assert not each[1].any()


def runs_with(variance):
    """The disturbance of six runs of some speeds, by its variance over the square of the speed."""
    speed = np.array([0.05, 0.1, 0.2, 0.3, 0.4, 0.5])
    each = [ForceDisturbance(np.sqrt(variance(v**2)), np.ones(3)) for v in speed]
    whole = ForceDisturbance(np.sqrt(np.mean([d.size**2 for d in each], axis=0)), np.ones(3))
    return whole.growing(each, speed), each, speed


def test_a_disturbance_grows_with_speed_as_far_as_runs_show_it():
    shares = np.array([0.0, 0.5, 1.0])  # of each axis, of what grows
    found, each, speed = runs_with(lambda square: 4.0 * (1.0 - shares + shares * square / 0.09))
    assert (np.diff(found.growth) > 0.2).all()
    assert found.growth[0] == pytest.approx(0.0, abs=1e-9)
    assert found.growth[2] > 0.7  # one run at rest is assumed in addition
    assert found.at(np.array([found.speed])).size[0] == pytest.approx(found.size)
    true = np.array([d.size for d in each])
    off, constant = (np.abs(s - true).mean(axis=0) for s in (found.at(speed).size, found.size))
    assert (off[1:] < 0.5 * constant[1:]).all()


def test_runs_of_one_speed_or_none_show_no_growth_of_a_disturbance():
    one = ForceDisturbance(np.full(3, 2.0), np.ones(3))
    for speed in (np.full(3, 0.2), np.zeros(3)):
        found = one.growing([one] * 3, speed)
        assert found.growth == pytest.approx(np.zeros(3), abs=1e-9)
    assert one.at(np.array([0.0, 3.0])).size == pytest.approx(np.full((2, 3), 2.0))


@pytest.mark.parametrize("scale", [1e-3, 0.3, 20.0])
def test_exponential_of_matrices_is_that_of_scipy(scale):
    A = scale * np.random.default_rng(0).normal(size=(4, 2, 5, 5)) - scale * 2.0 * np.eye(5)
    assert pushes._exponential(A) == pytest.approx(expm(A), rel=1e-7, abs=1e-9)
    assert pushes._exponential(np.zeros((3, 3))).tolist() == np.eye(3).tolist()


@pytest.mark.parametrize("beyond", [np.nan, np.inf, 1e4])
def test_exponential_of_what_runs_away_is_not_known_and_others_are(beyond):
    A = np.random.default_rng(0).standard_normal((2, 3, 3, 3))
    A[1, 2, 0, 0] = beyond
    found = pushes._exponential(A)
    assert np.isnan(found[1, 2]).all()
    A[1, 2], found[1, 2] = 0.0, np.eye(3)
    assert found == pytest.approx(expm(A), rel=1e-7, abs=1e-9)


def test_covariance_of_a_windows_mean_is_the_double_integral():
    t = np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, 401)
    w = kernel(2.0 * t / WIDTH)
    w /= w.sum()
    for k in (0, 12, 24):
        for lag in (0, 3, 12):
            away = np.abs(lag * EVERY + t[:, None] - t)
            whole = w @ np.exp(-away / pushes.TIMES[k]) @ w
            assert pushes.OF_FORCE[k, lag] == pytest.approx(whole, rel=0.02, abs=1e-6)
    assert (np.diff(pushes.OF_FORCE[:, 0]) > 0.0).all(), "the slower, the less its mean is over a window"
    assert pushes.OF_NOISE[0] == 1.0
    apart = np.arange(pushes.OF_NOISE.size) * EVERY >= WIDTH
    assert pushes.OF_NOISE[apart] == pytest.approx(0.0, abs=1e-4), "windows without a sample in common"


def test_initial_state_alone_gives_its_own_covariance():
    start = np.diag([1.0, 2.0, 0.0, 0.1, 0.0, 0.5])[None]
    slope = np.zeros((1, 4, 6, 6))
    slope[:, :, [0, 1, 2], [3, 4, 5]] = 1.0
    V = covariance(Linear(slope, np.eye(3), 0.5), start, NO_PUSH)
    np.testing.assert_allclose(np.diag(V[0, -1, :, -1]), [1.0 + 0.4, 2.0, 2.0], atol=1e-12)


@pytest.mark.quick
def test_push_is_recovered_from_what_it_leaves_in_the_windows():
    """An Ornstein-Uhlenbeck series of 0.1 N that lasts 2 s, seen through the windows of 32 runs."""
    w, rng = hidden(), np.random.default_rng(3)
    t = w.run.time
    keep = np.exp(-(t[1] - t[0]) / 2.0)
    errors = []
    for _ in range(32):
        force = np.zeros((t.size, 3))
        force[0] = 0.1 * rng.standard_normal(3)
        for k, e in enumerate(0.1 * np.sqrt(1.0 - keep**2) * rng.standard_normal((t.size - 1, 3)), 1):
            force[k] = keep * force[k - 1] + e
        errors.append(w.held @ force)
    found = estimate([w] * 32, np.concatenate(errors), np.zeros((32 * w.middle.size, 3)))
    np.testing.assert_allclose(found.size, 0.1, rtol=0.15)
    np.testing.assert_allclose(found.time, 2.0, rtol=0.5)


def test_noise_alone_is_no_push():
    std = np.full((hidden().middle.size, 3), 0.01)
    assert pushes.OF_NOISE[0] == 1.0
    assert abs(pushes.OF_NOISE[round(3.0 / EVERY) :]).max() < 1e-4
    error = 0.01 * np.random.default_rng(1).standard_normal(std.shape)
    assert estimate([hidden()], error, std).size.max() < 0.005


@pytest.mark.quick
def test_fit_finds_what_was_hidden_within_its_interval():
    fit, prior = fitted()
    k = list(fit.names).index("delta_X_u")
    found, std = fit.estimate.values["delta_X_u"], np.sqrt(fit.covariance[k, k])
    assert abs(found - DRAG) < 3.0 * std
    assert std < 0.5
    before = Windows([hidden().smoothed]).errors(Model()).over_all()[0]
    after = Windows([hidden().smoothed]).errors(fit.estimate.model(prior)).over_all()[0]
    assert after < 0.1 * before


@pytest.mark.quick
def test_an_effect_that_predictions_take_back_to_nothing_is_none():
    """Of commands that are logged late, so that the thrusters seem to act before they are told to."""
    run = sail(ship={"delta_X_u": DRAG})[0]
    w = weak_windows(smoothed(replace(run, tau_cmd=np.roll(run.tau_cmd, 3, axis=0))))
    values = {"delta_X_u": -0.5, "lag": 0.3}
    names = {"X_u": "delta_X_u", "lag": "lag"}
    prior = NominalPrior.of(Model(), 0.0)
    at = RefinedModel(Model(), np.zeros(prior.size), values, np.zeros((2, 2)))
    effects = [Finding(i, {n: values[n]}, {}, 0.9, [], 0.5, 0.5, Model()) for i, n in names.items()]
    learned = to_predictions(Findings(effects, estimate=at, searched=prior), [w], prior, True).findings
    assert [f.id for f in learned.effects] == ["X_u"]
    assert learned.effects[0].model is learned.model
    assert learned.model.value("lag") == 0.0
    assert learned.model.value("delta_X_u") == pytest.approx(DRAG, rel=0.2)


def test_where_the_values_of_the_search_stay_coefficients_are_off_by_the_prior_of_the_fit():
    """The search takes each as known to a tenth, so that its own standard deviations are others."""
    stated = NominalPrior.of(Model(), 0.5)
    tenth = {n: min(s, 0.1 * abs(stated.mean[n])) for n, s in stated.std.items()}
    searched = replace(stated, std=tenth)
    wide = max(stated.std, key=lambda n: stated.std[n] / searched.std[n])
    assert stated.std[wide] == pytest.approx(5.0 * searched.std[wide])
    off = 4.0 * searched.std[wide]
    found = Findings(
        suspects=[Suspect(wide, 4.0, searched.mean[wide] + off)], moved={wide: 4.0}, searched=searched
    )
    nothing = Unrecorded(NO_PUSH, {}, [])
    kept = RefitOutcome(Findings(), JointPosterior.nothing(), nothing).about(found, stated).findings
    assert not found.plausible
    assert kept.plausible
    assert kept.moved == {wide: pytest.approx(0.8)}
    assert kept.suspects[0].z == pytest.approx(off / stated.std[wide])
    assert kept.suspects[0].value == found.suspects[0].value


@pytest.mark.slow
def test_moment_that_lasts_a_second_does_not_pass_for_less_damping():
    """0.08 N m for a second, every 3 s on average, nobody's, and hardly a command beside it.

    The rate is correlated with it: the fit to the model error is off by more than its interval, that to
    predictions is not, and says that something unrecorded acts.
    """
    data = []
    for seed in (1, 2, 3):
        run = sail(300.0, 0.1, {"N_r": LIGHTLY_DAMPED}, seed=seed, given=partial(jolted, seed=seed))[0]
        data.append(weak_windows(smoothed(replace(run, tau_cmd=straight_on(run.time)))))
    prior = NominalPrior.of(Model(), 0.0)
    at = RefinedModel(Model(), np.zeros(prior.size), {"delta_N_r": 0.0}, np.zeros((1, 1)))
    for _ in range(2):  # the second time with what the first leaves as noise
        sigma = np.sqrt(np.mean(model_error(data, at.model(prior)) ** 2, axis=0))
        at, std = fit_model_error(at, sigma, data, prior)
    fit = fit_to(PredictionFit(data, shootings(data, Model()), at, prior), at)
    true = LIGHTLY_DAMPED - Model().value("N_r")
    assert at.values["delta_N_r"] - true > 3.0 * std["delta_N_r"]
    found, error = fit.estimate.values["delta_N_r"], np.sqrt(fit.covariance[0, 0])
    assert abs(found - true) < 1.96 * error
    assert error < 0.1 * abs(LIGHTLY_DAMPED)
    assert fit.disturbance.size[2] > 10.0 * fit.disturbance.size[:2].max()


def test_a_factor_of_all_forces_and_masses_is_known_by_the_prior_alone():
    """It changes no motion: however precise the measurement, its uncertainty is that of the prior.

    The weighed mass stays, and added masses take its part: their prior is wide.
    """
    model = Model()
    data, prior = [weak_windows(smoothed(sail(noise=1e-2)[0]))], NominalPrior.of(model)
    at = RefinedModel.at(model, prior)
    problem = PredictionFit(data, shootings(data, model), at, prior)
    fit = fit_to(problem, at)
    changes = {n: model.value(n) for n in problem.names} | dict.fromkeys(
        ("m", "I_z", "plant_l_vsp", "plant_l_bow"), 0.0
    )
    for of, mass in {"X_udot": "m", "Y_vdot": "m", "N_rdot": "I_z"}.items():
        changes[of] = model.value(of) - model.value(mass)
    factor = np.array([changes[n] for n in problem.names]) / problem.unit
    by_prior = 1.0 / (factor @ problem.precision @ factor)
    weight = factor @ problem.precision * by_prior / problem.unit
    assert by_prior**0.5 > 0.03
    assert weight @ fit.covariance @ weight == pytest.approx(by_prior, rel=0.02)
    known = problem.information(fit.estimate)
    alone = known.power(problem.precision) * np.diag(known.H) * factor**2
    assert alone.max() > 1e6 / by_prior, "with all others known, one coefficient is known far better"


def test_posterior_has_total_values_by_the_names_of_the_fmus(tmp_path):
    fit, prior = fitted()
    posterior = JointPosterior.of(fit, prior)
    posterior.write(tmp_path / "posterior.json")
    read = json.loads((tmp_path / "posterior.json").read_text())
    mean = dict(zip(read["names"], read["mean"], strict=True))
    assert mean["vessel.N_r"] == pytest.approx(fit.estimate.model(prior).value("N_r"))
    assert read["units"][read["names"].index("vessel.m")] == "kg"
    assert np.linalg.eigvalsh(read["covariance"]).min() > -1e-12
    drag, own = (read["names"].index(f"vessel.{n}") for n in ("delta_X_u", "X_u"))
    assert posterior.correlation[drag, own] < -0.1  # the sum is what the data know


def test_value_that_an_effect_and_a_coefficient_are_of_stands_once_as_their_sum():
    fit, prior = fitted()
    names = ["X_u", "m", "X_u"]
    covariance = np.array([[4.0, 0.1, -3.0], [0.1, 1.0, 0.2], [-3.0, 0.2, 9.0]])
    posterior = JointPosterior.of(replace(fit, names=names, covariance=covariance), prior)
    assert posterior.names == ["vessel.X_u", "vessel.m"]
    np.testing.assert_allclose(posterior.covariance, [[7.0, 0.3], [0.3, 1.0]])


def test_pair_that_is_correlated_at_98_percent_is_known_only_together():
    covariance = np.array([[1.0, 0.98 * 3.0, 0.0], [0.98 * 3.0, 9.0, 0.1], [0.0, 0.1, 4.0]])
    posterior = JointPosterior(["vessel.a", "vessel.b", "vessel.c"], ["1"] * 3, np.zeros(3), covariance)
    assert posterior.together == [["vessel.a", "vessel.b"]]
    assert posterior.std == {"a": 1.0, "b": 3.0, "c": 2.0}


def test_bands_hold_what_they_say_and_widen_with_a_push():
    fit, prior = fitted()
    run, model = hidden().smoothed, fit.estimate.model(prior)
    posterior, seen = JointPosterior.of(fit, prior), Windows([hidden().smoothed])
    narrow = prediction_bands(run, seen, model, posterior, fit.disturbance)
    wide = prediction_bands(
        run, seen, model, posterior, ForceDisturbance(np.full(3, 0.5), np.full(3, 2.0))
    )
    assert narrow is not None
    assert wide is not None
    residuals = seen.residuals(model)
    assert 0.75 < narrow.coverage(residuals) <= 1.0
    assert narrow.coverage(residuals, 0.5) < narrow.coverage(residuals)
    assert wide.coverage(residuals) > 0.99
    assert narrow.coverage(residuals + np.ones(3)) < 0.01
    assert wide.ellipses(0, 0.9).shape[::2] == (narrow.since.size, 2)
    assert prediction_bands(run, None, model, posterior, fit.disturbance) is None


def test_fits_that_differ_are_told():
    w, some = hidden(), ForceDisturbance(np.array([0.1, 0.0, 0.1]), np.ones(3))
    agree = unrecorded([w], DRAGGED, some, {}).sentence
    assert "0.1 N in surge over 1 s, 0.1 N m in yaw" in agree
    assert "sway" not in agree
    differ = unrecorded([w], DRAGGED, some, {"N_r": (-0.1, -0.6)}).sentence
    assert "more than their intervals in N_r" in differ
    assert "more than their intervals" not in agree


@pytest.mark.parametrize(("axis", "size"), [(2, 0.3), (0, -1.0)])
def test_push_at_a_time_is_told_with_time_axis_and_size(axis, size):
    run = sail(given=partial(pushed, axis=axis, size=size))[0]
    w = weak_windows(smoothed(replace(run, tau_cmd=commands(run.time))))
    (found,) = unrecorded([w], Model(), NO_PUSH, {}).stretches
    assert (found.run, found.axis) == (w.run.name, "XYN"[axis])
    assert (found.start, found.end) == pytest.approx((30.0, 32.0), abs=0.5)
    assert found.size * (found.end - found.start) == pytest.approx(2.0 * size, rel=0.2)


@pytest.mark.quick
def test_blow_that_may_be_a_jump_of_the_pose_is_not_told():
    run = sail(given=partial(pushed, axis=2, size=2.0, seconds=0.3))[0]
    w = weak_windows(smoothed(replace(run, tau_cmd=commands(run.time))))
    assert not unrecorded([w], Model(), NO_PUSH, {}).stretches


def test_run_without_a_push_tells_of_none():
    found = [
        unrecorded([as_modelled()], Model(), NO_PUSH, {}),
        unrecorded([hidden()], DRAGGED, NO_PUSH, {}),
    ]
    assert not any(f.stretches for f in found)
    assert "No disturbance" in found[0].sentence


@pytest.mark.parametrize(
    ("first", "later", "rests"),
    [
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), True),  # nothing happens
        ((-0.14, 0.01, 0.01), (0.6, 0.0, 0.1), True),  # smoothed ahead of the first push
        ((1.0, 0.02, 0.1), (0.9, 0.05, 0.3), False),  # under way
        ((0.3, 0.0, 0.0), (0.1, 0.0, 0.0), False),  # it slows down
        ((0.0, 0.2, 0.0), (0.6, 0.2, 0.0), False),  # it drifts, and is pushed ahead
    ],
)
def test_a_ship_is_at_rest_if_it_is_idle_or_its_speeds_only_begin(first, later, rests):
    time = np.arange(0.0, 20.0, 0.1)
    nu = np.array(first) + np.minimum(time / 3.0, 1.0)[:, None] * np.subtract(later, first)
    smoothed = SimpleNamespace(time=time, nu=nu, nu_std=np.full((time.size, 3), 0.02), scale=REFERENCE)
    assert at_rest(cast(Smoothed, smoothed)) is rests
