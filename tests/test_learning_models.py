"""Each parametrisation, with its true coefficients, is the hull; and one of a user's own."""

import numpy as np
import pytest
from fmpy.validation import validate_fmu
from support.cse1 import VESSEL
from support.loops import acting, closed_loop, multisine_target
from support.parametrisations import PARAMETRISATIONS

from fmus.build import build
from fmus.controller.models import ALL_UNKNOWN, ROTATIONAL, SCALED, SURGE
from fmus.declare import Component, packer, variables
from fmus.hull import Damping, Inertia, RotationalDamping, Terms, TowedDamping, motion
from fmus.signals import Force
from fmus.vessel import vessel

every_model = pytest.mark.parametrize("name", PARAMETRISATIONS)


def terms(**values):
    """Damping of the plant with some coefficients of another value."""
    return Damping(Terms()._replace(**values))


def force_by_model(model, nu, nu_dot, tau, phi):
    """known + F phi [N, N, N m]."""
    F = model.regressors(nu, nu_dot, tau, model.controller_model)
    return np.add(model.known(*nu, model.controller_model), model.force(F, phi))


def nothing_left(model, nu, tau, phi, plant, loss=(0.0, 0.0, 0.0)):
    """What M nu_dot - tau has beyond known + F phi."""
    state = vessel.State(0.0, 0.0, 0.0, *nu)
    nu_dot = motion(*nu, acting(state, tau, loss), VESSEL.prepare(plant).hull)
    y = model.error(nu, nu_dot, tau, model.controller_model)
    F = model.regressors(nu, nu_dot, tau, model.controller_model)
    return np.subtract(y, model.force(F, phi))


def random_motion(rng):
    return tuple(rng.uniform(-1, 1, 3).tolist()), Force(*rng.uniform(-2, 2, 3).tolist())


@every_model
def test_true_coefficients_give_the_hull(name):
    model = PARAMETRISATIONS[name]
    rng = np.random.default_rng(1)
    for _ in range(50):
        nu, tau = random_motion(rng)
        left = nothing_left(model, nu, tau, model.truth(), VESSEL.params())
        assert left == pytest.approx([0.0] * 3, abs=1e-12)


def test_loss_of_thrust_is_among_the_coefficients():
    rng = np.random.default_rng(2)
    loss = (0.3, -0.1, 0.31)
    phi = (*SURGE.truth()[:11], *loss)
    plant = VESSEL.params()
    change = plant.change._replace(delta_X_u=-3.5, delta_X_absu_u=-0.26)
    phi = (-0.26, -3.5, *phi[2:])
    for _ in range(50):
        nu, tau = random_motion(rng)
        left = nothing_left(SURGE, nu, tau, phi, plant._replace(change=change), loss)
        assert left == pytest.approx([0.0] * 3, abs=1e-12)


def test_factors_of_inertia_and_damping():
    """M* = 1.3 M, C* = 1.3 C, D* = 0.7 D."""
    rng = np.random.default_rng(3)
    heavier = Inertia(*(1.3 * x for x in Inertia()))._replace(x_g=Inertia().x_g)
    towed, rotational = ([0.7 * x for x in group()] for group in (TowedDamping, RotationalDamping))
    plant = VESSEL.params(
        inertia=heavier,
        damping=terms(**TowedDamping(*towed)._asdict(), **RotationalDamping(*rotational)._asdict()),
    )
    for _ in range(50):
        nu, tau = random_motion(rng)
        left = nothing_left(SCALED, nu, tau, (0.3, -0.3, 0.0), plant)
        assert left == pytest.approx([0.0] * 3, abs=1e-12)


@pytest.mark.parametrize("factor", [1.0, 0.6, 1.7])
def test_factors_of_inertia_damping_and_thrust_are_known_but_for_one(factor):
    """The ship of the effects (2.20)-(2.23): any multiple of the three factors explains it as well."""
    rng = np.random.default_rng(6)
    c = VESSEL
    names = [v.name for v in variables(c.params)]
    values = {v.name: v.start for v in variables(c.params)} | {
        "scale_inertia": 0.2,
        "scale_damping": 0.4,
    }
    plant = packer(c.params)([values[name] for name in names])
    phi = np.multiply(factor, (1.2, 1.4, 0.7)) - 1.0
    for _ in range(20):
        nu, tau = random_motion(rng)
        state = vessel.State(0.0, 0.0, 0.0, *nu)
        force = acting(state, tau, (0.3, 0.3, 0.3))
        _, found = c.step(state, Force(*force), plant, 0.0)
        nu_dot = (found.u_dot, found.v_dot, found.r_dot)
        y = SCALED.error(nu, nu_dot, tau, SCALED.controller_model)
        F = SCALED.regressors(nu, nu_dot, tau, SCALED.controller_model)
        assert SCALED.force(F, (phi[0], phi[1], -phi[2])) == pytest.approx(y, abs=1e-12)


@every_model
def test_projection_and_turning_are_those_of_the_dense_matrix(name):
    model = PARAMETRISATIONS[name]
    rng = np.random.default_rng(4)
    n = len(model.coefficients)
    nu, tau = random_motion(rng)
    F = model.regressors(nu, (0.1, -0.2, 0.3), tau, model.controller_model)
    dense = np.array([model.force(F, row) for row in np.eye(n)]).T
    e, psi = rng.normal(size=3), 0.7
    R = np.array([[np.cos(psi), -np.sin(psi), 0], [np.sin(psi), np.cos(psi), 0], [0, 0, 1]])
    assert model.project(F, tuple(e)) == pytest.approx(dense.T @ e)
    assert np.array(model.turned(F, psi)) == pytest.approx(dense.T @ R.T)
    assert sum(map(len, model.pattern)) == sum(map(len, F))


@every_model
def test_blocks_hold_all_eigenvalues(name):
    model = PARAMETRISATIONS[name]
    rng = np.random.default_rng(5)
    n = len(model.coefficients)
    Q, grams = np.zeros((n, n)), [np.zeros((len(p), len(p))) for p in model.pattern]
    for _ in range(30):
        nu, tau = random_motion(rng)
        F = model.regressors(nu, tuple(rng.normal(size=3)), tau, model.controller_model)
        dense = np.array([model.force(F, row) for row in np.eye(n)]).T
        Q += dense.T @ dense
        grams = [g + np.outer(f, f) for g, f in zip(grams, F, strict=True)]
    blocks = model.matrices([g.tolist() for g in grams])
    found = np.concatenate([np.linalg.eigvalsh(np.array(b)) for b in blocks])
    assert min(found) == pytest.approx(np.linalg.eigvalsh(Q)[0], rel=1e-6)
    assert max(found) == pytest.approx(np.linalg.eigvalsh(Q)[-1], rel=1e-9)


def test_order_is_that_of_the_equations():
    assert [c.name for c in ROTATIONAL.coefficients] == list(RotationalDamping._fields)
    assert len(SURGE.coefficients) == 14
    assert [c.name for c in ALL_UNKNOWN.coefficients[:3]] == ["c1", "c2", "c3"]
    assert len({c.gain for c in ALL_UNKNOWN.coefficients[:3]}) == 1, "products of two velocities, all"
    assert len(ALL_UNKNOWN.coefficients) == 20


def test_wanted_force_is_divided_by_what_is_left_of_the_thrust():
    from fmus.controller.cl_improved import COMPONENT

    i = COMPONENT.inputs()
    i = i._replace(target=i.target._replace(x_t=0.5, y_t=0.2, psi_t=0.3))
    forces = {}
    for loss in (0.0, 0.5, 0.9, -3.0):
        p = COMPONENT.params(phi=SURGE.start(*[0.0] * 11, loss, loss, loss))
        _, out = COMPONENT.step(COMPONENT.init(i, p), i, p, 0.0)
        forces[loss] = np.array(out.tau)
        linear = np.array([out.tau_lin_X, out.tau_lin_Y, out.tau_lin_N])
        nonlinear = np.array([out.tau_nonlin_X, out.tau_nonlin_Y, out.tau_nonlin_N])
        assert forces[loss] == pytest.approx(linear + nonlinear)
    assert forces[0.5] == pytest.approx(2.0 * forces[0.0])
    assert forces[0.9] == pytest.approx(5.0 * forces[0.0])  # no more than 0.8 is believed
    assert forces[-3.0] == pytest.approx(0.5 * forces[0.0])


USERS = '''"""Learns the yaw damping alone, from a store of its own kind."""

from fmus.controller.concurrent import concurrent
from fmus.controller.models import towed_and_coriolis
from fmus.controller.parametrisation import LearnedCoefficient, Parametrisation
from fmus.controller.store import singular

YAW = Parametrisation(
    coefficients=(LearnedCoefficient("N_r", "N.m.s/rad", "yaw moment, r", -1.9, 100.0),),
    pattern=((), (), (0,)),
    regressors=lambda nu, nu_dot, tau, controller_model: ((), (), (nu[2],)),
    known=towed_and_coriolis,
    blocks=((2,),),
)

COMPONENT = concurrent("controller_yaw", "Learns N_r", YAW, singular, by_eps=True, store_change=0.05)
'''


def test_one_file_of_a_user_learns_what_it_likes(tmp_path):
    own = tmp_path / "yaw.py"
    own.write_text(USERS)
    (path,) = build([str(own)], tmp_path)
    assert validate_fmu(str(path)) == []
    scope: dict = {}
    exec(compile(USERS, str(own), "exec"), scope)
    component: Component = scope["COMPONENT"]
    assert {"phi_hat_1", "sigma_min"} <= {v.name for v in variables(component.outputs)}
    plant = VESSEL.params(damping=terms(**dict.fromkeys(RotationalDamping._fields, 0.0) | {"N_r": -1.9}))
    *_, (*_, out) = closed_loop(
        component, component.params(), 60.0, 0.02, multisine_target(), plant=plant
    )
    assert out.phi_hat.phi_hat_1 == pytest.approx(-1.9, rel=1e-3)


def test_start_value_of_no_parameter_is_refused():
    from fmus.controller.concurrent import concurrent
    from fmus.controller.store import window
    from fmus.declare import DeclarationError

    with pytest.raises(DeclarationError, match="store_chnge"):
        concurrent("x", "x", ROTATIONAL, window, by_eps=True, store_chnge=1.0)
