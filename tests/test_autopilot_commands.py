"""Ships whose thrusters get commands: the autopilot steers and drives them by rudder, azimuth and shaft."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.ships import (
    AZIMUTH,
    COMMANDED_SHIPS,
    OPEN_WATER,
    PROPELLER,
    SHIPS,
    described,
    part,
)

from fmus.actuators.actuation import forces
from fmus.actuators.response import total
from fmus.actuators.steering import commands_at, limits, nominal_values, roles, steer, steerable
from fmus.build.finding import BuildError, load
from fmus.controller import heading
from fmus.ship import ship
from fmus.signals import Estimate, Target, VelocityInCurrent

HARD = 0.6
FROUDE = {"kvlcc2": 0.14, "gunnerus": 0.25, "commanded": 0.2, "esso_osaka": 0.1}


def speed(name, d=None):
    """A usual speed of a ship [m/s]."""
    return FROUDE[name] * math.sqrt(9.81 * (d or SHIPS[name]).length)


def steered(d, tau_X, tau_N, nu, helm=0.0):
    return steer(d, tau_X, tau_N, helm, nu, HARD, nominal_values(d))


def force_of(d, drive, helm, nu):
    values = nominal_values(d)
    return total(forces(d, commands_at(d, drive, helm, HARD, values), nu, values))


def twin(*parts):
    return described(*parts)._replace(allocates=False)


# Who drives, who steers


def test_shafts_drive_and_angles_steer_to_starboard():
    found = {name: roles(SHIPS[name]) for name in COMMANDED_SHIPS}
    assert found["kvlcc2"] == ((1.0, 0.0), (0.0, 1.0))
    assert found["esso_osaka"] == ((1.0, 0.0), (0.0, 1.0))
    assert found["gunnerus"] == ((0.0, 1.0), (-1.0, 0.0))
    assert found["commanded"] == ((1.0, 0.0, 0.0, 1.0), (0.0, 1.0, -1.0, 0.0))


def test_an_azimuth_ahead_steers_the_other_way_and_a_tunnel_thruster_not_at_all():
    d = twin(
        part("aft", "azimuth", {**AZIMUTH, "x": -0.9}),
        part("fore", "azimuth", {**AZIMUTH, "x": 0.9}),
        part("bow", "tunnel_thruster", {"x": 0.8, "F": 6.0}),
    )
    assert roles(d) == ((0.0, 1.0, 0.0, 1.0, 0.0), (-1.0, 0.0, 1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "parts",
    [
        (part("port", "fixed_propeller", {**PROPELLER, "y": -0.4, "x": -1.0}),),
        (part("rudder", "rudder", {"x": -1.0}),),
    ],
)
def test_a_ship_that_cannot_be_steered_or_driven_so_has_no_autopilot(parts):
    d = twin(*parts)
    assert not steerable(d)
    with pytest.raises(BuildError, match="no FMU 'controller_heading' for the ship 'tried'"):
        load("controller_heading", None, ship(description=d))


# From a request to commands


@pytest.mark.parametrize("name", COMMANDED_SHIPS)
@given(st.floats(0.5, 1.0), st.floats(-1.0, 1.0), st.floats(0.5, 1.2), st.floats(-0.1, 0.1))
def test_a_force_in_reach_is_given(name, drive, helm, ahead, drift):
    """The request is what some commands give; the angle of the step before is already there."""
    d = SHIPS[name]
    U = ahead * speed(name)
    nu = (U, drift * U, 0.3 * drift * U / d.length)
    X, _, N = force_of(d, drive, helm, nu)
    at = steered(d, X, N, nu, helm)
    full_X, _, full_N = (abs(x) for x in force_of(d, 1.0, 1.0, (U, 0.0, 0.0)))
    assert at.tau[0] == pytest.approx(X, abs=1e-4 * (full_X + full_N / d.length))
    assert at.tau[2] == pytest.approx(N, abs=1e-4 * full_N)


@pytest.mark.parametrize("name", COMMANDED_SHIPS)
@given(st.floats(-1e12, 1e12), st.floats(-1e12, 1e12), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_commands_stay_within_their_limits(name, X, N, u, v):
    d = SHIPS[name]
    for command, steers, (low, high) in zip(
        steered(d, X, N, (u, v, 0.0)).commands,
        roles(d).steers,
        limits(d, nominal_values(d)),
        strict=True,
    ):
        assert low <= command <= high
        assert not steers or abs(command) <= HARD


@given(st.floats(-1.0, 1.0), st.floats(0.2, 1.0), st.floats(-0.2, 0.2))
def test_port_and_starboard_are_alike(helm, drive, drift):
    d, U = SHIPS["gunnerus"], speed("gunnerus")
    X, _, N = force_of(d, drive, helm, (U, drift * U, 0.0))
    one, other = (steered(d, X, side * N, (U, side * drift * U, 0.0)).commands for side in (1.0, -1.0))
    assert other == pytest.approx((-one[0], one[1]), abs=1e-4)


RUDDER = twin(
    part("screw", "open_water_propeller", {**OPEN_WATER, "x": -1.0}),
    part("rudder", "rudder", {"x": -1.1, "area": 0.02}),
)


def test_a_rudder_goes_the_other_way_astern_and_further_at_less_speed():
    slow, fast, astern = (steered(RUDDER, 0.0, 3.0, (u, 0.0, 0.0)).commands[1] for u in (1.0, 1.4, -1.0))
    assert 0.0 < fast < slow < HARD
    assert astern == pytest.approx(-slow, abs=1e-3)


def test_what_has_no_effect_stays_amidships():
    assert steered(RUDDER, 0.0, 3.0, (0.0, 0.0, 0.0)).commands == pytest.approx((0.0, 0.0), abs=1e-9)


# In closed loop


def turn(name, d, U, angle, lengths=14.0, h=0.05):
    """A change of heading from straight ahead, the state known; h and the way in ship's lengths.

    Returns:
        Rows of (x, y, psi, u) in ship's lengths and shares of U, and the largest share of a limit.
    """
    parts, controller = ship(description=d), heading.make(ship().effects, d)
    assert controller is not None
    vessel, thrusters = parts.vessel, parts.thrusters
    c, hull = controller.prepared(controller.params()), vessel.prepared(vessel.params())
    drive = thrusters.prepared(thrusters.params())
    state = vessel.init(None, vessel.params())._replace(x=0.0, y=0.0, psi=0.0, u=U)
    past, cs, rows = thrusters.init(None, thrusters.params()), None, []
    aim = Target(psi_t=angle, x_t_dot=U * math.cos(angle), y_t_dot=U * math.sin(angle))
    seconds = h * d.length / U
    for _ in range(round(lengths / h)):
        i = controller.inputs(Estimate(state.x, state.y, state.psi, state.u, state.v, state.r), aim)
        cs = cs or controller.init(i, controller.params())
        cs, out = controller.advance(cs, i, c, seconds)
        nu = VelocityInCurrent(state.u, state.v, state.r)
        past, acts = thrusters.advance(past, thrusters.inputs(out.commands, nu), drive, seconds)
        tau = vessel.inputs(acts.tau_act_X, acts.tau_act_Y, acts.tau_act_N)
        state, _ = vessel.advance(state, tau, hull, seconds)
        rows.append((state.x / d.length, state.y / d.length, state.psi, state.u / U))
    return np.array(rows).T


TANKER = SHIPS["kvlcc2"]


def test_a_tanker_turns_on_the_same_track_at_every_speed():
    """All its forces go with the square of the speed, and the tuning with them."""
    slow, fast = (turn("kvlcc2", TANKER, U, math.radians(20.0)) for U in (0.8, 1.6))
    assert fast == pytest.approx(slow, abs=1e-5)
    _, _, psi, u = slow
    assert psi.max() < math.radians(22.0)
    assert psi[-1] == pytest.approx(math.radians(20.0), abs=math.radians(1.0))
    assert u[-1] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("name", "side"),
    [("gunnerus", -1.0), ("kvlcc2", 1.0)],
)
def test_a_ship_comes_to_its_new_heading(name, side):
    _, y, psi, u = turn(name, SHIPS[name], speed(name), side * math.radians(30.0), 20.0)
    psi, y = side * psi, side * y
    assert psi.max() < math.radians(36.0)
    assert psi[-1] == pytest.approx(math.radians(30.0), abs=math.radians(1.5))
    assert y[-1] > 5.0
    assert u[-1] == pytest.approx(1.0, abs=0.05)
