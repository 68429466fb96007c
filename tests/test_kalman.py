"""The Kalman observer: better than the other observers, right about forces, and never lost for good."""

import math
import random

import numpy as np
import pytest
from support.cases import slow
from support.ccode import stepped
from support.project import COMPONENTS, with_values

import cosim
from fmus.declare import flatten, packer
from fmus.hull import Damping, Hull, Inertia, inverse_mass, motion
from fmus.observer.axis import MOST_DISTURBANCE, DisturbedAxis, NoiseLearning, later, rates, taken
from fmus.signals import Force
from thesis.monte_carlo import shipped, vary, without
from thesis.observers.estimates_replayed import LOGGED, OBSERVERS, SIGNALS, errors, observer, replay

KALMAN = COMPONENTS["observer_kalman"]
NAN = math.nan
HIDDEN = {
    "drag": {"vessel.delta_X_u": -4.0},
    "rotational damping": {"vessel.delta_Y_r": 7.25, "vessel.delta_N_r": 1.0},
}


def params(**changes):
    return with_values(KALMAN, **changes)


def log_of(scenario, folder, stop, frozen=True, **parameters):
    content = vary(
        shipped(scenario), parameters=parameters, stop=stop, log={"signals": LOGGED}, metrics={}
    )
    if not frozen:
        content["faults"] = without(content["faults"], "freeze")
    assert cosim.simulate(cosim.load_scenario(content), folder).status == "done"
    return cosim.read_log(folder)


def beats_all_others(log, most=1.0, most_dot=0.8):
    """Its error over the least of the others': of every velocity, and of every acceleration."""
    found = {name: errors(log, replay(observer(name), log)) for name in OBSERVERS}
    ours = found.pop("kalman")
    for signal in SIGNALS:
        best = min(error[signal] for error in found.values())
        assert ours[signal] < (most_dot if signal.endswith("dot") else most) * best, signal


def run(rows, p=None, h=0.01):
    """Estimates for rows of x_m, y_m, psi_m, tau_X, tau_Y, tau_N."""
    law = stepped(KALMAN, p or params(), packer(KALMAN.inputs)(rows[0]))
    pack = packer(KALMAN.outputs)
    return [pack(law.advance(row, h)) for row in rows[1:]]


def ship(seconds, tau, extra=(0.0, 0.0, 0.0), h=0.01, noise=2e-4, seed=0):
    """Measurements, true velocities and true accelerations of the nominal hull.

    ``tau`` is a function of time, known to the observer; ``extra`` a force that it is not told.
    """
    rng = random.Random(seed)
    vessel = COMPONENTS["vessel"]
    body, pack = stepped(vessel, vessel.params(), Force()), packer(vessel.outputs)
    rows, nu, nu_dot = [], [], []
    for k in range(round(seconds / h)):
        known = tau(k * h)
        out = pack(body.advance([*map(sum, zip(known, extra, strict=True))], h))
        x, y, psi = out.pose
        psi = math.remainder(psi + rng.gauss(0, 1.5 * noise), math.tau)
        rows.append([x + rng.gauss(0, noise), y + rng.gauss(0, noise), psi, *known])
        nu.append(out.velocity[:3])
        nu_dot.append((out.u_dot, out.v_dot, out.r_dot))
    return rows, np.array(nu), np.array(nu_dot)


def pushes(t):
    """A force that keeps the ship moving on all axes."""
    return 0.4 + 0.4 * math.sin(0.5 * t), 0.3 * math.sin(0.37 * t), 0.05 * math.cos(0.9 * t)


def velocity_error(estimates, nu, rows=slice(None)):
    found = np.array([e[3:6] for e in estimates])
    return float(np.abs(found - nu[1 : len(found) + 1])[rows].max())


@pytest.mark.parametrize(
    ("hidden", "frozen"),
    [case if case[0] == "drag" else slow(case) for case in zip(HIDDEN, (False, True), strict=True)],
)
def test_best_of_all_observers_on_the_same_log(hidden, frozen, tmp_path):
    """Rich motion with noise: every velocity and acceleration, model right or wrong."""
    beats_all_others(log_of("rich", tmp_path, 60.0, frozen, **HIDDEN[hidden]), most=0.5)


@pytest.mark.slow
def test_best_of_all_observers_in_gentle_motion_with_a_wrong_model(tmp_path):
    """Here an observer without a model hardly lags, and the disturbance is barely above the noise."""
    hidden = {"vessel.delta_Y_r": 7.25, "vessel.delta_N_ur": -2.0}
    beats_all_others(log_of("ellipse", tmp_path, 60.0, False, **hidden))


@pytest.mark.slow
def test_as_good_as_the_model_where_the_model_is_right(tmp_path):
    """Gentle motion, where all is noise: nothing is lost by not trusting the model."""
    log = log_of("eight", tmp_path, 60.0)
    ours, model = (errors(log, replay(observer(name), log)) for name in ("kalman", "luenberger"))
    for signal in SIGNALS:
        assert ours[signal] < (0.5 if signal.endswith("dot") else 1.0) * model[signal], signal


def test_unknown_force_is_found_as_a_disturbance():
    """Its acceleration, M^-1 times the force, is in nu_dot from then on."""
    extra = (0.3, -0.2, 0.02)
    rows, nu, nu_dot = ship(20.0, lambda t: (0.5, 0.0, 0.0), extra)
    last = run(rows)[-1]
    assert last[6:9] == pytest.approx(nu_dot[-1], abs=2e-3)
    without = motion(
        *last[3:6], Force(0.5, 0.0, 0.0), Hull(Inertia(), inverse_mass(Inertia()), Damping())
    )
    assert np.abs(np.subtract(nu_dot[-1], without)).max() > 0.015
    assert last[3:6] == pytest.approx(nu[-1], abs=1e-3)


def test_without_measurement_it_is_the_model_and_then_a_ship_at_rest():
    rows, nu, _ = ship(40.0, pushes, noise=1e-6)
    lost = [row if k < 1000 else [NAN, NAN, NAN, *row[3:]] for k, row in enumerate(rows)]
    estimates = run(lost)
    assert estimates[1200].frozen == 1.0
    assert velocity_error(estimates, nu, slice(1000, 1250)) < 0.005
    assert max(map(abs, estimates[-1][3:9])) < 1e-3, "the model alone is unstable"
    assert math.dist(estimates[-1][:2], estimates[999][:2]) < 1.0


def test_measurement_that_comes_back_is_believed_at_once():
    rows, nu, _ = ship(30.0, pushes)
    lost = [[NAN, NAN, NAN, *row[3:]] if 800 <= k < 2000 else row for k, row in enumerate(rows)]
    estimates = run(lost)
    assert estimates[2000][:2] == pytest.approx(rows[2001][:2], abs=0.005)
    assert velocity_error(estimates, nu, slice(2300, None)) < 0.005


def test_spike_is_left_out_and_a_new_place_is_believed():
    rows, nu, _ = ship(20.0, pushes)
    calm = run(rows)
    spiked = [list(row) for row in rows]
    for k in (900, 1100, 1101, 1102):
        spiked[k][0] += 0.3
    estimates = run(spiked)
    assert max(abs(a.u_hat - b.u_hat) for a, b in zip(estimates, calm, strict=True)) < 1e-3
    moved = [[row[0] + (2.0 if k >= 1000 else 0.0), *row[1:]] for k, row in enumerate(rows)]
    estimates = run(moved)
    assert estimates[1010].x_hat == pytest.approx(rows[1011][0], abs=0.01)
    assert estimates[1040].x_hat == pytest.approx(rows[1041][0] + 2.0, abs=0.01)
    assert velocity_error(estimates, nu, slice(1400, None)) < 0.01


def test_freeze_leaves_no_spike_in_the_acceleration():
    """Of a whole second, and with a force that the model does not know."""
    rows, nu, nu_dot = ship(30.0, pushes, (0.2, 0.1, 0.0))
    frozen = [list(row) for row in rows]
    for k in range(2000, 2100):
        frozen[k][:3] = rows[1999][:3]
    estimates = run(frozen)
    assert [e.frozen for e in estimates[1997:2102]] == [0.0, 0.0, *[1.0] * 100, 0.0, 0.0, 0.0]
    error = np.abs(np.array([e[6:9] for e in estimates]) - nu_dot[1:])
    assert error[1990:2200].max() < 0.02
    assert velocity_error(estimates, nu, slice(1990, 2200)) < 0.005


@pytest.mark.parametrize("every", [5, 10])
def test_measurement_slower_than_the_step(every):
    """20 Hz and 10 Hz measurements held for a 100 Hz observer are neither freezes nor believed twice."""
    rows, nu, nu_dot = ship(30.0, pushes)
    held = [[*rows[k - k % every][:3], *row[3:]] for k, row in enumerate(rows)]
    estimates = run(held, params(measurement_period=0.01 * every))
    assert not any(e.frozen for e in estimates[every:])
    assert velocity_error(estimates, nu, slice(1000, None)) < 0.003
    assert np.abs(np.array([e[6:9] for e in estimates]) - nu_dot[1:])[1000:].max() < 0.02


def test_long_steps():
    rows, nu, nu_dot = ship(60.0, pushes, h=0.1)
    estimates = run(rows, params(measurement_period=0.1), 0.1)
    assert velocity_error(estimates, nu, slice(200, None)) < 0.004
    assert np.abs(np.array([e[6:9] for e in estimates]) - nu_dot[1:])[200:].max() < 0.02


def test_heading_is_continuous_over_many_turns():
    rows, nu, _ = ship(200.0, lambda t: (0.1, 0.0, 0.3))
    estimates = run(rows)
    turned = np.array([e.psi_hat for e in estimates])
    assert turned[-1] > 4.0 * math.pi
    assert np.abs(np.diff(turned)).max() < 0.02
    assert velocity_error(estimates, nu, slice(1000, None)) < 0.005


@pytest.mark.parametrize("seed", range(3))
def test_whatever_comes_in_what_goes_out_is_finite_and_recovers(seed):
    rng = random.Random(seed)
    wild = [NAN, math.inf, -math.inf, 0.0, 1e308, -1e308, 1e154, -1e30, 1e3, -7.0, 5e-324]
    rows, nu, _ = ship(20.0, pushes)
    hurt = [
        [rng.choice(wild) if 200 <= k < 800 and rng.random() < 0.5 else x for x in row]
        for k, row in enumerate(rows)
    ]
    estimates = run(hurt)
    assert all(math.isfinite(x) for e in estimates for x in e)
    assert velocity_error(estimates, nu, slice(1500, None)) < 0.005


def test_ship_at_rest_is_harmless():
    estimates = run([[5.0, 2.0, 1.0, 0.0, 0.0, 0.0]] * 1500)
    assert all(e[:3] == pytest.approx((5.0, 2.0, 1.0), abs=1e-9) for e in estimates)
    assert max(abs(x) for e in estimates for x in e[3:9]) < 1e-9


@pytest.mark.parametrize("h", [0.01, 0.1])
def test_covariance_is_that_of_the_matrices(h):
    """F P F^T + Q and (I - K H) P, with a noise that does not change."""
    drift, noise, T = 0.02, 1e-6, 5.0
    k = rates(NoiseLearning(change_time=T, alert=0.0), h, h)
    F = np.eye(4) + np.diag([h] * 3, 1) + np.diag([0.5 * h * h] * 2, 2)
    F[3, 3] = T / (T + h)
    H = np.array([[1.0, 0.0, 0.0, 0.0]])
    P, axis = np.diag([1.0, 0.01, 0.0025, 0.0]), DisturbedAxis()
    for _ in range(50):
        P = F @ P @ F.T + np.diag([0.0, 0.0, 0.0, h * drift * drift + k.noise * axis.variance])
        K = P @ H.T / (P[0, 0] + noise)
        P = (np.eye(4) - K @ H) @ P
        axis, position, velocity = taken(later(axis, drift, k, h), 1e-5, noise, k)
        assert (position, velocity) == pytest.approx(tuple(1e-5 * K[:2, 0]), rel=1e-6)
    assert axis.covariance == pytest.approx(P[np.triu_indices(4)], rel=1e-6)


@pytest.mark.parametrize("seed", range(2))
def test_covariance_stays_one(seed):
    """Positive semidefinite and bounded, however odd the innovations and long the pauses."""
    rng = random.Random(seed)
    k, axis = rates(NoiseLearning(), 0.01, 0.01), DisturbedAxis()
    for _ in range(3000):
        for _ in range(rng.choice([1, 1, 1, 100])):
            axis = later(axis, 1e-4, k, 0.01)
        axis, _, _ = taken(axis, rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-8, 2), 4e-8, k)
        P = np.zeros((4, 4))
        P[np.triu_indices(4)] = axis.covariance
        P += np.triu(P, 1).T
        scale = 1.0 / np.sqrt(np.maximum(np.diag(P), 1e-30))
        assert np.linalg.eigvalsh(P * scale[:, None] * scale).min() > -1e-6
        assert all(map(math.isfinite, flatten(axis)))
        assert abs(axis.d) <= MOST_DISTURBANCE
        assert axis.covariance.vv + axis.covariance.dd < 1e4


def filtered(disturbance, seconds, h=0.01):
    """An axis after it has seen positions [m] of a body under an unknown acceleration [m/s2]."""
    rng, k, axis = random.Random(0), rates(NoiseLearning(), h, h), DisturbedAxis()
    x = v = x_hat = v_hat = 0.0
    for j in range(round(seconds / h)):
        known = axis.d + 0.5 * h * axis.slope
        x_hat, v_hat = x_hat + h * v_hat + 0.5 * h * h * known, v_hat + h * known
        axis = later(axis, 2.4e-5, k, h)
        a = disturbance((j + 0.5) * h)
        x, v = x + h * v + 0.5 * h * h * a, v + h * a
        axis, dx, dv = taken(axis, x + rng.gauss(0, 2e-4) - x_hat, 4e-8, k)
        x_hat, v_hat = x_hat + dx, v_hat + dv
    return axis


def test_disturbance_that_swings_is_followed_and_one_that_is_constant_is_smoothed():
    """What is learnt of it, and what the gain then is, differ by orders of magnitude."""
    swinging = filtered(lambda t: 0.02 * math.sin(0.5 * t), 40.0)
    assert swinging.d == pytest.approx(0.02 * math.sin(20.0), abs=0.003)
    assert swinging.variance == pytest.approx(0.5 * 0.01**2, rel=0.7)
    constant = filtered(lambda t: 0.02, 40.0)
    assert constant.d == pytest.approx(0.02, abs=5e-4)
    assert constant.variance < 0.01 * swinging.variance
    assert constant.covariance.dd < 0.05 * swinging.covariance.dd
