"""The window prediction error: at the level of noise for the right model, large for a wrong one."""

import subprocess
import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm
from support.cases import in_part
from support.closed_form import Allocation, allocate
from support.cse1 import ASIDE, FIVE, THRUSTERS
from support.measured import DATA, NOISE, changed, needs_data, sail, smoothed

from diagnosis import InputError, Model, Windows, read
from diagnosis.predictors import DescribedShip, omega, weak_windows
from diagnosis.predictors.prediction import at_constant_velocities
from diagnosis.predictors.ship_model import SampledForce, parameters
from diagnosis.predictors.uncertainty import omega_std
from diagnosis.predictors.weak_form import HORIZON
from diagnosis.predictors.windows import free_runs

# The first window starts where the smoother sees one side only: a velocity error of a millimetre a second.
POSITION, HEADING, USUAL = 6e-3, 4e-3, 1.5e-3
WITHOUT_NOISE = 1e-3  # m, rad; what the smoother leaves of a run without noise and without an effect


@cache
def base():
    """The run that is varied."""
    return sail()[0]


def smooth_base():
    return smoothed(base())


def windows_of(*runs):
    return Windows([smoothed(run) for run in runs])


def rms(windows, **models):
    return [float(x) for x in windows.errors(Model(**models)).over_all()]


@pytest.mark.numerical
def test_right_model_errs_by_noise():
    errors = windows_of(base()).errors()
    assert errors.run.tolist() == [0] * 8
    np.testing.assert_allclose(errors.start, 8.0 * np.arange(8))
    assert errors.samples.sum() == 3200 - smooth_base().counts.spikes
    position, heading = errors.over_all()
    assert np.hypot(*NOISE[:2]) * 0.95 < position < POSITION
    assert NOISE[2] * 0.95 < heading < HEADING
    assert np.median(errors.position) < USUAL


def test_without_noise_almost_nothing_is_left():
    position, heading = rms(windows_of(sail(noise=0.0)[0]))
    assert position < WITHOUT_NOISE
    assert heading < WITHOUT_NOISE


HIDDEN = [
    ({"delta_X_u": -4.0}, {}),
    ({"mass": 3.0}, {}),
    ({"V_n": 0.03}, {}),
    ({"marker_offset_dx": 0.05, "marker_offset_dy": -0.03}, {}),
    ({}, {"bow_failure_time": 20.0}),
    ({}, {"lag": 0.5}),
    ({}, {"delay": 0.4}),
]


@pytest.mark.parametrize(("ship", "thrusters"), in_part(HIDDEN, keep=[HIDDEN[k] for k in (0, 2, 3, 6)]))
def test_hidden_effect_is_seen_and_its_value_takes_it_away(ship, thrusters):
    windows = windows_of(sail(ship=ship, thrusters=thrusters, noise=0.0)[0])
    before, _ = rms(windows)
    after, heading = rms(windows, vessel=ship, thrusters=thrusters)
    assert before > 8e-3
    assert after < WITHOUT_NOISE, "numbers and initial states, nothing else"
    assert heading < 5e-4


@pytest.mark.numerical
def test_hidden_drag_is_seen_through_noise():
    windows = windows_of(sail(ship={"delta_X_u": -4.0})[0])
    before, after = windows.errors(), windows.errors(Model(vessel={"delta_X_u": -4.0}))
    assert before.over_all()[0] > 0.1
    assert after.over_all()[0] < POSITION
    assert np.median(after.position) < USUAL


@pytest.mark.numerical
def test_constant_velocities_are_an_arc():
    """By the exponential of the twist, and by a ship that keeps its velocities indeed."""
    ((starts, _),) = windows_of(base()).groups
    found = at_constant_velocities(starts)[:, :, 0]
    for k, ((smoothed_run, rows),) in enumerate([starts.runs] * 3):
        x, y, psi = smoothed_run.eta[rows[k]]
        u, v, r = smoothed_run.nu[rows[k]]
        c, s = np.cos(psi), np.sin(psi)
        first = np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])
        twist = np.array([[0.0, -r, u], [r, 0.0, v], [0.0, 0.0, 0.0]])
        for step in (0, 1, starts.steps):
            there = first @ expm(starts.h * step * twist)
            np.testing.assert_allclose(found[step, :2, k], there[:2, 2], atol=1e-9)
            assert found[step, 2, k] == pytest.approx(psi + r * starts.h * step)


@pytest.mark.parametrize("r", [0.0, 0.15])
def test_a_ship_in_a_steady_turn_keeps_its_velocities_and_one_that_manoeuvres_does_not(r):
    run = base()
    psi = r * run.time
    x = 0.3 * run.time * np.sinc(psi / np.pi)
    y = 0.3 * run.time * np.sinc(0.5 * psi / np.pi) * np.sin(0.5 * psi)
    noise = np.array(NOISE) * np.random.default_rng(0).standard_normal((run.time.size, 3))
    steady = windows_of(replace(run, pose=np.column_stack([x, y, psi]) + noise))
    position, heading = map(float, steady.errors_at_constant_velocities().over_all())
    assert position < POSITION
    assert heading < HEADING
    sailed = windows_of(run).errors_at_constant_velocities().over_all()
    assert sailed[0] > 10.0 * POSITION
    assert sailed[1] > 10.0 * HEADING


def test_several_models_at_once_are_each_one_alone():
    drag, lag = np.array([[-4.0], [0.0], [-1.0]]), np.array([[0.0], [0.3], [0.5]])
    many = windows_of(base()).errors(Model({"delta_X_u": drag}, {"lag": lag}))
    assert many.position.shape == (3, 8)
    for k in range(3):  # the history is as long as the slowest of them needs
        one = windows_of(base()).errors(Model({"delta_X_u": drag[k, 0]}, {"lag": lag[k, 0]}))
        np.testing.assert_allclose(many.position[k], one.position, rtol=1e-3)
        np.testing.assert_allclose(many.heading[k], one.heading, rtol=1e-3)
        np.testing.assert_allclose(many.over_all()[0][k], one.over_all()[0], rtol=1e-3)


def test_several_runs_at_once_are_each_one_alone():
    other = smoothed(sail(40.0, h=0.05, seed=2)[0])
    together = Windows([other, smooth_base(), other]).errors(Model(vessel={"delta_X_u": -1.0}))
    assert together.run.tolist() == [0] * 5 + [1] * 8 + [2] * 5
    for k, run in enumerate((other, smooth_base())):
        alone = Windows([run]).errors(Model(vessel={"delta_X_u": -1.0}))
        np.testing.assert_allclose(together.position[together.run == k], alone.position, rtol=1e-9)
        assert together.over_all(k) == pytest.approx(alone.over_all())


def test_runs_with_models_of_their_own_are_predicted_as_alone():
    """Hull, effects, thrusters and lags differ; runs of one step are predicted at once."""
    runs = [smoothed(sail(40.0, h=h, seed=seed)[0]) for seed, h in ((2, 0.05), (3, 0.05), (4, 0.02))]
    models = [
        Model({"delta_X_u": -1.0, "N_r": -0.7}, {"plant_F_vsp": 0.9}),
        Model({"delta_X_u": 0.5, "body_bias_Y": 0.1}, {"lag": 0.3}),
        Model(),
    ]
    alone = [Windows([run]) for run in runs]
    together = Windows(runs)
    found = together.residuals_by_run(models)
    expected = [w.residuals(m) for w, m in zip(alone, models, strict=True)]
    np.testing.assert_allclose(found, np.concatenate(expected), atol=1e-12)
    assert not np.allclose(found, together.residuals_by_run(models[:1] * 3), atol=1e-4)


def test_values_of_one_run_hold_in_it_alone():
    made = [replace(sail(40.0, h=0.05, seed=k)[0], name=name) for k, name in enumerate("abc")]
    runs, model = [smoothed(run) for run in made], Model(runs={"b": {"plant_F_vsp": 0.5}})
    nominal, learned = DescribedShip(Model()).residuals(Windows(runs), [model])
    expected = [
        Windows([run]).residuals(model.during(name)) for run, name in zip(runs, "abc", strict=True)
    ]
    np.testing.assert_allclose(learned, np.concatenate(expected), atol=1e-12)
    differs = ~np.isclose(nominal, learned, atol=1e-9).all(axis=1)
    assert {*Windows(runs).run[Windows(runs).sample_window[differs]]} == {1}


def test_what_windows_keep_of_a_model_serves_no_other_one():
    """As windows do that have seen none, whatever two models differ in."""
    smooth = smooth_base()
    still, name = np.zeros((smooth.time.size, 3)), smooth.track.run.name
    pulls = [SampledForce(still, np.full((len(still), 3, 6), x)) for x in (-4.0, 4.0)]
    parts = [{"vessel": ship, "thrusters": thrusters} for ship, thrusters in HIDDEN]
    parts += [{"runs": {name: {"plant_F_vsp": x}}} for x in (0.5, 0.8)]
    parts += [{"given": {name: pull}} for pull in pulls] + [{"measurement": {"clock_offset": 0.1}}, {}]
    models, seen = [Model(**part) for part in parts], weak_windows(smooth)
    fresh = [(omega(w, m), omega_std(w, m)) for m in models for w in [weak_windows(smooth)]]
    for m, (error, std) in [*zip(models, fresh, strict=True)] * 2:
        np.testing.assert_array_equal(omega(seen, m), error)
        np.testing.assert_array_equal(omega_std(seen, m), std)
    assert len({error.tobytes() + std.tobytes() for error, std in fresh}) == len(models)


def test_no_sample_is_further_than_a_window_from_its_start():
    since = (
        np.concatenate([smooth_base().time[smooth_base().used]])
        - windows_of(base()).start[windows_of(base()).sample_window]
    )
    assert since.min() == 0.0
    assert since.max() < HORIZON


def test_remainder_is_dropped():
    part = Windows([smoothed(base().rows(np.arange(3199)))])
    np.testing.assert_allclose(part.start, 8.0 * np.arange(7))


@pytest.mark.parametrize(("rows", "begins"), [(3199, 0.2), (3200, 0.0)], ids=["remainder", "none"])
def test_the_first_window_begins_in_the_remainder_where_the_velocity_is_known(rows, begins):
    run = smoothed(base().rows(np.arange(rows)))
    std = run.nu_std.copy()
    std[:10, 0] = 0.1  # m/s, 0.8 m in a window
    unsure = Windows([replace(run, nu_std=std)])
    assert unsure.start[0] == pytest.approx(begins)
    assert unsure.start.size == Windows([run]).start.size


def test_windows_without_first_sample_or_half_of_them_are_skipped():
    run = changed(base(), 400, np.nan)  # the first of the second window
    run = changed(run, slice(801, 1000), np.nan)  # 199 of 400
    run = changed(run, np.r_[1201:1301, 1400:1501], np.nan)  # 201 of 400
    windows = windows_of(run)
    np.testing.assert_allclose(windows.start, [0.0, 16.0, 32.0, 40.0, 48.0, 56.0])
    gone = base().rows(np.setdiff1d(np.arange(3200), np.r_[400:405, 1201:1301, 1400:1501]))
    np.testing.assert_allclose(windows_of(gone).start, [0.0, 16.0, 32.0, 40.0, 48.0, 56.0])


def test_run_of_which_no_window_is_left_is_refused():
    row = np.arange(3200) % 400
    run = changed(base(), np.flatnonzero((row > 0) & (row < 202)), np.nan)  # 201 of each 400
    with pytest.raises(InputError, match="no window of 8 s has enough samples"):
        windows_of(run)


def test_frozen_and_wild_samples_do_not_count():
    run = changed(base(), slice(1000, 1030), base().pose[999])
    rows = [50, 700, 2000]
    run = changed(run, rows, base().pose[rows] + 0.5)
    errors = windows_of(run).errors()
    assert errors.samples.sum() <= 3200 - 33
    assert errors.over_all()[0] < POSITION
    assert np.median(errors.position) < USUAL


def test_uneven_time_stamps_do_little_harm():
    run, _ = sail(h=0.01, noise=0.0)
    keep = np.sort(np.random.default_rng(0).permutation(run.time.size)[: run.time.size // 2])
    windows = windows_of(run.rows(keep))
    assert np.diff(run.time[keep]).max() > 0.04
    # With half of the samples half of the commands are lost, and the others held too long.
    assert rms(windows)[0] < 4e-3
    assert rms(windows, vessel={"delta_X_u": -4.0})[0] > 0.05


def test_log_that_is_faster_than_its_measurement():
    run, _ = sail(h=0.01, noise=0.0)
    slow = run.pose[np.arange(run.time.size) // 5 * 5]
    windows = windows_of(replace(run, pose=slow))
    assert windows.run.size == 8
    assert windows.errors().samples.tolist() == [160] * 8
    assert rms(windows)[0] < 1e-3


def test_effects_of_a_user_can_still_be_loaded_after_the_package():
    code = "import sys, diagnosis; assert 'fmus.vessel.vessel' not in sys.modules; diagnosis.Windows"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_time_may_start_anywhere():
    later = replace(base(), time=base().time + 1.0e6)
    position, heading = rms(windows_of(later))
    assert (position, heading) == pytest.approx(rms(windows_of(base())), rel=0.02)


def test_five_commands_of_two_equal_propellers_are_three_commands_of_one_of_twice_the_force():
    shares = np.column_stack(allocate(*base().tau_cmd.T, Allocation(F_vsp=2.33)))
    five = np.column_stack([shares[:, :2], shares[:, :2], shares[:, 2]])
    run = replace(base(), commands=five, signals=FIVE)
    for thrusters in ({}, {"lag": 0.3}, {"loss_bow": 0.4}, {"delay": 0.2}):
        three = rms(windows_of(base()), thrusters=thrusters)
        assert rms(windows_of(run), thrusters=thrusters) == pytest.approx(three, rel=1e-6)


def test_propellers_that_differ_turn_the_ship():
    five = np.zeros((base().time.size, 5))
    five[:, 0], five[:, 2] = 0.2, -0.2
    pure = np.zeros_like(base().tau_cmd)
    pure[:, 2] = 0.4 * 1.165 * ASIDE[1]
    turning = windows_of(replace(base(), tau_cmd=pure, commands=five, signals=FIVE))
    moment = windows_of(replace(base(), tau_cmd=pure))
    np.testing.assert_allclose(turning.residuals(), moment.residuals(), atol=1e-9)


def test_model_that_runs_away_is_infinitely_wrong():
    errors = windows_of(base()).errors(Model(vessel={"delta_X_u": 300.0, "delta_X_uuu": 1e4}))
    assert np.isinf(errors.position).all()
    assert np.isinf(errors.over_all()[0])
    assert np.isinf(errors.over_all(0)[1]) or errors.over_all(0)[1] >= 0.0


def test_half_the_power_is_half_the_force():
    """Five commands at a power that is told, and at full power of thrusters that are weaker."""
    shares = np.column_stack(np.clip(allocate(*base().tau_cmd.T, Allocation()), -1.0, 1.0))
    five = np.column_stack([shares[:, :2], shares])
    full = replace(base(), commands=five, signals=FIVE)
    weaker = replace(full, power=np.tile([0.5, 0.25], (base().time.size, 1)))
    thrusters = {"plant_F_vsp": 0.5 * 1.165, "plant_F_bow": 0.25 * 2.629}
    strong = smoothed(full)  # the same motion of both
    weak = replace(strong, track=replace(strong.track, run=weaker))
    assert rms(Windows([weak])) == pytest.approx(rms(Windows([strong]), thrusters=thrusters), rel=1e-9)
    _, (whole,) = free_runs(weak, [Model()])  # in plain numbers
    _, (other,) = free_runs(strong, [Model(thrusters=thrusters)])
    np.testing.assert_allclose(whole, other, atol=1e-9)


def test_unknown_parameter_names_the_nearest():
    with pytest.raises(InputError, match="vessel has no parameter 'delta_X_v'; did you mean 'delta_X_"):
        windows_of(base()).errors(Model(vessel={"delta_X_v": 1.0}))
    with pytest.raises(InputError, match="thrusters has no parameter 'lagg'; did you mean 'lag'"):
        windows_of(base()).errors(Model(thrusters={"lagg": 1.0}))


def test_defaults_are_the_nominal_model():
    assert parameters(THRUSTERS, {}) == THRUSTERS.params()


@pytest.mark.slow
@needs_data
def test_measured_runs_are_predicted():
    runs = [smoothed(read(path)) for path in sorted((DATA / "cse1").glob("*.mat"))]
    windows = Windows(runs)
    assert set(windows.run) == {0, 1, 2, 3}
    nominal, delayed = (
        windows.errors(),
        windows.errors(Model(thrusters={"delay": 0.3, "plant_F_vsp": 0.6})),
    )
    for k in range(4):
        assert 0.02 < nominal.over_all(k)[0] < 1.0, "the nominal model is far from the real ship"
    assert delayed.over_all()[0] < nominal.over_all()[0]


def test_a_heading_in_degrees_is_known_by_the_way_of_a_ship_that_turns_slowly():
    """Neither its rate nor its steps are too large for radians; one that circles in radians is read."""
    run, _ = sail(64.0, 0.1)
    t = run.time
    psi = 2.0 + 0.05 * t
    course = np.column_stack([np.cos(psi), np.sin(psi)])
    place = np.cumsum(0.2 * course, axis=0) * 0.1
    degrees = np.column_stack([place, np.degrees(psi)])
    with pytest.raises(InputError, match=r'only in degrees .*"unit": "deg"'):
        windows_of(replace(run, pose=degrees))
    windows_of(replace(run, pose=np.column_stack([place, psi + 2.0 * np.pi])))
    astern = np.column_stack([-place, psi + 2.0 * np.pi])
    windows_of(replace(run, pose=astern))
    spinning = np.column_stack([0.2 * t, 0.1 * t, 0.2 * t])  # while it drifts on a line
    windows_of(replace(run, pose=spinning))
