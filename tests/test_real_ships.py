"""KVLCC2 and R/V Gunnerus: their components against published numbers and an independent reading of them."""

from math import atan2, cos, degrees, exp, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ships import SHIPS

from fmus.actuators.actuation import forces, measurable, output
from fmus.actuators.response import total
from fmus.actuators.azimuth_leg import AzimuthLeg
from fmus.actuators.law import Flow
from fmus.hull import damping_force
from fmus.ship import ship
from fmus.signals import Force
from fmus.vessel import vessel

TANKER, GUNNERUS = SHIPS["kvlcc2"], SHIPS["gunnerus"]
SERVICE, SHAFT = 1.18, 10.23  # m/s and 1/s, of the tanker's free-running tests
drift = st.floats(-0.5, 0.5)
rate = st.floats(-0.05, 0.05)


def actuated(d, commands, nu):
    """tau [N, N, N m] of a ship's actuators, as described."""
    return total(forces(d, commands, nu, ship(description=d).thrusters.params().plant))


def acceleration(d, nu, commands):
    """nu_dot of a described ship in still water."""
    b = vessel.hull(
        ship(description=d).vessel.params(), vessel.vessel_effects(ship(description=d).effects)
    )
    return vessel.motion(*nu, Force(*actuated(d, commands, nu)), b)


# The tanker


def mmg(u, v, r, n, delta):
    """X, Y, N of hull, propeller and rudder about midship by the standard method, term by term."""
    rho, L, d, D, A_R, H_R = 1000.0, 7.0, 0.455, 0.204, 0.0539, 0.345
    U = hypot(u, v)
    vp, rp, beta = v / U, r * L / U, atan2(-v, u)
    q = 0.5 * rho * L * d * U * U
    X = q * (-0.022 - 0.040 * vp**2 + 0.002 * vp * rp + 0.011 * rp**2 + 0.771 * vp**4)
    Y = q * (
        -0.315 * vp
        + 0.083 * rp
        - 1.607 * vp**3
        + 0.379 * vp**2 * rp
        - 0.391 * vp * rp**2
        + 0.008 * rp**3
    )
    N = (q * L) * (
        -0.137 * vp
        - 0.049 * rp
        - 0.030 * vp**3
        - 0.294 * vp**2 * rp
        + 0.055 * vp * rp**2
        - 0.013 * rp**3
    )
    beta_P = beta + 0.48 * rp
    C_2 = 1.6 if beta_P > 0.0 else 1.1
    w = 1.0 - 0.6 * (1.0 + (1.0 - exp(-2.0 * abs(beta_P))) * (C_2 - 1.0))
    J = u * (1.0 - w) / (n * D)
    K_T = 0.3226 - 0.2150 * J - 0.1570 * J**2
    X += (1.0 - 0.220) * rho * n**2 * D**4 * K_T
    beta_R = beta + 0.710 * rp
    v_R = U * (0.395 if beta_R < 0.0 else 0.640) * beta_R
    eta = D / H_R
    raced = eta * (1.0 + 0.50 * (sqrt(1.0 + 8.0 * K_T / (pi * J**2)) - 1.0)) ** 2 + 1.0 - eta
    u_R = 1.09 * u * (1.0 - w) * sqrt(raced)
    F_N = 0.5 * rho * A_R * (u_R**2 + v_R**2) * 2.747 * sin(delta - atan2(v_R, u_R))
    X += -(1.0 - 0.387) * F_N * sin(delta)
    Y += -(1.0 + 0.312) * F_N * cos(delta)
    N += -(-0.5 * L + 0.312 * -0.464 * L) * F_N * cos(delta)
    return X, Y, N


@given(st.floats(0.3, 1.3), drift, rate, st.floats(7.0, 11.0), st.floats(-0.6, 0.6))
def test_the_tanker_is_that_of_the_standard_method(u, v, r, n, delta):
    p = ship(description=TANKER).vessel.params()
    hull = np.array(damping_force(u, v, r, p.damping))
    munk = np.array([0.0, 0.0, (p.inertia.X_udot - p.inertia.Y_vdot) * u * v])
    found = hull - munk + actuated(TANKER, (n, delta), (u, v, r))
    assert found == pytest.approx(np.array(mmg(u, v, r, n, delta)), rel=1e-9, abs=1e-9)


def test_inertia_of_the_tanker_is_in_prime_units():
    """m_x' = 0.022 and m_y' = 0.223 over rho L^2 d / 2, J_z' = 0.011 over rho L^4 d / 2."""
    p = ship(description=TANKER).vessel.params().inertia
    mass = 0.5 * 1000.0 * 7.0**2 * 0.455
    assert (-p.X_udot / mass, -p.Y_vdot / mass) == pytest.approx((0.022, 0.223))
    assert -p.N_rdot / (mass * 49.0) == pytest.approx(0.011)
    assert p.I_z == pytest.approx(p.m * ((0.2486 * 7.0) ** 2 + 0.2436**2), rel=1e-4)


# HSVA's open-water test: J -> K_T. The quadratic is within 0.004 of it.
OPEN_WATER = {0.0: 0.323, 0.2: 0.275, 0.4: 0.212, 0.6: 0.137, 0.8: 0.052}


@pytest.mark.parametrize("J", OPEN_WATER)
def test_thrust_of_the_tanker_is_that_of_its_open_water_test(J):
    assert measurable(TANKER) == {"propeller.thrust": "N"}
    n, D, w = SHAFT, 0.204, 0.40
    nu = (J * n * D / (1.0 - w), 0.0, 0.0)
    plant = ship(description=TANKER).thrusters.params().plant
    thrust = output(TANKER, "propeller.thrust", (n, 0.0), nu, plant)
    assert thrust / (1000.0 * n**2 * D**4) == pytest.approx(OPEN_WATER[J], abs=0.004)


@given(st.floats(-0.6, 0.6), st.floats(0.0, 1.2))
def test_a_rudder_in_a_race_has_force_at_rest_and_is_mirrored_without_drift(delta, u):
    X, Y, N = actuated(TANKER, (SHAFT, delta), (u, 0.0, 0.0))
    assert actuated(TANKER, (SHAFT, -delta), (u, 0.0, 0.0)) == pytest.approx((X, -Y, -N))
    assert Y * delta <= 0.0 <= N * delta
    assert abs(Y) > 10.0 * abs(sin(2.0 * delta))


def test_a_stopped_propeller_leaves_the_rudder_the_wake_alone():
    """Without thrust the race is as fast as the inflow: eta and kappa do not matter."""
    plant = ship(description=TANKER).thrusters.params().plant
    rudder = plant.rudder._replace(plant_rudder_race=0.9, plant_rudder_span=0.5)
    other = type(plant)(plant.propeller, rudder)
    J = 0.9128  # of no thrust
    nu = (J * SHAFT * 0.204 / 0.6, 0.0, 0.0)
    nominal, changed = (total(forces(TANKER, (SHAFT, 0.3), nu, p)) for p in (plant, other))
    assert changed == pytest.approx(nominal, rel=1e-3)


def sailed(d, commands, nu, seconds, h=0.1):
    """Poses and velocities (K, 6) of a ship in still water with constant commands."""
    parts = ship(description=d)
    b = vessel.hull(
        parts.vessel.params(), vessel.vessel_effects(parts.effects, type(parts.vessel.params().damping))
    )
    s, found = vessel.State(0.0, 0.0, 0.0, *nu, 0.0), []
    for _ in range(int(seconds / h)):
        found.append(s[:6])
        s = vessel.integrate(s, Force(*actuated(d, commands, s[3:6])), b, h)
    return np.array(found)
