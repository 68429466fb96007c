"""Backstepping and its adaptation: Lyapunov's inequality, and parameters found."""

import math

import numpy as np
import pytest
from support import loops
from support.ccode import stepped
from support.cse1 import VESSEL
from support.project import COMPONENTS

from fmus.controller import abs as abs_module
from fmus.controller import bs, pid
from fmus.controller.adaptive import Disturbance
from fmus.controller.backstepping import FeedbackGains, Inputs, control_errors, tracking_energy
from fmus.controller.models import ROTATIONAL, ROTATIONAL_GAINS
from fmus.declare import flatten, packer
from fmus.frames import rotate_to_body
from fmus.hull import Damping, Inertia, RotationalDamping, Terms, mass_matrix
from fmus.signals import Estimate, Force, Target
from fmus.vessel import vessel
from thesis.basin_trials.trials import SOFT

ABS = abs_module.COMPONENT
Params = ABS.params
TRUE_PHI = RotationalDamping()
H = 0.002


def test_gains_are_those_of_table_5_1():
    assert {f"K_{name}": gain for name, gain in SOFT.items()} == FeedbackGains()._asdict()


@pytest.mark.parametrize("name", ["controller_cl_win_eps_scaled", "controller_cl_improved"])
def test_samples_of_what_a_lag_would_spoil_are_smoothed_over_two_seconds(name):
    assert COMPONENTS[name].params().samples.smoothing == 2.0
    assert COMPONENTS["controller_cl_win_eps"].params().samples.smoothing == 0.0


def true_estimate(s, nu_dot=(0.0, 0.0, 0.0)):
    """What an observer without error would say."""
    return Estimate(*s[:6], *nu_dot, 0.0)


def rich_target(t):
    """A target with several frequencies in every axis, and its derivatives."""
    terms = [  # axis, amplitude, frequency
        (0, 0.5, 0.11), (0, 0.2, 0.31), (1, 0.5, 0.13), (1, 0.2, 0.37), (2, 1.0, 0.17), (2, 0.5, 0.43),
    ]  # fmt: skip
    value, rate, acceleration = [0.0] * 3, [0.0] * 3, [0.0] * 3
    for axis, a, w in terms:
        value[axis] += a * math.sin(w * t)
        rate[axis] += a * w * math.cos(w * t)
        acceleration[axis] -= a * w * w * math.sin(w * t)
    return Target(*value, *rate, *acceleration)


def closed_loop(component, params, seconds, h=H, start=None, plant=None):
    """Yield (time, vessel state, controller with its state, inputs, outputs), with true states fed back."""
    plant = plant or VESSEL.params()
    s, pack = start or vessel.State(), packer(component.outputs)
    law = stepped(component, params, Inputs(true_estimate(s), rich_target(0.0)))
    b = VESSEL.prepare(plant).hull
    for k in range(round(seconds / h)):
        i = Inputs(true_estimate(s), rich_target(k * h))
        out = pack(law.advance(flatten(i), h))
        yield k * h, s, law, i, out
        s = vessel.integrate(s, Force(*out.tau), b, h)


def lyapunov(i, gains):
    """V2 of (4.8)."""
    z, _ = control_errors(i.estimate, i.target, gains)
    z1, z2 = np.array(z[:3]), np.array(z[3:])
    M = np.array(mass_matrix(Inertia()))
    return 0.5 * z1 @ z1 + 0.5 * z2 @ M @ z2


@pytest.mark.parametrize("seed", range(3))
def test_the_energy_that_controllers_report_is_that_of_the_thesis(seed):
    """V2 of (4.8), whose mass matrix is not diagonal; each product has a value of its own."""
    pose, nu = np.random.default_rng(seed).uniform(-0.5, 0.5, (2, 3))
    i = Inputs(true_estimate(vessel.State(*pose, *nu)), rich_target(3.0))
    z, _ = control_errors(i.estimate, i.target, bs.Params().gains)
    assert tracking_energy(z, Inertia()) == pytest.approx(lyapunov(i, bs.Params().gains))


@pytest.mark.parametrize("seed", range(2))
def test_lyapunov_function_decays_with_perfect_knowledge(seed):
    rng = np.random.default_rng(seed)
    start = vessel.State(*map(float, rng.uniform(-0.5, 0.5, 6)))
    params = bs.Params(phi=ROTATIONAL.start(*TRUE_PHI))
    history = [
        (t, lyapunov(i, params.gains))
        for t, _, _, i, _ in closed_loop(bs.COMPONENT, params, 20.0, start=start)
    ]
    values = np.array([v for _, v in history])
    # The force is held over a step, which costs a little of the order of the step.
    assert (np.diff(values) <= 5e-3 * H * values[:-1] + 1e-8).all()
    assert values[-1] < 1e-3 * values[0]


def test_decay_rate_is_that_of_the_gains():
    """V2_dot = -z1' Kp z1 - z2' Kd z2, (4.13), at one instant."""
    params = bs.Params(phi=ROTATIONAL.start(*TRUE_PHI))
    start = vessel.State(0.3, -0.2, 0.4, 0.1, -0.05, 0.2)
    h = 1e-5
    loop = closed_loop(bs.COMPONENT, params, 2 * h, h, start)
    (_, _, _, i0, out), (_, _, _, i1, _) = list(loop)
    slope = (lyapunov(i1, params.gains) - lyapunov(i0, params.gains)) / h
    z1, z2 = np.array(out.errors[:3]), np.array(out.errors[3:])
    expected = -z1 @ (np.array(params.gains[:3]) * z1) - z2 @ (np.array(params.gains[3:]) * z2)
    assert slope == pytest.approx(expected, rel=1e-3)


def test_adaptation_recovers_known_parameters_under_rich_motion():
    """Y_r and N_r unknown, the rest known: both are found."""
    phi = ROTATIONAL.start(*TRUE_PHI)._replace(phi_0_2=0.0, phi_0_6=0.0)
    gamma = ROTATIONAL.gamma(0.0, 400.0, 0.0, 0.0, 0.0, 100.0, 0.0, 0.0)
    params = Params(phi=phi, gamma=gamma)
    *_, (_, _, law, _, _) = closed_loop(ABS, params, 200.0, 0.01)
    assert list(law.state.phi_hat) == pytest.approx(list(TRUE_PHI), rel=0.02)


@pytest.mark.slow
def test_adaptation_approaches_four_unknown_parameters():
    """r and |r|r are alike at the same yaw rates, so this takes long: the error falls to a seventh."""
    only = RotationalDamping(Y_absr_v=0.0, Y_absv_r=0.0, N_absr_v=0.0, N_absv_r=0.0)
    plant = VESSEL.params(damping=Damping(Terms()._replace(**only._asdict())))
    gamma = ROTATIONAL.gamma(0.0, 1000.0, 0.0, 8000.0, 0.0, 250.0, 0.0, 4000.0)
    params = Params(gamma=gamma)
    *_, (_, _, law, _, _) = closed_loop(ABS, params, 600.0, 0.01, plant=plant)
    error = np.linalg.norm(np.subtract(law.state.phi_hat, only))
    assert error < np.linalg.norm(only) / 7.0


def test_lyapunov_function_with_adaptation_does_not_grow():
    gamma = np.array(ROTATIONAL_GAINS)
    params = Params()
    values = []
    for _, _, law, i, _ in closed_loop(ABS, params, 20.0, start=vessel.State(x=0.3, r=0.2)):
        error = np.array(TRUE_PHI) - np.array(law.state.phi_hat)
        values.append(lyapunov(i, params.gains) + 0.5 * error @ (error / gamma))
    growth = np.diff(values)
    assert growth.max() <= 1e-5
    assert values[-1] < values[0]


def test_earth_fixed_force_is_found():
    disturbance = Disturbance(2.0, 2.0, 1.0)
    params = Params(
        phi=ROTATIONAL.start(*TRUE_PHI), gamma=ROTATIONAL.gamma(*[0.0] * 8), disturbance=disturbance
    )
    force = (0.2, -0.1, 0.0)
    *_, (_, _, law, _) = loops.closed_loop(
        ABS, params, 200.0, 0.01, lambda k, h: rich_target(k * h), vessel.State(), earth=force
    )
    assert law.state.omega[:2] == pytest.approx(force[:2], abs=0.02)


def test_force_is_the_sum_of_its_parts_and_omega_hat_is_the_models():
    s = vessel.State(0.1, 0.2, 0.3, 0.1, 0.05, -0.2)
    params = bs.Params(phi=ROTATIONAL.start(*TRUE_PHI))
    _, out = bs.COMPONENT.step(bs.State(), Inputs(true_estimate(s), rich_target(3.0)), params, H)
    linear = (out.tau_lin_X, out.tau_lin_Y, out.tau_lin_N)
    nonlinear = (out.tau_nonlin_X, out.tau_nonlin_Y, out.tau_nonlin_N)
    assert tuple(out.tau) == pytest.approx([a + b for a, b in zip(linear, nonlinear, strict=True)])
    _, plant = VESSEL.step(s, Force(), VESSEL.params(), 0.0)
    assert (out.omega_hat_Y, out.omega_hat_N) == pytest.approx((plant.omega_star_Y, plant.omega_star_N))


@pytest.mark.parametrize("turns", [-3, -1, 1, 7])
def test_whole_turns_of_heading_change_nothing(turns):
    s, t = vessel.State(0.1, 0.2, 3.1, 0.1, 0.0, 0.1), rich_target(0.0)._replace(psi_t=-3.1)
    _, here = bs.COMPONENT.step(bs.State(), Inputs(true_estimate(s), t), bs.Params(), H)
    turned = s._replace(psi=s.psi + turns * math.tau)
    _, there = bs.COMPONENT.step(bs.State(), Inputs(true_estimate(turned), t), bs.Params(), H)
    assert tuple(there.tau) == pytest.approx(tuple(here.tau), abs=1e-9)
    assert abs(here.errors.z1_psi) < 0.1


def test_without_gains_adaptive_is_plain_backstepping():
    gamma = ROTATIONAL.gamma(*[0.0] * 8)
    s = vessel.State(0.1, 0.2, 0.3, 0.1, 0.05, -0.2)
    i = Inputs(true_estimate(s), rich_target(1.0))
    state = ABS.init(i, Params())
    _, a = ABS.step(state, i, Params(gamma=gamma), H)
    _, b = bs.COMPONENT.step(bs.State(), i, bs.Params(), H)
    assert a == b


def test_nothing_is_learned_while_frozen_if_so_chosen():
    s = vessel.State(v=0.1, r=0.2)
    frozen = Inputs(true_estimate(s)._replace(frozen=1.0), rich_target(0.0))
    for hold, learns in ((0.0, True), (1.0, False)):
        params = Params(hold_frozen=hold)
        state, _ = ABS.step(ABS.init(None, params), frozen, params, H)
        assert any(state.phi_hat) == learns


def test_gains_default_to_table_5_1():
    assert tuple(FeedbackGains()) == (0.4, 1.0, 0.2, 1.0, 5.0, 1.0)
    assert ROTATIONAL_GAINS == (8.0, 4.0, 8.0, 8.0, 8.0, 4.0, 8.0, 8.0)


def test_pid_finds_a_constant_force():
    """Its integral is what the force is, and then the ship lies where it should; windup has an end."""
    force = np.array([0.3, -0.2])  # N, north and east
    params, h = pid.COMPONENT.params(), 0.1
    body = VESSEL.prepare(VESSEL.params()).hull
    s = vessel.State()
    cs = pid.COMPONENT.init(pid.Inputs(true_estimate(s), Target()), params)
    out = None
    for _ in range(round(140.0 / h)):
        cs, out = pid.COMPONENT.step(cs, pid.Inputs(true_estimate(s), Target()), params, h)
        X, Y = rotate_to_body(s.psi, *force)
        s = vessel.integrate(s, Force(out.tau.tau_X + X, out.tau.tau_Y + Y, out.tau.tau_N), body, h)
    assert out is not None
    assert np.hypot(s.x, s.y) < 1e-3
    assert (out.omega_hat_X, out.omega_hat_Y) == pytest.approx(rotate_to_body(s.psi, *force), abs=5e-3)
    far = pid.Inputs(Estimate(), Target(x_t=1e3))
    for _ in range(1000):
        cs, _ = pid.COMPONENT.step(cs, far, params, 1.0)
    assert cs.north == params.limit_position
    frozen = pid.Inputs(Estimate(frozen=1.0), Target(x_t=-1.0))
    assert pid.COMPONENT.step(cs, frozen, params, 1.0)[0] == cs
