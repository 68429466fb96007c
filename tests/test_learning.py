"""Concurrent learning in the closed loop of pure functions: Lyapunov, convergence, tracking."""

import numpy as np
import pytest
from support.cases import slow
from support.cse1 import VESSEL
from support.loops import closed_loop, ellipse_target, multisine_target, unlimited
from support.parametrisations import PARAMETRISATIONS
from support.project import COMPONENTS

from fmus.controller.adaptive import Disturbance, adaptive, to_body
from fmus.controller.concurrent import explained
from fmus.controller.learning import Drive, learned, remembered
from fmus.controller.models import ROTATIONAL, SURGE
from fmus.controller.smoothing import LearningSample
from fmus.controller.store import SIZE, StoredSample, StoreOptions, empty_store, summed
from fmus.declare import variables
from fmus.hull import RotationalDamping
from fmus.signals import Force
from fmus.vessel import vessel

TRUE_PHI = np.array(RotationalDamping())
FOUR = [f"controller_cl_{s}_{e}" for s in ("win", "svd") for e in ("z2", "eps")]
# One of them in the quick part.
four = pytest.mark.parametrize(
    "name", [FOUR[0], *(pytest.param(n, marks=pytest.mark.slow) for n in FOUR[1:])]
)
STILL = (0.0, 0.0, 0.0)
OFF = Disturbance()
AWAY = vessel.State(5.3, 1.8, 0.3, 0.0, 0.0, 0.2)

# Table 7.1, line 4: X_absu_u and X_u add to what is known, the others are totals.
SYSID4 = (-0.26, -3.5, 0.2, -0.014, 1.55, 0.017, 0.2, 0.017, -1.8, -0.02, -0.2, 0.3, 0.0, 0.31)


def sysid4_plant():
    changes = {"X_absu_u": SYSID4[0], "X_u": SYSID4[1], "X_absu_r": SYSID4[2]}
    nominal = RotationalDamping()._asdict()
    changes |= {n: a - b for a, (n, b) in zip(SYSID4[3:11], nominal.items(), strict=True)}
    plant = VESSEL.params()
    return plant._replace(
        change=plant.change._replace(**{f"delta_{name}": x for name, x in changes.items()})
    )


@pytest.mark.parametrize("name", ["controller_abs", FOUR[0], FOUR[3]])
def test_lyapunov_function_never_grows(name):
    """Beyond what the time step costs: growth that is there at all halves with the step."""
    component = COMPONENTS[name]
    growth = []
    for h in (0.02, 0.01):
        loop = closed_loop(component, component.params(), 20.0, h, multisine_target(2.0), AWAY)
        values = np.array([out.energy.lyapunov for *_, out in loop])
        growth.append(max(np.diff(values).max(), 0.0))
        assert values[-1] < values[0]
    assert growth[1] <= 0.5 * growth[0]


def test_lyapunov_function_of_the_loss_of_thrust_alone_never_grows():
    """Nothing but the losses (7.4) is unknown, and z2 alone teaches them, (A.9) with F = -diag(tau)."""
    component = adaptive("controller_delta", "Losses of thrust alone", SURGE)
    loss = (0.3, -0.1, 0.31)
    hull = RotationalDamping()
    p = component.params(
        phi=SURGE.start(0.0, 0.0, 0.0, *hull), gamma=SURGE.gamma(*[0.0] * 11, 0.4, 0.4, 0.4)
    )
    p = p._replace(truth=SURGE.truth(0.0, 0.0, 0.0, *hull, *loss))
    growth, last = [], None
    for h in (0.02, 0.01):
        loop = closed_loop(component, p, 60.0, h, multisine_target(2.0), AWAY, loss=loss)
        rows = [(out.energy.lyapunov, out.phi_hat) for *_, out in loop]
        values = np.array([v for v, _ in rows])
        growth.append(max(np.diff(values).max(), 0.0))
        first, last = values[0], np.array(rows[-1][1])[11:]
        assert values[-1] < 0.2 * first
    assert growth[1] <= 0.5 * growth[0]
    assert np.abs(last - loss).max() < 0.1, "and on a rich motion the losses are found"


@pytest.mark.quick
def test_lyapunov_output_is_the_sum_of_its_terms():
    component = COMPONENTS["controller_cl_win_eps"]
    gamma = ROTATIONAL.gamma()._replace(gamma_2=0.0)
    p = component.params(gamma=gamma, disturbance=Disturbance(2.0, 0.0, 0.5))
    p = p._replace(omega_true=type(p.omega_true)(0.3, 5.0, -0.1))
    *_, (_, _, law, out) = closed_loop(component, p, 3.0, 0.02, multisine_target(), AWAY)
    z1, z2 = np.array(out.errors[:3]), np.array(out.errors[3:])
    M = np.array([[16.79, 0, 0], [0, 24.79, 0.554625], [0, 0.554625, 2.76]])
    error = np.delete((TRUE_PHI - out.phi_hat) ** 2 / np.array([8.0, 4.0, 8, 8, 8, 4, 8, 8]), 1)
    known = law.state.omega
    omega = (0.3 - known[0]) ** 2 / 2.0 + (-0.1 - known[2]) ** 2 / 0.5
    expected = 0.5 * (z1 @ z1 + z2 @ M @ z2 + error.sum() + omega)
    assert out.energy.lyapunov == pytest.approx(expected, rel=1e-12)


@four
def test_rotational_damping_is_found_under_rich_motion(name):
    component = COMPONENTS[name]
    p = component.params(gamma=ROTATIONAL.gamma(*[1000.0] * 8))
    *_, (*_, out) = closed_loop(component, p, 160.0, 0.02, multisine_target(2.0))
    error = np.linalg.norm(np.array(out.phi_hat) - TRUE_PHI)
    # z2 never comes to rest at these gains; the window forgets, and with it the rank.
    assert error < {"svd_eps": 1e-3, "svd_z2": 0.05}.get(name[14:], 0.4)
    if "svd" in name:
        assert out.learning.rank_met == 1.0
    assert out.learning.stored == SIZE


@pytest.mark.parametrize("name", [FOUR[0], slow(FOUR[3])])
def test_ellipse_is_tracked_within_a_centimetre_on_the_second_lap(name):
    component = COMPONENTS[name]
    loop = closed_loop(component, component.params(), 198.0, 0.02, ellipse_target())
    squares = [out.errors.z1_x**2 + out.errors.z1_y**2 for t, _, _, out in loop if t > 99.0]
    assert np.sqrt(np.mean(squares)) < 0.002  # without concurrent learning it is 0.06


@pytest.mark.parametrize("smoothing", [0.0, pytest.param(0.2, marks=pytest.mark.slow)])
def test_improved_controller_finds_surge_damping_and_loss_of_thrust(smoothing):
    """Predictions of the model error of Table 7.1, line 4, also at velocities never stored."""
    component = COMPONENTS["controller_cl_improved"]
    p = component.params(gamma=SURGE.gamma(*[400.0] * 11, *[4.0] * 3))
    p = p._replace(samples=p.samples._replace(smoothing=smoothing))
    loop = list(
        closed_loop(
            component, p, 200.0, 0.02, multisine_target(), plant=sysid4_plant(), loss=SYSID4[11:]
        )
    )
    phi = loop[-1][3].phi_hat
    true, wrong = [], []
    for _, s, _, out in loop[1000::50]:
        F = SURGE.regressors((s.u, s.v, s.r), STILL, out.tau, p.controller_model)
        force, estimate = np.array(SURGE.force(F, SYSID4)), np.array(SURGE.force(F, phi))
        true.append(force @ force)
        wrong.append((force - estimate) @ (force - estimate))
    assert np.sqrt(np.mean(wrong) / np.mean(true)) < 0.03


def store_of(model, rng, count=SIZE, noise=0.0, phi=None):
    """A store of random samples of a model with parameters phi."""
    rows = []
    for _ in range(count):
        nu, tau = rng.uniform(-1.0, 1.0, 3), rng.uniform(-1.0, 1.0, 3)
        F = model.regressors(tuple(nu), tuple(rng.uniform(-1, 1, 3)), tuple(tau), model.controller_model)
        y = tuple(np.array(model.force(F, phi)) + noise * rng.normal(size=3))
        rows.append(StoredSample(1.0, 0.0, rng.uniform(-3, 3), y, F))
    return tuple(rows) + empty_store(model).rows[count:]


def dense(model, row):
    """F as a matrix (3, n)."""
    F = np.zeros((3, len(model.coefficients)))
    for axis, (indices, values) in enumerate(zip(model.pattern, row.F, strict=True)):
        F[axis, list(indices)] = values
    return F


def turn(psi):
    c, s = np.cos(psi), np.sin(psi)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def adapt(model, rows, phi, gamma, steps, dt, omega=STILL, gamma_omega=OFF, rho=0.0, **options):
    """Learn from a frozen store alone; yield the estimates."""
    on = sum(gamma_omega) > 0.0
    sums = summed(on, rows, model)
    memory = remembered(sums, None, rho, StoreOptions(**options).store_weight)
    rest = Drive(empty_store(model).last, 0.0, STILL)
    for _ in range(steps):
        phi, omega, _ = learned(
            model,
            (phi, omega),
            (gamma, gamma_omega),
            rest,
            0.0,
            sums,
            memory,
            StoreOptions(**options),
            dt,
        )
        yield np.array(phi), np.array(omega)


@pytest.mark.parametrize("name", ["rotational", "surge", "scaled"])
def test_error_decays_at_the_rate_of_the_information_matrix(name):
    """Theorem 4.1.1: at least exp(-lambda_min(Gamma^1/2 Q Gamma^1/2) t)."""
    model = PARAMETRISATIONS[name]
    rng = np.random.default_rng(3)
    true = rng.normal(size=len(model.coefficients))
    rows = store_of(model, rng, phi=true)
    gains = rng.uniform(1.0, 8.0, len(true))
    Q = sum(dense(model, r).T @ dense(model, r) for r in rows)
    rate = np.linalg.eigvalsh(np.sqrt(gains)[:, None] * Q * np.sqrt(gains)).min()
    assert rate > 0.0
    gamma, dt = model.gamma(*gains), 0.1 / (gains @ np.diag(Q))
    norms = [
        np.sqrt(((true - phi) ** 2 / gains).sum())
        for phi, _ in adapt(model, rows, model.hat(), gamma, 2000, dt)
    ]
    first = np.sqrt((true**2 / gains).sum())
    assert (norms <= first * np.exp(-rate * dt * np.arange(1, 2001)) * (1 + 1e-9)).all()


def test_joint_store_finds_coefficients_and_an_earth_fixed_force():
    """(4.34) with (4.37): the joint gradient is that of the dense matrices."""
    rng = np.random.default_rng(4)
    true, force = rng.normal(size=8), np.array([0.4, -0.3, 0.1])
    rows = store_of(ROTATIONAL, rng, phi=true)
    rows = tuple(r._replace(target=tuple(r.target + turn(r.psi).T @ force)) for r in rows)
    gamma, gamma_omega = ROTATIONAL.gamma(), Disturbance(1.0, 2.0, 3.0)
    dt = 1e-3
    history = list(adapt(ROTATIONAL, rows, ROTATIONAL.hat(), gamma, 20000, dt, STILL, gamma_omega))
    eps = [np.array(r.target) for r in rows]
    slope = sum(dense(ROTATIONAL, r).T @ e for r, e in zip(rows, eps, strict=True))
    earth = sum(turn(r.psi) @ e for r, e in zip(rows, eps, strict=True))
    assert history[0][0] == pytest.approx(dt * np.array(gamma) * slope)
    assert history[0][1] == pytest.approx(dt * np.array(gamma_omega) * earth)
    assert history[-1][0] == pytest.approx(true, abs=1e-2)
    assert history[-1][1] == pytest.approx(force, abs=1e-2)


@pytest.mark.parametrize("dt", [0.01, 1.0, 100.0])
def test_any_step_and_any_gain_stay_stable(dt):
    rng = np.random.default_rng(5)
    true = rng.normal(size=8)
    rows = store_of(ROTATIONAL, rng, phi=true)
    gamma = ROTATIONAL.gamma(*[1000.0] * 8)
    errors = [
        np.linalg.norm(true - phi) for phi, _ in adapt(ROTATIONAL, rows, ROTATIONAL.hat(), gamma, 50, dt)
    ]
    assert (np.diff(errors) <= 1e-12).all()


def test_stale_errors_wind_up_and_fresh_ones_do_not():
    """The samples were taken with wrong estimates; the stale sum never learns that they were corrected."""
    rng = np.random.default_rng(6)
    rows = store_of(ROTATIONAL, rng, phi=TRUE_PHI)  # with phi_hat = 0 the stored eps is y
    *_, (fresh, _) = adapt(ROTATIONAL, rows, ROTATIONAL.hat(), ROTATIONAL.gamma(), 20000, 0.01)
    *_, (stale, _) = adapt(
        ROTATIONAL, rows, ROTATIONAL.hat(), ROTATIONAL.gamma(), 20000, 0.01, stale=1.0
    )
    assert fresh == pytest.approx(TRUE_PHI, rel=1e-2)
    assert np.linalg.norm(stale) > 10 * np.linalg.norm(TRUE_PHI)


def test_weight_of_the_store_scales_its_pull_and_its_guard():
    """w sum_j F_j^T eps_j; the guard on h Gamma trace(Q) counts w, so that a step too long for w = 1 is free."""
    rng = np.random.default_rng(7)
    rows = store_of(ROTATIONAL, rng, phi=TRUE_PHI)
    gamma = ROTATIONAL.gamma()
    trace = sum(np.sum(np.array(gamma) * dense(ROTATIONAL, r) ** 2) for r in rows)

    def first(dt, weight, **gains):
        options = {"store_weight": weight, **gains}
        return next(adapt(ROTATIONAL, rows, ROTATIONAL.hat(), gamma, 1, dt, **options))[0]

    slow, fast = 0.1 / trace, 5.0 / trace
    assert first(slow, 0.1) == pytest.approx(0.1 * first(slow, 1.0))
    assert first(fast, 0.1) == pytest.approx(0.5 * first(fast, 1.0)), "only w = 1 is slowed down there"


def test_weight_of_the_store_holds_for_the_earth_fixed_force_too():
    rng = np.random.default_rng(8)
    rows = store_of(ROTATIONAL, rng, phi=TRUE_PHI)
    gamma_omega = Disturbance(1.0, 2.0, 3.0)
    still = [
        next(
            adapt(
                ROTATIONAL,
                rows,
                ROTATIONAL.hat(),
                ROTATIONAL.gamma(),
                1,
                1e-5,
                STILL,
                gamma_omega,
                store_weight=w,
            )
        )[1]
        for w in (1.0, 0.1)
    ]
    assert still[1] == pytest.approx(0.1 * still[0])


def test_stale_store_overshoots_in_the_loop():
    component = COMPONENTS["controller_cl_win_eps"]
    peaks = {}
    for stale in (0.0, 1.0):
        p = component.params(store=component.params().store._replace(stale=stale))
        loop = closed_loop(component, p, 60.0, 0.02, ellipse_target())
        peaks[stale] = min(out.phi_hat.phi_hat_6 for *_, out in loop)
    assert peaks[1.0] < 2.0 * RotationalDamping().N_r < peaks[0.0]


@pytest.mark.parametrize(("name", "rho"), [(FOUR[0], 0.1), (FOUR[3], 0.0)])
def test_earth_fixed_force_is_found_by_store_and_by_integral(name, rho):
    component, force = COMPONENTS[name], (0.2, -0.15, 0.05)
    p = component.params(
        disturbance=Disturbance(2.0, 2.0, 1.0), phi=ROTATIONAL.start(*RotationalDamping())
    )
    p = p._replace(samples=p.samples._replace(rho=rho))
    *_, (_, _, law, _) = closed_loop(component, p, 60.0, 0.02, multisine_target(), earth=force)
    assert law.state.omega == pytest.approx(force, abs=0.01)


def test_nothing_is_learned_or_stored_while_frozen_or_blocked():
    component = COMPONENTS["controller_cl_win_eps"]
    base = unlimited(component.params())
    for p in (
        base._replace(hold_frozen=1.0),
        base._replace(blocker=base.blocker._replace(nu_max=0.0)),
    ):
        i = component.inputs()
        moving = i.estimate._replace(u_hat=0.1, v_hat=0.1, r_hat=0.2, frozen=p.hold_frozen)
        i = i._replace(estimate=moving)
        s = component.init(i, p)
        for _ in range(10):
            s, out = component.step(s, i, p, 0.01)
        assert not any(s.phi_hat)
        assert out.learning.stored == 0.0
        s, out = component.step(component.init(i, base), i, base, 0.01)
        assert any(s.phi_hat)
        assert out.learning.stored == 1.0


def test_defaults_of_the_combinations():
    improved = {v.name: v.start for v in COMPONENTS["controller_cl_improved"].variables}
    assert improved["nu_dot_max"] < 1.0 < COMPONENTS["controller_cl_win_eps"].params().blocker.nu_dot_max
    assert COMPONENTS["controller_cl_improved"].params().samples.smoothing == improved["smoothing"] > 0.0
    names = {v.name for v in COMPONENTS["controller_cl_win_eps"].variables}
    assert {v.name for v in COMPONENTS["controller_abs"].variables} <= names
    assert {v.name for v in variables(StoreOptions)} <= names


def test_what_is_stored_is_the_whole_force_or_what_was_left_to_explain_then():
    """y with which errors are formed anew; as printed eps, which is y less what was known already."""
    component = COMPONENTS["controller_cl_win_eps"]
    sample = LearningSample(0.0, 0.7, (0.3, -0.1, 0.2), (0.05, -0.02, 0.1), Force(1.0, -0.5, 0.2))
    s = component.init(component.inputs(), component.params())
    s = s._replace(phi_hat=type(s.phi_hat)(*np.linspace(-2.0, 3.0, 8)), omega=(0.3, -0.2, 0.1))
    targets = []
    for stale in (0.0, 1.0):
        p = component.params(store=component.params().store._replace(stale=stale))
        row, eps = explained(ROTATIONAL, sample, s, p)
        targets.append(np.array(row.target))
    known = np.add(ROTATIONAL.force(row.F, s.phi_hat), to_body(sample.psi, s.omega))
    assert np.abs(known).min() > 0.01
    assert targets[0] - known == pytest.approx(np.array(eps))
    assert targets[1].tolist() == list(eps)
