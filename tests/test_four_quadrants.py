"""Low speed and four quadrants: the Esso Osaka against an independent reading of its published model."""

from itertools import pairwise
from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import quad
from support.ships import SHIPS, scaled

from fmus.actuators.actuation import command_units, forces
from fmus.actuators.four_quadrants import FourQuadrantPropeller, FourQuadrantRudder
from fmus.actuators.law import Flow, Law, Race
from fmus.actuators.response import total
from fmus.actuators.standard_method import RudderInRace
from fmus.effects import Motion
from fmus.frames import air_velocity
from fmus.hull_functions import low_speed, swept
from fmus.ship import ship
from fmus.ships.wind import Superstructure, regression, wind_by_regression
from fmus.signals import Force
from fmus.vessel import vessel

TANKER = SHIPS["esso_osaka"]
SHIP = ship(description=TANKER)
RHO, L, D_DRAFT, DIAMETER = 998.0, 3.0, 0.20114, 0.084
speed = st.floats(-0.8, 0.8)
sway = st.floats(-0.3, 0.3)
rate = st.floats(-0.25, 0.25)
shaft = st.floats(-20.0, 20.0)
helm = st.floats(-0.6, 0.6)
wind = st.tuples(st.floats(0.0, 4.0), st.floats(-pi, pi))


# The publication, term by term, in words of its own


def hull_force(u, v, r):
    U, beta, k = hypot(u, v), atan2(v, u), 0.5 * RHO * L * D_DRAFT

    def across(C, power):
        def s(xi):
            return xi**power * abs(v + C * L * r * xi) * (v + C * L * r * xi)

        zero = [-v / (C * L * r)] if r and abs(v / (C * L * r)) < 0.5 else []
        parts = pairwise([-0.5, *zero, 0.5])
        return sum(quad(s, a, b, epsabs=1e-15, epsrel=1e-13)[0] for a, b in parts)

    X = (-0.02139 + (-0.03189 + 0.02139) * abs(beta) / pi) * u * U - 0.0081 * L * v * r
    Y = -0.3728 * v * abs(u) + 0.116 * L * r * u - 0.9665 * across(2.217, 0)
    N = -0.1458 * v * u - 0.04849 * L * r * abs(u) - 0.9665 * across(0.8097, 1)
    return np.array([k * X, k * Y, k * L * N])


def not_wake(u, v, r):
    """1 - w."""
    if u <= 0.0:
        return 1.0
    s = abs(v - 0.517 * L * r) / hypot(u, v)
    return min(max(1.0 - (0.614 - 0.871 * s + 0.359 * s * s), 0.0), 1.0)


def propeller_force(u, v, r, n):
    if n == 0.0:
        return np.zeros(3)
    J = u / (n * DIAMETER)
    thrust, side = RHO * DIAMETER**4 * n * n, 0.5 * RHO * L * D_DRAFT * (n * DIAMETER) ** 2
    if n > 0.0:
        J_P = J * not_wake(u, v, r)
        X = 0.78 * thrust * (0.3278 - 0.3323 * J_P - 0.1560 * J_P**2)
        if u >= 0.0:
            return np.array([X, 0.0, 0.0])
        side *= 0.7151**2
        return np.array(
            [
                X,
                side * (5.08e-3 * J**2 + 1.70e-3 * J + 9.16e-4),
                side * L * (-2.16e-3 * J**2 + 6.27e-5 * J + 6.25e-5),
            ]
        )
    X = thrust * (-0.175 + 0.330 * J if J >= -0.233 else -0.251)
    if J < -0.35:
        Y, N = -4.93e-3 - 5.87e-3 * J, 1.96e-3 + 2.33e-3 * J
    elif J <= -0.06:
        Y, N = -7.90e-5 + 7.99e-3 * J, 3.50e-5 - 3.17e-3 * J
    else:
        Y, N = -5.58e-4, 2.25e-4
    return np.array([X, side * Y, side * L * N])


def rudder_force(u, v, r, n, delta):
    height = sqrt(0.01063 * 1.539)
    eta, kappa, u_P = DIAMETER / height, 0.288 / 1.42, not_wake(u, v, r) * u
    felt = 0.78 if n >= 0.0 else 1.0
    K_T = propeller_force(u, v, r, n)[0] / (felt * RHO * DIAMETER**4 * n * n) if n else 0.0
    if n >= 0.0 and (K_T > 0.0 or u >= 0.0):
        jet = sqrt(max(0.0, u_P**2 + 8.0 * K_T * (n * DIAMETER) ** 2 / pi))
        u_R = 1.42 * sqrt(eta * (u_P + kappa * (jet - u_P)) ** 2 + (1.0 - eta) * u_P**2)
    elif n < 0.0 <= u:
        b = 1.42 * u_P
        a = b + n * DIAMETER * 0.144 * sqrt(8.0 * abs(K_T) / pi)
        square = eta * np.sign(a) * a * a + (1.0 - eta) * b * b - 0.176 * u * u
        u_R = np.sign(square) * sqrt(abs(square))
    else:
        u_R = u
    gamma = 0.3506 if v - 0.5 * L * r >= 0.0 else 0.4406
    v_R = -gamma * (v - 1.08 * L * r)
    f_alpha = 6.13 * 1.539 / (2.25 + 1.539)
    F_N = 0.5 * RHO * 0.01063 * (u_R**2 + v_R**2) * f_alpha * sin(delta - atan2(v_R, u_R))
    return -F_N * np.array(
        [
            0.81 * sin(delta),
            1.393 * cos(delta),
            (-0.5 * L - 0.393 * 0.45 * L) * cos(delta),
        ]
    )


AREAS = ("frontal_area", "lateral_area")
ABOVE = Superstructure(0.13544, 0.52038, -0.01299, 0.10359, 0.1423, -0.06209, 0.294, 1.225)


def wind_force(u, v, psi, W, zeta, B=0.48925, of=ABOVE):
    """Fujiwara's regression, from its tables of coefficients."""
    A_T, A_L, C, H_C, A_OD, C_BR, H_BR, rho = of
    a, b = W * cos(zeta - psi) + u, W * sin(zeta - psi) + v  # from where it seems to blow
    V2, g = a * a + b * b, -atan2(b, a)
    q = 0.5 * rho * V2
    X = np.dot([-0.330, 0.293, 0.0193, 0.682], [1.0, B * H_BR / A_T, C / H_C, A_OD / L**2])
    X += cos(g) * np.dot(
        [-1.353, 1.700, 2.870, -0.463, -0.570, -6.640, -0.0123, 0.0202],
        [1.0, A_L / (L * B), L * H_C / A_L, L * H_BR / A_L, A_OD / A_L, A_T / (L * B), L**2 / A_T, L / H_C],
    )  # fmt: skip
    X += cos(3.0 * g) * np.dot(
        [0.830, -0.413, -0.0827, -0.563, 0.804, -5.670, 0.0401, -0.132],
        [1.0, A_L / (L * H_BR), A_L / A_T, L * H_C / A_L, A_OD / A_L, A_OD / L**2, C / H_C, C_BR / L],
    )
    X += cos(5.0 * g) * np.dot(
        [0.0372, -0.0075, -0.103, 0.0921], [1.0, A_L / A_OD, C_BR / L, A_L / (L * B)]
    )
    Y = sin(g) * np.dot(
        [0.684, 0.717, -3.22, 0.0281, 0.0661, 0.298],
        [1.0, C_BR / L, C / L, A_L / A_OD, C / H_C, A_T / (B * H_BR)],
    )
    Y += sin(3.0 * g) * np.dot(
        [-0.400, 0.282, 0.307, 0.0519, 0.0526, -0.0814, 0.0582],
        [1.0, A_L / (L * B), L * H_C / A_L, C_BR / L, B / H_BR, A_OD / A_L, A_T / (B * H_BR)],
    )
    Y += sin(5.0 * g) * np.dot(
        [0.122, -0.166, -0.0054, -0.0481, -0.0136, 0.0864, -0.0297],
        [1.0, A_L / (L * B), L / H_BR, C_BR / L, B**2 / A_T, C / L, C * H_C / A_L],
    )
    N = sin(g) * np.dot(
        [0.299, 1.71, 0.183, -1.09, -0.0442, -0.289, 4.24, -0.0646, 0.0306],
        [1.0, C / L, L * H_C / A_L, A_T / A_L, C / H_C, A_L / (L * B), A_T / L**2, B**2 / A_T, C_BR / L],
    )  # fmt: skip
    N += sin(2.0 * g) * np.dot(
        [0.117, 0.123, -0.323, 0.0041, -0.166, -0.0109, 0.174, 0.214, -1.06],
        [1.0, C_BR / L, C / L, A_L / A_OD, A_T / B**2, L / H_BR, A_T / (B * H_BR), A_L / (L * B), A_L / L**2],
    )  # fmt: skip
    N += sin(3.0 * g) * np.dot(
        [0.023, 0.0385, -0.0339, 0.0023], [1.0, C_BR / L, A_T / (B * H_BR), A_L / A_T]
    )
    return q * np.array([A_T * X, A_L * Y, A_L * L * N])


def published(eta, nu, n, delta, W, zeta):
    """nu_dot [m/s2, m/s2, rad/s2]."""
    u, v, r = nu
    k = 0.5 * RHO * L * L * D_DRAFT
    m, m_x, m_y, I_J, x_G = 0.27078 * k, 0.0467 * k, 0.2579 * k, 0.0286 * k * L * L, 0.03119 * L
    F = hull_force(u, v, r) + propeller_force(u, v, r, n) + rudder_force(u, v, r, n, delta)
    X, Y, N = F + wind_force(u, v, eta[2], W, zeta)
    M = np.array([[m + m_y, x_G * m], [x_G * m, I_J + x_G**2 * m]])
    right = [Y - (m + m_x) * u * r, N - x_G * m * u * r]
    u_dot = (X + (m + m_y) * v * r + x_G * m * r * r) / (m + m_x)
    return np.array([u_dot, *np.linalg.solve(M, right)])


# The ship file against it


def actuated(commands, nu, d=TANKER):
    plant = ship(description=d).thrusters.params().plant
    return np.array(total(forces(d, commands, nu, plant)))


def body(d=TANKER):
    of = ship(description=d).vessel
    return of.prepared(of.params())


def acceleration(psi, nu, commands, W, zeta, d=TANKER):
    s = Motion(0.0, 0.0, psi, *nu, 0.0)
    b = vessel.blown(body(d), s, *air_velocity(W, zeta))
    return np.array(vessel.disturbed(s, Force(*actuated(commands, nu, d).tolist()), b))


@given(st.floats(-pi, pi), speed, sway, rate, shaft, helm, wind)
def test_the_ship_file_is_the_published_model(psi, u, v, r, n, delta, blows):
    assume(min(abs(u), abs(n)) > 1e-3 and hypot(u, v) > 1e-3)
    # The file has eleven digits of numbers that are roots and quotients.
    found = acceleration(psi, (u, v, r), (n, delta), *blows)
    expected = published((0.0, 0.0, psi), (u, v, r), n, delta, *blows)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-10)


size = st.floats(0.1, 2.0)
place = st.floats(-1.0, 1.0)


@given(st.builds(Superstructure, size, size, place, size, size, place, size, size), size, wind)
def test_the_wind_on_any_superstructure_is_that_of_the_published_regression(above, B, blows):
    W, zeta = blows
    s = Motion(0.0, 0.0, 0.3, 0.4, -0.1, 0.0, 0.0)
    described = regression(L, B, above) | dict(zip(AREAS, above[:2], strict=True))
    W_n, W_e = air_velocity(W, zeta)
    found = wind_by_regression(s, W_n, W_e, wind_length=L, air_density=above.air_density, **described)
    expected = wind_force(s.u, s.v, s.psi, W, zeta, B, above)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("u", "n"), [(0.4, 12.0), (-0.3, 12.0), (0.4, -12.0)])
def test_a_prediction_is_that_of_the_published_model(u, n):
    """Over 8 s, in a wind, by another method of integration."""
    from scipy.integrate import solve_ivp

    delta, W, zeta = 0.3, 1.5, 2.0
    s, h = Motion(0.0, 0.0, 0.4, u, 0.05, -0.02, 0.0), 0.02
    b = body()
    for _ in range(400):
        tau = Force(*actuated((n, delta), s[3:6]).tolist())
        s = vessel.integrate(s, tau, vessel.blown(b, s, *air_velocity(W, zeta)), h, vessel.disturbed)

    def rates(t, x):
        c, sn = cos(x[2]), sin(x[2])
        moved = [c * x[3] - sn * x[4], sn * x[3] + c * x[4], x[5]]
        return [*moved, *published(x[:3], x[3:], n, delta, W, zeta)]

    exact = solve_ivp(rates, (0.0, 8.0), [0.0, 0.0, 0.4, u, 0.05, -0.02], rtol=1e-8, atol=1e-10)
    # The force of the actuators is held over a step.
    assert np.array(s[:6]) == pytest.approx(exact.y[:, -1], abs=3e-3)


# Properties of the hull


@given(sway, rate, st.floats(0.1, 3.0))
def test_the_cross_flow_in_closed_form_is_its_integral(v, r, C):
    edges = [-0.5, *([-v / (C * r)] if abs(v) < 0.5 * abs(C * r) else []), 0.5]
    for power, found in enumerate(swept(v, C * r)):
        parts = [
            quad(lambda x: x**power * abs(v + C * r * x) * (v + C * r * x), a, b)[0]  # noqa: B023
            for a, b in pairwise(edges)
        ]
        assert found == pytest.approx(sum(parts), abs=1e-10)


@given(speed, sway, rate)
def test_a_hull_at_low_speed_is_mirrored_and_resists(u, v, r):
    X, Y, N = low_speed(u, v, r, C_rY=1.4, N_r_prime=-0.05, Y_v_prime=-0.3)
    assert low_speed(u, -v, -r, C_rY=1.4, N_r_prime=-0.05, Y_v_prime=-0.3) == pytest.approx((X, -Y, -N))
    only_X, flow_Y, flow_N = low_speed(u, v, r)
    assert only_X * u <= 0.0
    assert flow_Y * v + flow_N * r <= 1e-12


def test_a_hull_at_rest_has_no_force_and_none_that_jumps_nearby():
    assert low_speed(0.0, 0.0, 0.0) == (0.0, 0.0, 0.0)
    for direction in (
        (1.0, 0.0, 0.0),
        (-1.0, 0.3, 0.0),
        (0.0, 1.0, 0.0),
        (0.0, 0.1, 1.0),
        (0.0, 0.0, -1.0),
    ):
        near = low_speed(*(1e-9 * x for x in direction), C_rY=2.0, N_r_prime=-0.1)
        assert np.isfinite(near).all()
        assert np.abs(near).max() < 1e-12


def test_resistance_goes_from_ahead_to_astern_by_the_angle_of_drift():
    ahead, astern, aside = (low_speed(*nu, X_0F_prime=-0.02, X_0A_prime=-0.03)[0] for nu in ((0.5, 0.0, 0.0), (-0.5, 0.0, 0.0), (1e-12, 0.5, 0.0)))  # fmt: skip
    assert (ahead, astern) == pytest.approx((-50.0 * 0.02 * 0.25, 50.0 * 0.03 * 0.25))
    assert aside == pytest.approx(0.0, abs=1e-9)


# Of propeller and rudder

PROPELLER, RUDDER = FourQuadrantPropeller, FourQuadrantRudder
WITHOUT = {f"{k}_{j}": 0.0 for k in "AB" for j in range(1, 9)}


def numbers(part, law, **others):
    given = {v.name: v.value for v in part.values if v.name in law.Parameters._fields}
    return law.Parameters(**{**given, **others})


P, R = numbers(TANKER.actuators[0], PROPELLER), numbers(TANKER.actuators[1], RUDDER)


def flow(u, v, r, x=-0.517 * L):
    return Flow(u, v + x * r, u, v, r)


@given(speed, sway, rate, helm)
def test_a_shaft_at_rest_has_no_force_and_leaves_the_rudder_the_flow(u, v, r, delta):
    at = flow(u, v, r)
    assert PROPELLER.force((0.0,), at, P) == (0.0, 0.0)
    assert PROPELLER.couple((0.0,), at, P) == 0.0
    race = PROPELLER.race((0.0,), at, P)
    met, _ = RUDDER.met(flow(u, v, r, -1.5)._replace(race=race), R)
    wake = PROPELLER.advance(at, P)
    assert met == pytest.approx(1.42 * wake if u >= 0.0 else u)


@given(helm)
def test_nothing_moves_nothing(delta):
    assert actuated((0.0, delta), (0.0, 0.0, 0.0)) == pytest.approx(np.zeros(3), abs=0.0)


@given(st.floats(0.01, 20.0), st.floats(0.001, 0.8), sway, rate)
def test_ahead_it_is_the_open_water_propeller_in_its_wake(n, u, v, r):
    """With the wake that the drift leaves, the old law gives the same force and the same race."""
    old, at = Law.known["open_water_propeller"], flow(u, v, r)
    w = 1.0 - PROPELLER.advance(at, P) / u
    assume(w <= 0.9)
    names = [name for name in old.Parameters._fields if name in PROPELLER.Parameters._fields]
    p = old.Parameters(**{**{name: getattr(P, name) for name in names}, "wake": w})
    assert PROPELLER.force((n,), at, P) == pytest.approx(old.force((n,), at, p), rel=1e-9, abs=1e-12)
    assert PROPELLER.race((n,), at, P) == pytest.approx(old.race((n,), at, p), rel=1e-6, abs=1e-9)


@given(st.floats(1.0, 20.0), st.floats(0.01, 0.8), helm)
def test_ahead_without_drift_the_rudder_is_the_one_in_a_race(n, u, delta):
    """Where the propeller thrusts, the old law is the same: its race factor is that of the speed ahead."""
    at = flow(u, 0.0, 0.0)
    race = PROPELLER.race((n,), at, P)
    assume(race.added > 0.0)
    old = Law.known["rudder_in_race"]
    p = old.Parameters(**{name: getattr(R, name) for name in old.Parameters._fields})
    at = at._replace(race=race)
    assert RUDDER.force((delta,), at, R) == pytest.approx(old.force((delta,), at, p), rel=1e-9)


@given(speed, sway, rate, shaft, helm)
def test_without_side_force_port_and_starboard_are_alike(u, v, r, n, delta):
    p = numbers(TANKER.actuators[0], PROPELLER, **WITHOUT)
    q = numbers(TANKER.actuators[1], RUDDER, gamma_plus=0.4, gamma_minus=0.4)

    def force(side):
        at = flow(u, side * v, side * r)
        X, Y = PROPELLER.force((n,), at, p)
        race = PROPELLER.race((n,), at, p)
        X_R, Y_R = RUDDER.force(
            (side * delta,), flow(u, side * v, side * r, -1.5)._replace(race=race), q
        )
        return X, side * Y, PROPELLER.couple((n,), at, p), X_R, side * Y_R

    assert force(-1.0) == pytest.approx(force(1.0), rel=1e-9, abs=1e-12)


def test_where_the_polynomials_join_the_force_does_not_jump():
    """C_3 and C_6 + C_7 J_s meet within half a per cent at C_10, sway forces within 0.1 % at J_syo."""
    n, D = -12.0, DIAMETER

    def at(J):
        here = flow(J * n * D, 0.0, 0.0)
        return np.array([*PROPELLER.force((n,), here, P), PROPELLER.couple((n,), here, P)])

    for J, share in {-0.233: 0.005, -0.35: 0.002, -0.06: 0.01}.items():
        before, after = at(J - 1e-9), at(J + 1e-9)
        assert after == pytest.approx(before, rel=share)


@pytest.mark.parametrize("n", [12.0, -12.0])
def test_the_thrust_does_not_jump_where_the_ship_stops(n):
    before, after = (PROPELLER.force((n,), flow(u, 0.0, 0.0), P)[0] for u in (-1e-9, 1e-9))
    assert before == pytest.approx(after, rel=1e-6)
    assert before * n > 0.0


def test_a_shaft_astern_turns_the_bow_to_starboard():
    X, Y, N = actuated((-10.0, 0.0), (0.0, 0.0, 0.0))
    assert X < 0.0
    assert Y < 0.0 < N


def test_a_rudder_astern_turns_the_other_way():
    ahead, astern = (actuated((n, 0.3), (u, 0.0, 0.0))[2] for n, u in ((10.0, 0.4), (0.0, -0.4)))
    assert ahead > 0.0 > astern


# Size, arrays, native code

every_quadrant = pytest.mark.parametrize(
    ("u", "n"), [(0.4, 9.0), (-0.3, 9.0), (0.4, -9.0), (-0.3, -9.0)]
)


@every_quadrant
@pytest.mark.parametrize("ratio", [0.2, 30.0])
def test_a_larger_tanker_is_the_same_by_froudes_law(u, n, ratio):
    large, at = scaled(TANKER, ratio), type(TANKER.scale)(ratio)
    nu = (u, 0.1, -0.05)
    commands = [c * at.factor(x) for c, x in zip((n, 0.2), command_units(TANKER).values(), strict=True)]
    there = [x * k for x, k in zip(nu, at.speeds, strict=True)]
    found = acceleration(0.7, there, commands, 1.5 * at.speed, 2.0, large)
    back = found / [at.factor(unit) for unit in ("m/s2", "m/s2", "rad/s2")]
    assert back == pytest.approx(acceleration(0.7, nu, (n, 0.2), 1.5, 2.0), rel=1e-9, abs=1e-12)


def test_arrays_give_what_numbers_give():
    rng = np.random.default_rng(1)
    table = rng.uniform((-3.0, -0.8, -0.3, -0.2, -20.0, -0.6), (3.0, 0.8, 0.3, 0.2, 20.0, 0.6), (50, 6))
    table[:4, 1], table[2:6, 4] = 0.0, 0.0
    table[0, 1:4] = 0.0
    psi, u, v, r, n, delta = table.T
    plant, b = SHIP.thrusters.params().plant, body()
    tau = total(forces(TANKER, (n, delta), (u, v, r), plant))
    s = Motion(0.0, 0.0, psi, u, v, r, 0.0)
    together = vessel.disturbed(s, Force(*tau), vessel.blown(b, s, *air_velocity(1.5, 2.0)))
    alone = [acceleration(a, (x, y, z), (k, d), 1.5, 2.0) for a, x, y, z, k, d in table.tolist()]
    assert np.column_stack(together) == pytest.approx(np.array(alone), rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("law", [RudderInRace, FourQuadrantRudder])
@given(inflow=st.floats(0.01, 3.0), added=st.floats(-5.0, 20.0), wider=st.floats(1.0, 3.0))
def test_a_rudder_shorter_than_its_propeller_is_in_the_race_alone(law, inflow, added, wider):
    """Whatever the propeller does: no more than the whole span can be in it."""
    race = Race(inflow, sqrt(max(0.0, inflow * inflow + added)), wider, added, 5.0)
    flow = Flow(inflow, 0.0, inflow, 0.0, 0.0, race)
    p = law.Parameters()._replace(span=1.0, race=0.5)
    u, _ = law.met(flow, p)
    whole, _ = law.met(flow._replace(race=race._replace(diameter=1.0)), p)
    assert np.isfinite(u)
    assert u == whole
