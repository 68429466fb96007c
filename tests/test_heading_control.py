"""Ships that cannot push sideways: autopilot and line-of-sight guidance."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.project import COMPONENTS, ROOT, with_values
from support.ships import SHIPS, scaled

import cosim
from fmus.controller.backstepping import Applied, Inputs
from fmus.declare import flatten
from fmus.hull import damping_force, mass_matrix
from fmus.ship import ship
from fmus.signals import Estimate, Force, Target, VelocityInCurrent
from fmus.sizing import sized
from fmus.vessel.vessel import water_velocity

HEADING, LOS = COMPONENTS["controller_heading"], COMPONENTS["guidance_los"]
OTTER = SHIPS["otter"]
H = 0.02


# The autopilot, on the hull of Nomoto: m r_dot + d r = N

# Prime units that are 1 m and 1 m/s: their numbers are rad/s.
NO_TURN = {"integral": 0.0, "N_absr_r": 0.0, "length": 1.0, "u_least": 1.0}


def nomoto(psi_t, seconds, off=0.0, stated=lambda N: N, **values):
    """Heading off the reference at the start; rows of (psi, r, psi_d, r_d, tau_N) at steps of H."""
    p = with_values(HEADING, **{**NO_TURN, **values})
    m, d = mass_matrix(p.inertia)[2][2], -p.damping.N_r
    target = Target(psi_t=psi_t)
    psi, r, acting, rows = off, 0.0, 0.0, []
    s = HEADING.init(Inputs(Estimate(), target), p)
    for _ in range(round(seconds / H)):
        applied = Applied(0.0, 0.0, acting)
        s, out = HEADING.step(s, Inputs(Estimate(psi_hat=psi, r_hat=r), target, applied), p, H)
        acting = stated(out.demand.tau.tau_N)
        rows.append((psi, r, out.psi_d, out.r_d, out.demand.tau.tau_N))
        decay = math.exp(-d / m * H)
        steady = acting / d
        psi += steady * H + (r - steady) * (1.0 - decay) * m / d
        r = steady + (r - steady) * decay
    return np.array(rows).T


@pytest.mark.parametrize("zeta", [0.4, 0.6, 0.8])
def test_a_heading_error_dies_as_in_the_closed_form(zeta):
    """Overshoot and its time of the second order; the reference stands still."""
    w = 2.0
    psi, *_ = nomoto(0.0, 8.0, 0.1, omega_psi_prime=w, zeta_psi=zeta)
    damped = w * math.sqrt(1.0 - zeta * zeta)
    lowest = int(np.argmin(psi))
    assert psi[lowest] / -0.1 == pytest.approx(math.exp(-math.pi * zeta * w / damped), abs=0.03)
    assert lowest * H == pytest.approx(math.pi / damped, rel=0.03)


@pytest.mark.parametrize("omega", [0.3, 1.0])
def test_a_known_hull_follows_the_reference_of_third_order(omega):
    psi, _, psi_d, *_ = nomoto(0.1, 20.0, omega_d_prime=omega, r_max_prime=10.0)
    x = omega * H * np.arange(1, psi.size + 1)
    exact = 0.1 * (1.0 - np.exp(-x) * (1.0 + x + 0.5 * x * x))
    assert psi_d == pytest.approx(exact, abs=0.1 * omega * H)
    assert psi[1:] == pytest.approx(psi_d[:-1], abs=0.002)


@pytest.mark.parametrize("r_max", [0.02, 0.1])
def test_the_steady_rate_is_that_of_the_moment(r_max):
    """r = K N with Nomoto's gain K = 1 / d; a turn comes to no more than its limit, and to no overshoot."""
    _, r, psi_d, r_d, N = nomoto(3.0, 3.2 / r_max + 40.0, r_max_prime=r_max)
    middle = round(1.5 / r_max / H)
    d = -HEADING.params().damping.N_r
    assert r[middle] == pytest.approx(r_max, rel=0.01)
    assert r[middle] == pytest.approx(N[middle] / d, rel=1e-3)
    assert r_d.max() < 1.01 * r_max
    assert r_d.min() > -0.01 * r_max
    assert psi_d.max() < 3.0 + 1e-3
    assert psi_d[-1] == pytest.approx(3.0, abs=1e-3)


def test_the_heading_takes_the_shorter_way():
    _, _, psi_d, *_ = nomoto(3.5, 0.2)
    assert psi_d[-1] < 0.0


def test_a_moment_that_the_thrusters_do_not_give_is_not_wound_up():
    def asked_by(stated):
        return nomoto(0.5, 400.0, stated=stated, integral=0.1)[-1]

    K_P = mass_matrix(HEADING.params().inertia)[2][2] * HEADING.params().omega_psi_prime ** 2
    helpless = asked_by(lambda N: 0.0)
    assert helpless[-1] == pytest.approx(0.1 * K_P * 0.5, rel=0.01)
    limit = 0.02
    psi = nomoto(0.5, 400.0, stated=lambda N: float(np.clip(N, -limit, limit)), integral=0.1)[0]
    assert psi.max() < 0.55
    assert psi[-1] == pytest.approx(0.5, abs=1e-3)


def test_force_and_moment_that_the_model_lacks_are_told_once_the_ship_is_steady():
    p, h = with_values(HEADING, **{**NO_TURN, "integral": 0.1}), 0.1
    (m_u, _, _), _, (_, _, m_r) = mass_matrix(p.inertia)
    c, target = p.damping, Target(x_t_dot=0.2)
    u, r, psi, tau = 0.2, 0.0, 0.0, Force()
    s = HEADING.init(Inputs(Estimate(u_hat=u), target), p)
    for _ in range(2500):
        e = Estimate(psi_hat=psi, u_hat=u, r_hat=r)
        s, out = HEADING.step(s, Inputs(e, target, Applied(*tau)), p, h)
        tau = out.demand.tau
        drag = (c.X_u + c.X_absu_u * abs(u) + c.X_uuu * u * u) * u
        u, r = u + h * (tau.tau_X + drag + 0.2) / m_u, r + h * (tau.tau_N + c.N_r * r - 0.05) / m_r
        psi += h * r
    stated = out.demand
    assert (stated.omega_hat_X, stated.omega_hat_Y, stated.omega_hat_N) == pytest.approx(
        (0.2, 0.0, -0.05), rel=1e-3
    )
    assert (u, psi) == pytest.approx((0.2, 0.0), abs=1e-4)


def test_a_ship_that_tells_no_force_is_taken_to_give_what_is_asked_whatever_its_size():
    for size in (OTTER, scaled(OTTER, 100.0)):
        c = sized(HEADING, size)
        p, i = c.params(), c.inputs(target=Target(psi_t=0.5))
        s, out = c.step(c.init(i, p), i, p, 0.1)
        asked = Applied(*out.demand.tau)
        known, unknown = (c.step(s, i._replace(applied=a), p, 0.1)[1] for a in (asked, i.applied))
        assert flatten(known.demand) == pytest.approx(flatten(unknown.demand))


@given(st.floats(-3.0, 3.0), st.floats(0.0, 0.3), st.floats(-0.1, 0.1))
def test_it_starts_with_the_force_that_keeps_the_motion(psi, u, r):
    p = HEADING.params()
    e = Estimate(psi_hat=psi, u_hat=u, r_hat=r)
    t = Target(psi_t=psi, x_t_dot=u * math.cos(psi), y_t_dot=u * math.sin(psi))
    inputs = Inputs(e, t)
    out = HEADING.step(HEADING.init(inputs, p), inputs, p, 0.0)[1]
    hull = COMPONENTS["vessel"].params().damping
    X, _, _ = damping_force(u, 0.0, 0.0, hull)
    _, _, N = damping_force(0.0, 0.0, r, hull)
    assert flatten(out.demand.tau) == pytest.approx([-X, 0.0, -N], abs=1e-9)


@pytest.mark.parametrize("share", [0.1, 0.4])
def test_the_wave_filter_leaves_a_share_of_the_waves_and_all_of_the_rest(share):
    """Of a heading that swings, the moment's amplitude; of one that is off, the moment itself."""
    w = 1.2

    def moments(swing, **values):
        p = with_values(HEADING, integral=0.0, **values)
        s, rows = HEADING.init(Inputs(), p), []
        for k in range(3000):
            psi = 0.01 * (math.sin(w * k * H) if swing else 1.0)
            r = 0.01 * w * math.cos(w * k * H) if swing else 0.0
            s, out = HEADING.step(s, Inputs(Estimate(psi_hat=psi, r_hat=r)), p, H)
            rows.append(out.demand.tau.tau_N)
        return np.array(rows)

    waves, constant = (moments(swing, omega_wave=w, zeta_wave=share)[1500:] for swing in (True, False))
    whole = moments(True)[1500:]
    assert np.ptp(waves) / np.ptp(whole) == pytest.approx(share, rel=0.05)
    assert constant == pytest.approx(moments(False)[1500:], rel=1e-6)


# Line of sight


def aimed(values, rows, h=0.1):
    """Guidance at ships of these positions (north, east), one after the other."""
    p = with_values(LOS, **values)
    s = LOS.init(LOS.inputs(), p)
    outs = []
    for x, y in rows:
        s, out = LOS.step(s, LOS.inputs(Estimate(x_hat=x, y_hat=y, u_hat=0.5)), p, h)
        outs.append(out)
    return outs


LEG = {"count": 2.0, "loop": 0.0, "x_1": 1.0, "y_1": -2.0, "lookahead_time": 2.0, "integral": 0.0}


@given(st.floats(-3.0, 3.0), st.floats(1.0, 9.0), st.floats(-5.0, 5.0))
def test_the_heading_is_to_a_point_ahead_on_the_leg(course, ahead, aside):
    c, s = math.cos(course), math.sin(course)
    leg = LEG | {"x_2": 1.0 + 10.0 * c, "y_2": -2.0 + 10.0 * s, "lookahead": 0.7, "acceptance": 0.01}
    x, y = 1.0 + ahead * c - aside * s, -2.0 + ahead * s + aside * c
    (out,) = aimed(leg, [(x, y)])
    t = out.target
    assert (t.x_t, t.y_t) == pytest.approx((1.0 + ahead * c, -2.0 + ahead * s), abs=1e-9)
    assert out.y_e == pytest.approx(aside, abs=1e-9)
    to = math.atan2(t.y_t + 1.7 * s - y, t.x_t + 1.7 * c - x)
    assert math.cos(t.psi_t - to) == pytest.approx(1.0)
    speed = math.hypot(t.x_t_dot, t.y_t_dot)
    assert speed == pytest.approx(LOS.params().u_t)
    assert t.x_t_dot == pytest.approx(speed * math.cos(t.psi_t))


SQUARE = {"count": 4.0, "x_1": 0.0, "x_2": 9.0, "x_3": 9.0, "x_4": 0.0,
          "y_1": 0.0, "y_2": 0.0, "y_3": 9.0, "y_4": 9.0, "acceptance": 1.0}  # fmt: skip


def test_legs_follow_each_other_inside_the_circles_of_acceptance():
    way = [(7.9, 0.0), (8.1, 0.0), (9.0, 7.9), (9.0, 8.1), (0.8, 9.0), (0.0, 0.8), (8.1, 0.0)]
    assert [out.leg for out in aimed(SQUARE, way)] == [1, 2, 2, 3, 4, 1, 2]
    open_end = aimed(SQUARE | {"loop": 0.0}, way)
    assert [out.leg for out in open_end] == [1, 2, 2, 3, 3, 3, 3]
    assert [out.arrived for out in open_end] == [0, 0, 0, 0, 1, 1, 1]
    assert open_end[-1].target.x_t_dot == open_end[-1].target.y_t_dot == 0.0


def test_a_circle_that_is_missed_ends_abreast_of_the_way_point():
    assert [out.leg for out in aimed(SQUARE, [(8.9, -3.0), (9.1, -3.0)])] == [1, 2]


# In closed loop


def voyage(d, seconds, legs, mirrored=False, current=(0.0, 0.0), **values):
    """A described ship by autopilot and line of sight, its state known.

    Lengths, speeds and times are those of the Otter's size, whatever the size of the ship.

    Returns:
        Rows of (x, y, psi, u, y_e) at each step, again in the Otter's size.
    """
    at = type(d.scale)(d.length / OTTER.length)
    side = -1.0 if mirrored else 1.0
    route = {f"{axis}_{k + 1}": (1.0, side)[axis == "y"] * w[axis == "y"]
             for k, w in enumerate(legs) for axis in "xy"}  # fmt: skip
    of_guidance = {"u_t": 0.8, "count": float(len(legs)), "loop": 0.0} | route | values
    guidance, controller, parts = sized(LOS, d), sized(HEADING, d), ship(description=d)
    units = {v.name: v.unit for v in guidance.variables}
    g = with_values(guidance, **{k: x * at.factor(units[k]) for k, x in of_guidance.items()})
    c = controller.params()
    vessel, thrusters = parts.vessel, parts.thrusters
    flow = [x * at.speed * k for x, k in zip(current, (1.0, side), strict=True)]
    hull = vessel.prepared(with_values(vessel, V_n=flow[0], V_e=flow[1]))
    drive = thrusters.prepared(thrusters.params())
    state = vessel.init(None, vessel.params())._replace(x=0.0, y=0.0, psi=0.0, u=0.4 * at.speed)
    past, gs, cs, stated, rows = thrusters.init(None, thrusters.params()), None, None, None, []
    h = 0.1 * at.time
    for _ in range(round(seconds / 0.1)):
        e = Estimate(state.x, state.y, state.psi, state.u, state.v, state.r)
        gs = gs or guidance.init(guidance.inputs(e), g)
        gs, aim = guidance.step(gs, guidance.inputs(e), g, h)
        i = controller.inputs(e, aim.target, stated or controller.inputs().applied)
        cs = cs or controller.init(i, c)
        cs, out = controller.step(cs, i, c, h)
        assert out.demand.tau.tau_Y == 0.0
        nu = VelocityInCurrent(state.u, state.v, state.r, *water_velocity(state, hull))
        past, acts = thrusters.advance(past, thrusters.inputs(out.demand.tau, nu), drive, h)
        stated = Applied(acts.tau_cmd_X, acts.tau_cmd_Y, acts.tau_cmd_N)
        tau = Force(acts.tau_act_X, acts.tau_act_Y, acts.tau_act_N)
        state, _ = vessel.advance(state, tau, hull, h)
        rows.append((state.x / at.length, side * state.y / at.length, side * state.psi,
                     state.u / at.speed, side * aim.y_e / at.length))  # fmt: skip
    return np.array(rows).T


CORNER = [(0.0, 0.0), (30.0, 0.0), (45.0, 40.0)]


def test_port_and_starboard_are_alike():
    there, here = (voyage(OTTER, 80.0, CORNER, mirrored) for mirrored in (False, True))
    assert here == pytest.approx(there, abs=1e-9)
    assert there[2][-1] == pytest.approx(math.atan2(40.0, 15.0), abs=0.1)


def test_a_ship_of_another_size_sails_the_same_in_its_own_lengths():
    small, large = (voyage(d, 60.0, CORNER) for d in (OTTER, scaled(OTTER, 10.0)))
    assert large == pytest.approx(small, rel=1e-6, abs=1e-6)


NORTH = [(0.0, 0.0), (300.0, 0.0)]


def test_line_of_sight_lies_off_the_leg_in_a_current_and_its_integral_does_not():
    """Through the water u sin psi = -V, and the ship aims at the leg: y_e = Delta V / sqrt(u^2 - V^2)."""
    V, lookahead = 0.2, 8.0
    fixed = {"lookahead": lookahead, "lookahead_time": 0.0}
    _, _, psi, u, off = voyage(OTTER, 100.0, NORTH, current=(0.0, V), integral=0.0, **fixed)
    u = u - V * np.sin(psi)
    assert off[-1] == pytest.approx(lookahead * V / math.sqrt(u[-1] ** 2 - V * V), rel=0.01)
    *_, on = voyage(OTTER, 120.0, NORTH, current=(0.0, V), integral=0.25, **fixed)
    assert abs(on[-1]) < 0.1 * off[-1]


def off_route(log, points):
    """Distance to the nearest leg of a closed route [m]."""
    x, y = log["vessel.x"], log["vessel.y"]
    distances = []
    for (x_1, y_1), (x_2, y_2) in pairwise([*points, points[0]]):
        n, e = x_2 - x_1, y_2 - y_1
        along = np.clip(((x - x_1) * n + (y - y_1) * e) / (n * n + e * e), 0.0, 1.0)
        distances.append(np.hypot(x - x_1 - along * n, y - y_1 - along * e))
    return np.min(distances, axis=0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "current", "rms", "largest", "digit"),
    [
        ("otter_los", (0.1, 0.05), 1.2, 2.3, 0.1),
        ("otter_waypoints", (0.1, 0.05), 3.1, 6.6, 0.1),
        ("otter_los", (0.0, 0.0), 0.8, 1.9, 0.1),
        ("otter_waypoints", (0.0, 0.0), 0.4, 1.9, 0.1),
        ("kvlcc2_waypoints", (0.1, 0.08), 3.7, 13.6, 0.1),
        ("kvlcc2_waypoints", (0.0, 0.0), 3.5, 13.1, 0.1),
        ("gunnerus_waypoints", (0.3, 0.2), 14.0, 45.0, 1.0),
        ("gunnerus_waypoints", (0.0, 0.0), 13.0, 48.0, 1.0),
    ],
)
def test_a_ship_rounds_its_route(name, current, rms, largest, digit, tmp_path):
    """The tables of docs/controllers.md, whose last digit is ``digit``."""
    content = json.loads((ROOT / "scenarios" / f"{name}.json").read_text())
    content["fmus"]["vessel"]["parameters"] |= dict(zip(("V_n", "V_e"), current, strict=True))
    guidance = content["fmus"]["guidance"]
    route = guidance["table"] = str(ROOT / "scenarios" / guidance["table"])
    result = cosim.simulate(content, tmp_path)
    log = result.log
    assert (result.status, result.warnings) == ("done", [])
    late = np.asarray(log["time"]) > 100.0
    off = off_route(log, np.loadtxt(route, delimiter=",", skiprows=1))[late]
    assert np.sqrt(np.mean(off**2)) == pytest.approx(rms, abs=0.6 * digit)
    assert off.max() == pytest.approx(largest, abs=0.6 * digit)
    assert np.mean(log["observer.u_hat"][late]) == pytest.approx(guidance["parameters"]["u_t"], rel=0.03)
