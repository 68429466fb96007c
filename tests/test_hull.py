"""The physics of the hull: symmetry, energy, agreement with the towing tests, convergence."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.cse1 import VESSEL

from fmus.declare import flatten, packer
from fmus.hull import (
    Damping,
    Inertia,
    RotationalDamping,
    Terms,
    TowedDamping,
    coriolis_force,
    damping_force,
    inertia_force,
    inverse_mass,
    mass_matrix,
)
from fmus.signals import Force
from fmus.vessel.vessel import State, VesselStart, integrate, motion

speed = st.floats(-1.0, 1.0)
NO_DAMPING = Damping(Terms._make([0.0] * len(Terms._fields)))
Params = VESSEL.params
HULL = VESSEL.prepare(Params()).hull
UNDAMPED = Params(damping=NO_DAMPING)


def kinetic_energy(s, inertia=Inertia()):
    nu = np.array([s.u, s.v, s.r])
    return 0.5 * nu @ np.array(mass_matrix(inertia)) @ nu


def test_mass_matrix_is_symmetric_and_positive_definite():
    M = np.array(mass_matrix(Inertia()))
    assert np.array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0.0
    rigid = np.array(mass_matrix(Inertia(X_udot=0.0, Y_vdot=0.0, Y_rdot=0.0, N_vdot=0.0, N_rdot=0.0)))
    assert np.linalg.eigvalsh(rigid).min() > 0.0


def test_printed_centre_of_gravity_would_not_be_positive_definite():
    rigid = Inertia(x_g=0.375, X_udot=0.0, Y_vdot=0.0, Y_rdot=0.0, N_vdot=0.0, N_rdot=0.0)
    assert np.linalg.eigvalsh(np.array(mass_matrix(rigid))).min() < 0.0


def test_inverse_mass_inverts():
    i11, i22, i23, i32, i33 = inverse_mass(Inertia(Y_rdot=0.3, N_vdot=-0.2))
    inverse = np.array([[i11, 0, 0], [0, i22, i23], [0, i32, i33]])
    M = np.array(mass_matrix(Inertia(Y_rdot=0.3, N_vdot=-0.2)))
    assert np.allclose(inverse @ M, np.eye(3), atol=1e-14)


@given(speed, speed, speed, st.floats(-2, 2), st.floats(-2, 2))
def test_coriolis_does_no_work(u, v, r, Y_rdot, x_g):
    X, Y, N = coriolis_force(u, v, r, Inertia(Y_rdot=Y_rdot, x_g=x_g))
    assert X * u + Y * v + N * r == pytest.approx(0.0, abs=1e-12)


@given(speed, speed, speed)
def test_coriolis_force_is_the_momentum_carried_round(u, v, r):
    """With Y_rdot = N_vdot, C(nu) nu follows from Kirchhoff's equations and the momentum M nu."""
    p = Inertia()
    momentum = np.array(inertia_force(u, v, r, p))
    expected = (-r * momentum[1], r * momentum[0], -v * momentum[0] + u * momentum[1])
    assert np.allclose(coriolis_force(u, v, r, p), expected, atol=1e-12)


@pytest.mark.parametrize("u", [-0.3, -0.05, 0.0, 0.08, 0.4])
def test_steady_surge_needs_the_towing_force(u):
    c = TowedDamping()
    tow = -(c.X_u * u + c.X_absu_u * abs(u) * u + c.X_uuu * u**3)
    accelerations = motion(u, 0.0, 0.0, Force(tow, 0.0, 0.0), HULL)
    assert np.allclose(accelerations, 0.0, atol=1e-15)


@pytest.mark.parametrize("v", [-0.1, 0.05, 0.2])
def test_steady_sway_needs_the_towing_force(v):
    """Towed sideways without turning: the sway force of the tow curve, and nothing else in sway."""
    c = TowedDamping()
    tow = -(c.Y_v * v + c.Y_absv_v * abs(v) * v + c.Y_vvv * v**3)
    drag_by_sway, _, moment = damping_force(0.0, v, 0.0, Damping())
    holding = Force(-drag_by_sway, tow, -moment)
    assert np.allclose(motion(0.0, v, 0.0, holding, HULL), 0.0, atol=1e-15)


@given(speed, speed)
def test_surge_drag_by_sway_does_not_change_sign(u, v):
    assert damping_force(0.0, v, 0.0, Damping())[0] == damping_force(0.0, -v, 0.0, Damping())[0]


def test_hull_as_printed_is_indefinite_in_sway_and_yaw():
    """The errata's warning: D(nu) > 0 does not hold; Table 2.1 borrows Y_r from another ship."""
    d = RotationalDamping()
    block = -np.array([[TowedDamping().Y_v, d.Y_r], [TowedDamping().N_v, d.N_r]])
    eigenvalues = np.linalg.eigvalsh(0.5 * (block + block.T))
    assert eigenvalues == pytest.approx([-2.0, 5.3], abs=0.05)


def test_integrator_keeps_energy_without_damping():
    s = State(u=0.3, v=-0.2, r=0.5)
    before = kinetic_energy(s)
    for _ in range(1000):
        s = integrate(s, Force(), VESSEL.prepare(UNDAMPED).hull, 0.01)
    assert kinetic_energy(s) == pytest.approx(before, rel=1e-8)


def test_energy_balance_with_force_and_damping():
    """Change of kinetic energy equals the work of force and damping, by Simpson's rule over steps."""
    b, tau, h = HULL, Force(0.5, -0.3, 0.1), 0.01
    s, work = State(u=0.1, v=0.05, r=-0.1), 0.0
    start = kinetic_energy(s)

    def power(x):
        D = damping_force(x.u, x.v, x.r, Damping())
        return sum((t + d) * n for t, d, n in zip(tau, D, (x.u, x.v, x.r), strict=True))

    for _ in range(500):
        middle, end = integrate(s, tau, b, 0.5 * h), integrate(s, tau, b, h)
        work += h / 6.0 * (power(s) + 4.0 * power(middle) + power(end))
        s = end
    assert kinetic_energy(s) - start == pytest.approx(work, rel=1e-7)


def test_convergence_is_of_fourth_order():
    tau, p = Force(1.0, -0.8, 0.4), Params(start=VesselStart(u_0=0.3, v_0=-0.1, r_0=0.2))

    def end(h):
        s = VESSEL.init(None, p)
        for _ in range(round(2.0 / h)):
            s, _ = VESSEL.step(s, tau, p, h)
            # A sign change would cross a kink of |u|, |v| or |r|, where no method keeps its order.
            assert s.u > 0.0 > s.v
            assert s.r > 0.0
        return np.array(s)

    reference = end(0.0025)
    errors = [np.abs(end(h) - reference).max() for h in (0.2, 0.1, 0.05)]
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert (orders > 3.7).all()
    assert (orders < 4.5).all()


def test_long_step_is_divided():
    p, tau = Params(), Force(0.5, 0.2, -0.1)
    once, _ = VESSEL.advance(VESSEL.init(None, p), tau, VESSEL.prepared(p), 0.1)
    s = VESSEL.init(None, p)
    for _ in range(5):
        s, _ = VESSEL.step(s, tau, p, 0.02)
    assert once == s


def test_pure_rotation_does_not_move_the_ship():
    s = State(x=1.0, y=2.0, r=0.0)
    p = Params(inertia=Inertia(x_g=0.0))
    s = integrate(s, Force(0.0, 0.0, 0.3), VESSEL.prepare(p._replace(damping=NO_DAMPING)).hull, 0.5)
    assert (s.x, s.y) == (1.0, 2.0)
    assert s.r > 0.0


def test_change_of_a_coefficient_adds_force_and_shows_as_omega():
    p = Params()
    changed = p._replace(change=p.change._replace(delta_X_u=-4.0))
    s = State(u=0.1)
    _, outputs = VESSEL.step(s, Force(), changed, 0.0)
    _, nominal = VESSEL.step(s, Force(), p, 0.0)
    assert outputs.omega_X == pytest.approx(-0.4)
    assert (outputs.u_dot - nominal.u_dot) * 16.79 == pytest.approx(-0.4)
    assert (nominal.omega_X, nominal.omega_Y, nominal.omega_N) == (0.0, 0.0, 0.0)


@given(st.lists(st.floats(-3, 3), min_size=25, max_size=25))
def test_every_change_of_damping_equals_a_change_of_the_coefficient(values):
    p = Params()
    change = packer(type(p.change))(values)
    summed = packer(Damping)([a + b for a, b in zip(flatten(p.damping), values, strict=True)])
    s = State(u=0.2, v=-0.1, r=0.3)
    by_change, _ = VESSEL.step(s, Force(), p._replace(change=change), 0.01)
    by_value, _ = VESSEL.step(s, Force(), p._replace(damping=summed), 0.01)
    assert np.allclose(by_change, by_value, rtol=0, atol=1e-13)


def test_arrays_give_what_floats_give():
    rng = np.random.default_rng(0)
    states = rng.uniform(-0.5, 0.5, (6, 20))
    forces = rng.uniform(-1.0, 1.0, (3, 20))
    together, outputs = VESSEL.step(State(*states), Force(*forces), Params(), 0.01)
    for k in range(20):
        alone, out = VESSEL.step(
            State(*map(float, states[:, k])), Force(*map(float, forces[:, k])), Params(), 0.01
        )
        assert np.allclose([np.broadcast_to(x, 20)[k] for x in together], alone, rtol=1e-13, atol=1e-15)
        assert outputs.measured.psi_m[k] == pytest.approx(out.measured.psi_m)
