"""Described ships: the physics of their hulls and actuators, and the publications that they are from."""

from itertools import pairwise
from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from support.closed_form import Allocation, thrust
from support.closed_form import allocate as allocate_three
from support.ships import (
    AZIMUTH,
    COMMANDED,
    EVERY_LAW,
    LEG,
    OPEN_WATER,
    PROPELLER,
    RACE_RUDDER,
    SHIPS,
    TABLE,
    described,
    part,
    scaled,
)

from fmus import hull_functions
from fmus.actuators.actuation import actuators, command_names, forces, ordered, shared
from fmus.actuators.actuator import twins
from fmus.actuators.failings import failings
from fmus.actuators.law import Flow, Law, Race
from fmus.actuators.response import at_rest, command_response, total
from fmus.actuators.steering import nominal_values
from fmus.actuators.weighted_allocation import allocate, axes
from fmus.declare import group_of, variables
from fmus.effects import Running
from fmus.hull import (
    Damping,
    Inertia,
    RotationalDamping,
    TowedDamping,
    coriolis_force,
    damping_force,
    mass_matrix,
    rotational_damping_force,
    term_variable,
    terms_force,
    towed_damping_force,
)
from fmus.hull_functions import cross_flow
from fmus.ship import ship
from fmus.ship_description import Value
from fmus.ships.expansion import effects_of_ship
from fmus.ships.ship_file import Term, read_ship
from fmus.signals import Force, VelocityInCurrent

speed = st.floats(-2.0, 2.0)
share = st.floats(0.0, 1.0)
every_ship = pytest.mark.parametrize("name", SHIPS)
# Examples of a property for each of many laws or terms, which have most of their code in common.
few = settings(max_examples=15)
REST = (0.0, 0.0, 0.0)


def params(name):
    return ship(description=SHIPS[name]).vessel.params()


# Hull


@given(speed, speed, speed)
def test_terms_give_the_forces_of_the_groups_of_table_2_1(u, v, r):
    found = damping_force(u, v, r, Damping())
    towed = towed_damping_force(u, v, TowedDamping())
    turned = rotational_damping_force(v, r, RotationalDamping())
    assert found == pytest.approx(np.add(towed, turned), rel=1e-12, abs=1e-12)


PRODUCTS = {
    "u": lambda u, v, r: u,
    "uv": lambda u, v, r: u * v,
    "vr": lambda u, v, r: v * r,
    "uuu": lambda u, v, r: u**3,
    "|r|r": lambda u, v, r: abs(r) * r,
    "r|v|": lambda u, v, r: abs(v) * r,
    "|u||v|": lambda u, v, r: abs(u * v),
    "uur": lambda u, v, r: u * u * r,
}


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("product", PRODUCTS)
@few
@given(speed, speed, speed)
def test_a_term_is_the_product_of_its_name(product, axis, u, v, r):
    name = Term(axis="XYN"[axis], product=product, value=1.0).name
    terms = group_of("Terms", [term_variable(name)])
    found = terms_force(u, v, r, terms(2.5))
    expected = [0.0, 0.0, 0.0]
    expected[axis] = 2.5 * PRODUCTS[product](u, v, r)
    assert found == pytest.approx(tuple(expected), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "unit"),
    [("X_u", "N.s/m"), ("Y_absv_r", "N.s2/(m.rad)"), ("N_absr_r", "N.m.s2/rad2"), ("X_uuv", "N.s3/m3")],
)
def test_a_term_has_the_unit_of_a_force_over_its_product(name, unit):
    assert term_variable(name).unit == unit


@every_ship
@given(speed, speed, speed)
def test_port_and_starboard_are_alike(name, u, v, r):
    c = params(name).damping
    X, Y, N = damping_force(u, v, r, c)
    assert damping_force(u, -v, -r, c) == pytest.approx((X, -Y, -N), rel=1e-12, abs=1e-12)


@every_ship
@given(speed, speed, speed)
def test_inertia_neither_works_nor_vanishes(name, u, v, r):
    p = params(name).inertia
    X, Y, N = coriolis_force(u, v, r, p)
    size = abs(X * u) + abs(Y * v) + abs(N * r)
    assert X * u + Y * v + N * r == pytest.approx(0.0, abs=1e-12 * (1.0 + size))
    M = np.array(mass_matrix(p))
    assert np.array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 0.0


def by_integral(v, r, length=2.0, draft=0.3, drag=0.9, density=1000.0):
    """Force and moment of the cross-flow [N, N m] by adaptive quadrature."""
    ends = [-0.5 * length, *([-v / r] if r and abs(v / r) < 0.5 * length else []), 0.5 * length]

    def of(power):
        pieces = [
            quad(lambda x: x**power * abs(v + x * r) * (v + x * r), a, b)[0] for a, b in pairwise(ends)
        ]
        return -0.5 * density * drag * draft * sum(pieces)

    return of(0), of(1)


@pytest.mark.parametrize(("v", "r"), [(0.4, 0.0), (0.0, 0.3), (0.1, 0.4), (0.5, -0.2), (-0.2, 1.0)])
def test_strips_of_the_cross_flow_converge_to_its_integral(v, r, monkeypatch):
    errors = []
    for strips in (10, 20, 40):
        monkeypatch.setattr(hull_functions, "STRIPS", strips)
        X, Y, N = cross_flow(0.7, v, r, 1000.0, 2.0, 0.3, 0.9)
        assert X == 0.0
        exact = by_integral(v, r)
        size = max(map(abs, exact))
        errors.append(max(abs(Y - exact[0]), abs(N - exact[1])) / size)
    assert errors[0] <= 0.0201
    assert errors[2] < max(1e-12, errors[0] / 8.0)


@given(speed, speed)
def test_cross_flow_only_brakes(v, r):
    _, Y, N = cross_flow(0.5, v, r)
    assert Y * v + N * r <= 0.0


# Actuators

LAWS = {
    "fixed_propeller": PROPELLER,
    "open_water_propeller": OPEN_WATER,
    "tunnel_thruster": {"F": 3.0},
    "voith_schneider": {"F": 3.0},
    "squared_tunnel_thruster": {"F": 3.0},
    "squared_voith_schneider": {"F": 3.0},
    "tabulated_tunnel_thruster": {"F": 3.0},
    "tabulated_voith_schneider": {"F": 3.0},
    "azimuth": AZIMUTH,
    "rudder": {"area": 0.02, "hull_force": 0.2, "wake": 0.1, "steering_deduction": 0.3, "bias": 0.1},
    "given_force": {"F_X": 3.0, "F_Y": 2.0},
    "propeller_behind_hull": {**OPEN_WATER, "C_2_plus": 1.6, "C_2_minus": 1.1},
    "rudder_in_race": RACE_RUDDER,
    "four_quadrant_propeller": {
        **{name: x for name, x in OPEN_WATER.items() if name != "astern"},
        "wake_slope": -0.3,
        "pitch": 0.15,
        "A_5": -0.001,
        "A_8": 0.001,
        "B_5": 0.001,
    },
    "four_quadrant_rudder": {**RACE_RUDDER, "race_astern": 0.1, "pressure_astern": -0.2},
    "azimuth_with_leg": LEG,
    "force_table_surge": TABLE,
    "force_table_sway": TABLE,
}
RACE = Race(0.3, 1.2, 0.2)
FLOWS = [Flow(race=RACE), Flow(1.0, 0.0, 1.0, race=RACE), Flow(-0.6, 0.0, -0.6, race=RACE)]
every_law = pytest.mark.parametrize("name", LAWS)


def test_every_law_is_tested():
    ships = EVERY_LAW, COMMANDED, SHIPS["esso_osaka"]
    sailed = {a.law for d in ships for a in d.actuators}
    ours = {name for name, law in Law.known.items() if law.__module__.startswith("fmus.actuators.")}
    assert set(LAWS) == ours == sailed


@every_law
@pytest.mark.parametrize("flow", FLOWS)
@few
@given(share, share)
def test_commands_give_the_force_that_is_asked_for_within_reach(name, flow, a, b):
    law = Law.known[name]
    p = law.Parameters(**LAWS[name])
    reach = law.reach(flow, p)
    asked = [low + s * (high - low) for s, (low, high) in zip((a, b), reach, strict=False)]
    if name == "azimuth":  # the corners of its reach are beyond a circle
        asked = [x / 1.5 for x in asked]
    if not law.components:
        return
    commands = law.commanded(tuple(asked), flow, p)
    for c, (low, high) in zip(commands, law.limits(p), strict=True):
        assert low - 1e-9 <= c <= high + 1e-9
    given = dict(zip("XY", law.force(commands, flow, p), strict=True))
    assert [given[axis] for axis in law.components] == pytest.approx(asked, rel=1e-6, abs=1e-6)


@every_law
@few
@given(share, share)
def test_reach_is_what_commands_within_their_limits_give(name, a, b):
    law = Law.known[name]
    p = law.Parameters(**LAWS[name])
    for flow in FLOWS:
        spans = law.limits(p)
        commands = [low + s * (high - low) for s, (low, high) in zip((a, b), spans, strict=False)]
        given = dict(zip("XY", law.force(tuple(commands), flow, p), strict=True))
        for axis, (low, high) in zip(law.components, law.reach(flow, p), strict=True):
            if "diameter" in LAWS[name] and flow.u > 0.0 and commands[0] > 0.0:
                assert given[axis] <= high + 1e-9  # a slow propeller that the ship drags along
            else:
                assert low - 1e-9 <= given[axis] <= high + 1e-9


@given(st.floats(0.1, 1.5), st.floats(-0.5, 0.5), st.sampled_from([1.0, -0.6]))
def test_a_rudder_reaches_the_extremes_over_its_angles(delta_max, bias, u):
    """Beyond 45 degrees its force falls again."""
    law = Law.known["rudder"]
    p, flow = law.Parameters(delta_max=delta_max, bias=bias), Flow(u, 0.0, u)
    _, Y = law.force((np.linspace(-delta_max, delta_max, 4001),), flow, p)
    (span,) = law.reach(flow, p)
    assert span == pytest.approx((Y.min(), Y.max()), rel=1e-5, abs=1e-9)


@every_law
@few
@given(share, share)
def test_one_source_serves_floats_and_arrays(name, a, b):
    law = Law.known[name]
    p = law.Parameters(**LAWS[name])
    commands = [low + s * (high - low) for s, (low, high) in zip((a, b), law.limits(p), strict=False)]
    alone = law.force(tuple(commands), Flow(0.3, 0.1, 0.3, 0.2, 0.1, RACE), p)
    arrays = tuple(np.array([c, c]) for c in commands)
    series = [np.array([x, x]) for x in (0.3, 0.1, 0.3, 0.2, 0.1)]
    together = law.force(arrays, Flow(*series, RACE), p)
    assert [x[1] for x in together] == pytest.approx(alone, rel=1e-12, abs=1e-15)


def test_an_azimuth_that_cannot_turn_round_runs_backwards():
    law = Law.known["azimuth"]
    p = law.Parameters(**AZIMUTH, n_min=-8.0, alpha_max=0.6)
    asked = (-10.0, 2.0)
    alpha, n = law.commanded(asked, Flow(), p)
    assert n < 0.0
    assert abs(alpha) < 0.6
    assert law.force((alpha, n), Flow(), p) == pytest.approx(asked)


@given(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(0.1, 3.0), st.floats(-8.0, 0.0))
def test_an_azimuth_never_works_against_what_is_asked(X, Y, alpha_max, n_min):
    law = Law.known["azimuth"]
    p = law.Parameters(**AZIMUTH, n_min=n_min, alpha_max=alpha_max)
    got = law.force(law.commanded((X, Y), Flow(), p), Flow(), p)
    assert got[0] * X + got[1] * Y >= -1e-9


@given(st.floats(0.1, 3.0), st.floats(-0.6, 0.6), st.floats(-1.0, 1.0))
def test_a_rudder_is_a_plate_whose_force_turns_with_the_flow(u, delta, v):
    law = Law.known["rudder"]
    p = law.Parameters()
    ahead = law.force((delta,), Flow(u, v), p)
    mirrored = law.force((-delta,), Flow(u, -v), p)
    assert mirrored == pytest.approx((ahead[0], -ahead[1]), abs=1e-12)
    reversed_flow = law.force((delta,), Flow(-u, -v), p)
    assert reversed_flow == pytest.approx((-ahead[0], -ahead[1]), abs=1e-12)
    assert ahead[0] * u + ahead[1] * v <= 1e-12  # it takes energy out of the motion
    assert ahead[0] * np.cos(delta) == pytest.approx(ahead[1] * np.sin(delta), abs=1e-9)  # normal to it


@given(speed, speed, st.floats(-30.0, 30.0), st.floats(-30.0, 30.0))
def test_a_force_at_a_place_gives_its_moment(x, y, X, Y):
    tug = described(part("tug", "given_force", {"F_X": 30.0, "F_Y": 30.0, "x": x, "y": y}))
    tau = total(forces(tug, (X, Y), REST, nominal_values(tug)))
    assert tau == pytest.approx((X, Y, x * Y - y * X))


@every_ship
@given(st.data())
def test_commands_beyond_their_limits_count_as_the_limits(name, data):
    d = SHIPS[name]
    values = nominal_values(d)
    limits = [
        span for a in ordered(d) for span in a.law.limits(a.law.Parameters._make(values[a.k][:-2]))
    ]
    goes_round = ship(description=d).layout.round
    given = [data.draw(st.floats(-3.0, 3.0) if angle else st.floats(-1e3, 1e3)) for angle in goes_round]
    kept = [min(max(c, low), high) for c, (low, high) in zip(given, limits, strict=True)]
    nu = (0.4, 0.1, -0.2)
    assert total(forces(d, given, nu, values)) == total(forces(d, kept, nu, values))


@given(st.floats(-16.0, 16.0), st.floats(-16.0, 16.0))
def test_mirrored_propellers_turn_the_ship_the_other_way(port, starboard):
    d = SHIPS["otter"]
    X, Y, N = total(forces(d, (port, starboard), REST, nominal_values(d)))
    mirrored = total(forces(d, (starboard, port), REST, nominal_values(d)))
    assert mirrored == pytest.approx((X, -Y, -N), abs=1e-12)


# Allocation

TWO_AZIMUTHS = described(
    part("port", "azimuth", {**AZIMUTH, "x": -0.9, "y": -0.4}),
    part("starboard", "azimuth", {**AZIMUTH, "x": -0.9, "y": 0.4}),
)
WITH_RUDDER = described(
    part("main", "fixed_propeller", {**PROPELLER, "x": -1.0}),
    part("rudder", "rudder", {"x": -1.1, "area": 0.02}),
    part("bow", "tunnel_thruster", {"x": 0.8, "F": 6.0}),
)
LAYOUTS = {
    "two propellers": (SHIPS["otter"], (0, 2)),
    "two azimuths": (TWO_AZIMUTHS, (0, 1, 2)),
    "propeller, rudder, tunnel": (WITH_RUDDER, (0, 1, 2)),
    "VSP, tunnel": (SHIPS["cse1"], (0, 1, 2)),
    "CyberShip II": (SHIPS["cybership2"], (0, 1, 2)),
    "every law": (EVERY_LAW, (0, 1, 2)),
    "one azimuth": (described(part("pod", "azimuth", {**AZIMUTH, "x": -0.9})), (0, 2)),
    "rudder behind a propeller": (described(*WITH_RUDDER.actuators[:2]), (0, 2)),
    "one propeller, not in the middle": (described(part("a", "fixed_propeller", {"y": 0.3})), (0,)),
    "propeller aside, tunnel amidships": (
        described(part("a", "fixed_propeller", {"y": 0.3}), part("b", "tunnel_thruster", {})),
        (0, 1),
    ),
    "tunnel forward": (described(part("bow", "tunnel_thruster", {"x": 1.0})), (2,)),
    "nothing": (described(), ()),
}
every_layout = pytest.mark.parametrize("layout", LAYOUTS)


@every_layout
def test_a_ship_is_asked_only_for_what_it_can_give(layout):
    d, able = LAYOUTS[layout]
    assert axes(d) == able
    tau = (0.3, 0.2, -0.1)
    others = tuple(x if k in able else 1e3 for k, x in enumerate(tau))
    nu = (0.5, 0.0, 0.0)
    assert allocate(d, others, nu, nominal_values(d)) == allocate(d, tau, nu, nominal_values(d))


@every_layout
@given(st.data())
def test_the_allocation_gives_what_is_asked_where_it_can(layout, data):
    d, able = LAYOUTS[layout]
    nu = (1.0, 0.0, 0.0)
    values = nominal_values(d)
    # A third of what the actuators can give together, which none needs more than all of itself for.
    pulled = []
    for a, own in zip(actuators(d), values, strict=True):
        p = a.law.Parameters._make(own[:-2])
        reach = a.law.reach(Flow(*nu[:2]), p)
        asked = [data.draw(st.floats(-0.3, 0.3)) * min(high, -low) for low, high in reach]
        commands = a.law.commanded(tuple(asked), Flow(*nu[:2]), p)
        pulled += commands
    f = forces(d, pulled, nu, values)
    g = forces(d, allocate(d, total(f), nu, values), nu, values)
    # A rudder also brakes, which it is not asked for.
    braked = sum(abs(f.X[a.unit]) + abs(g.X[a.unit]) for a in actuators(d) if a.part.law == "rudder")
    for k in able:
        assert total(g)[k] == pytest.approx(total(f)[k], rel=1e-5, abs=1e-5 + braked)


@every_layout
@given(st.tuples(*[st.floats(-1e6, 1e6)] * 3), st.tuples(speed, speed, speed))
def test_whatever_is_asked_the_commands_are_finite_and_within_limits(layout, tau, nu):
    d, _ = LAYOUTS[layout]
    values = nominal_values(d)
    given = iter(allocate(d, tau, nu, values))
    for a, own in zip(actuators(d), values, strict=True):
        for low, high in a.law.limits(a.law.Parameters._make(own[:-2])):
            assert low <= next(given) <= high


def test_what_a_limit_cuts_off_is_asked_of_the_others():
    row = described(*[part(f"at_{k}", "given_force", {"y": y}) for k, y in enumerate((-1.0, 0.0, 1.0))])
    first, _, middle, _, last, _ = allocate(row, (1.2, 0.0, 1.4), REST, nominal_values(row))
    assert (first, middle, last) == pytest.approx((1.0, 0.6, -0.4), abs=1e-6)
    tau = total(forces(row, (first, 0.0, middle, 0.0, last, 0.0), REST, nominal_values(row)))
    assert tau == pytest.approx((1.2, 0.0, 1.4), abs=1e-6)


@given(*[st.floats(-1.0, 1.0)] * 3)
def test_vsp_and_tunnel_are_allocated_as_the_thesis_does(a, b, c):
    tau = thrust(a, b, c, Allocation())
    d = SHIPS["cse1"]
    assert allocate(d, tau, REST, nominal_values(d)) == pytest.approx(
        allocate_three(*tau, Allocation()), abs=1e-12
    )


# Failings


def pushing(d, commands, nu=(0.4, 0.1, -0.2)):
    """The actuators at work, and what their force depends on."""
    values = ship(description=d).thrusters.params().plant
    given = tuple(commands)
    part_of_full = tuple(min(1.0, max(-1.0, c / 10.0)) for c in given)
    each = tuple(part_of_full[k] for k in shared(d))
    return forces(d, given, nu, values), Running(5.0, *nu, given, each)


def width_of(d):
    """How many commands a ship has."""
    return len(command_names(d))


def without_memory(d):
    """Each actuator of a ship with each of its failings that has no memory."""
    for a in actuators(d):
        for e in failings(a):
            if e.memory is None:
                yield a, e


def starts(e, **values):
    return [values.get(p.name, p.start) for p in e.parameters]


def commands_for(width, sign=1.0):
    return [sign * (0.3 + 0.1 * k) for k in range(width)]


@every_ship
def test_a_failing_at_zero_changes_nothing_and_never_another_actuator(name):
    d = SHIPS[name]
    f, now = pushing(d, commands_for(width_of(d)))
    for a, e in without_memory(d):
        same = e(f, now, *starts(e))
        assert (same.X, same.Y) == (f.X, f.Y), e.id
        assert total(same) == total(f), e.id
        worse = e(f, now, *starts(e, **{x: 0.7 + 0.2 * k for k, x in enumerate(e.coefficients)}))
        others = [k for k in range(len(f.X)) if k not in a.units]
        for before, after in zip(f[:4], worse[:4], strict=True):
            assert [after[k] for k in others] == [before[k] for k in others], e.id
        assert worse[4:] == f[4:], e.id


@every_ship
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_failing_that_is_called_linear_is_linear(name, sign):
    d = SHIPS[name]
    f, now = pushing(d, commands_for(width_of(d), sign))
    for _, e in without_memory(d):

        def tau(scale, e=e):
            values = {x: scale * (0.2 + 0.1 * (k % 3)) for k, x in enumerate(e.coefficients)}
            return np.array(total(e(f, now, *starts(e, **values))))

        if e.linear:
            none, once, twice = tau(0.0), tau(1.0), tau(2.0)
            assert twice - none == pytest.approx(2.0 * (once - none), abs=1e-9), e.id


@every_ship
def test_a_failing_acts_on_the_axes_that_it_names(name):
    d = SHIPS[name]
    f, now = pushing(d, commands_for(width_of(d)))
    for _, e in without_memory(d):
        change = np.subtract(
            total(e(f, now, *starts(e, **dict.fromkeys(e.coefficients, 0.3)))), total(f)
        )
        assert all(abs(change[k]) < 1e-12 or "XYN"[k] in e.axis for k in range(3)), e.id


@every_ship
def test_all_force_lost_is_no_force(name):
    d = SHIPS[name]
    f, now = pushing(d, commands_for(width_of(d)))
    for a in actuators(d):
        found = {e.id: e for e in failings(a)}
        gone = found[f"loss_{a.part.name}"](f, now, 1.0)
        assert (gone.X[a.unit], gone.Y[a.unit]) == (0.0, 0.0)
        dead = found[f"{a.part.name}_failure"](f, now, 4.0)
        assert (dead.X[a.unit], dead.Y[a.unit]) == (0.0, 0.0)
        assert found[f"{a.part.name}_failure"](f, now, 6.0) == f  # not yet


def test_a_turned_force_keeps_its_size():
    f, now = pushing(SHIPS["cse1"], (0.5, -0.3, 0.2))
    a = actuators(SHIPS["cse1"])[0]
    angle = next(e for e in failings(a) if e.id == "angle_vsp")
    turned = angle(f, now, 0.5 * pi)
    assert (turned.X[0], turned.Y[0]) == pytest.approx((-f.Y[0], f.X[0]))  # ahead becomes starboard


def test_twins_that_are_turned_alike_are_each_turned():
    """Two thrusters abreast with commands of their own may be set up by one mistake."""
    d = SHIPS["otter"]
    f, now = pushing(d, commands_for(width_of(d)))
    effects = effects_of_ship(d)
    together = effects["angle_port_starboard"](f, now, 0.3)
    each = effects["angle_starboard"](effects["angle_port"](f, now, 0.3), now, 0.3)
    assert total(together) == pytest.approx(total(each), rel=1e-12)
    assert together.Y != f.Y


def test_twins_are_at_mirrored_places_and_have_commands_of_their_own():
    d = SHIPS["gunnerus"]
    assert twins(actuators(d)) == []  # they share their commands
    own = d._replace(actuators=tuple([part._replace(order="") for part in d.actuators]))
    assert [(a.part.name, b.part.name) for a, b in twins(actuators(own))] == [
        ("azimuth_port", "azimuth_starboard")
    ]
    both = effects_of_ship(own)["bias_azimuth_port_azimuth_starboard"]
    plant = ship(description=own).thrusters.params().plant
    changed = both(plant, 0.1)
    moved = [
        {
            name.removeprefix(f"plant_{a.part.name}_"): y - x
            for name, x, y in zip(old._fields, old, new, strict=True)
            if x != y
        }
        for a, old, new in zip(actuators(own), plant, changed, strict=True)
    ]
    assert moved == [{"bias": 0.1}, {"bias": 0.1}]
    port, starboard = own.actuators
    values = tuple([v._replace(value=-3.0) if v.name == "y" else v for v in port.values])
    apart = own._replace(actuators=(port._replace(values=values), starboard))
    assert twins(actuators(apart)) == []


def test_another_place_adds_the_moment_of_the_way():
    f, now = pushing(SHIPS["cse1"], (0.5, -0.3, 0.2))
    a = actuators(SHIPS["cse1"])[0]
    place = next(e for e in failings(a) if e.id == "place_vsp")
    X, Y, N = total(f)
    expected = (X, Y, N + 0.03 * f.Y[0] - 0.02 * f.X[0])  # each of two units gives half
    assert total(place(f, now, 0.03, 0.02)) == pytest.approx(expected)


@given(st.floats(0.1, 3.0))
def test_a_lag_is_of_first_order_and_one_actuators_alone(T):
    a = actuators(SHIPS["otter"])[1]
    lag = next(e for e in failings(a) if e.memory)
    memory, n = lag.memory.start(2), 100
    for _ in range(n):
        memory, _ = lag(memory, (3.0, 4.0), T / n, T)
    assert memory == pytest.approx((3.0, 4.0 * (1.0 - np.exp(-1.0))))


def test_effects_of_a_described_ship_are_its_actuators():
    ids = set(ship(description=SHIPS["otter"]).effects)
    assert {"loss_port", "starboard_failure", "lag_port", "X_u", "current", "N_uv"} <= ids
    assert not any("bow" in name or "vsp" in name for name in ids)


@pytest.mark.parametrize("name", SHIPS)
def test_what_a_description_is_not_sure_of_may_be_fitted_but_no_end_of_a_range(name):
    """Of its actuators; what is zero has no share that it could be wrong by."""
    d = SHIPS[name]
    limits = ("n_max", "n_min", "alpha_max", "delta_max", "P_idle", "P_full")
    known = {
        v.name.removeprefix("plant_"): v.known for v in variables(ship(description=d).thrusters.params)
    }
    values = {f"{a.name}_{v.name}": v for a in d.actuators for v in a.values}
    unsure = {name for name, v in values.items() if v.share and v.value and not name.endswith(limits)}
    assert {name for name in known.keys() & values.keys() if known[name]} == unsure & known.keys()
    assert all(known[name].share == values[name].share for name in unsure & known.keys())


# Ships of publications


def sailed(d, tau, seconds, h=0.05):
    """The last state of a ship and of its thrusters, for a request or commands."""
    s = ship(description=d)
    vessel, thrusters = s.vessel, s.thrusters
    p, q = vessel.params(), thrusters.params()
    hull, drive = vessel.prepared(p), thrusters.prepared(q)
    request = type(thrusters.inputs().request)(*tau)
    state, past, out = vessel.init(None, p), thrusters.init(None, q), None
    for _ in range(round(seconds / h)):
        given = thrusters.inputs(request, VelocityInCurrent(state.u, state.v, state.r))
        past, out = thrusters.advance(past, given, drive, h)
        acting = Force(out.tau_act_X, out.tau_act_Y, out.tau_act_N)
        state, _ = vessel.advance(state, acting, hull, h)
    return state, out


def test_the_otter_is_that_of_its_publication():
    p = params("otter")
    assert mass_matrix(p.inertia)[2][2] == pytest.approx(42.65, abs=0.05)
    d = SHIPS["otter"]
    X, Y, N = total(forces(d, (99.0, 99.0), REST, nominal_values(d)))
    assert pytest.approx((24.4 * 9.81, 0.0, 0.0), rel=1e-3) == (X, Y, N)
    astern, _, _ = total(forces(d, (-99.0, -99.0), REST, nominal_values(d)))
    assert astern == pytest.approx(-13.6 * 9.81, rel=1e-3)
    # It leaves out the moment that turns a drifting hull across.
    drift = damping_force(1.5, 0.4, 0.0, p.damping)[2] - coriolis_force(1.5, 0.4, 0.0, p.inertia)[2]
    assert drift == pytest.approx(0.0, abs=1e-9)


def test_the_otter_runs_six_knots_at_full_thrust():
    state, out = sailed(SHIPS["otter"], (1e4, 0.0, 0.0), 30.0)
    assert state.u / 0.514444 == pytest.approx(6.0, abs=0.05)
    assert (state.v, state.r, out.tau_act_N) == pytest.approx(REST, abs=1e-9)


def test_the_otter_turns_at_the_published_time_constant():
    """A small moment: N = 42.651 r + ..., M66 = 42.65, so that the rate settles in about a second."""
    p = params("otter")
    assert mass_matrix(p.inertia)[2][2] / -damping_force(0.0, 0.0, 1e-6, p.damping)[2] * 1e-6 == (
        pytest.approx(1.0, rel=1e-3)
    )


@pytest.mark.parametrize(
    ("name", "tau", "ratio"),
    [
        ("otter", (20.0, 1.0, 4.0), 7.0),
        ("otter", (400.0, 0.0, 60.0), 0.3),
        ("cybership2", (2.0, 0.05, 0.1), 160.0),
    ],
)
def test_a_ship_of_another_size_moves_the_same_in_its_own_units(name, tau, ratio):
    d = SHIPS[name]
    large = scaled(d, ratio)
    at = type(d.scale)(ratio)
    scale = (at.force, at.force, at.moment)
    state, out = sailed(d, tau, 20.0)
    again, acting = sailed(
        large, [x * k for x, k in zip(tau, scale, strict=True)], 20.0 * at.time, 0.05 * at.time
    )
    back = [1 / ratio, 1 / ratio, 1.0, 1 / at.speed, 1 / at.speed, 1 / at.rate]
    assert [x * k for x, k in zip(again[:6], back, strict=True)] == pytest.approx(state[:6], rel=1e-6)
    assert acting.tau_act_N / at.moment == pytest.approx(out.tau_act_N, rel=1e-6)


def test_cybership_2_gives_a_force_on_every_axis():
    d = SHIPS["cybership2"]
    assert ship(description=d).fully_actuated
    _, held = sailed(d, (0.3, 0.05, 0.1), 0.05)
    assert held[-3:] == pytest.approx((0.3, 0.05, 0.1), abs=1e-6)


def test_cybership_2_has_the_lift_of_its_publication_near_amidships():
    a = actuators(SHIPS["cybership2"])[-1]
    p = a.law.Parameters._make(nominal_values(SHIPS["cybership2"])[-1][:-2])
    _, Y = a.law.force((0.01,), Flow(1.0 / (1.0 - p.wake), 0.0), p)
    slope = -Y / 0.01
    assert slope == pytest.approx(6.43306, rel=1e-3)


def test_cybership_2_turns_by_its_rudders():
    by_hand = SHIPS["cybership2"]._replace(allocates=False)
    runs = [sailed(by_hand, (20.0, 20.0, 0.0, delta, delta), 15.0)[0] for delta in (0.2, 0.0, -0.2)]
    starboard, ahead, port = runs
    assert ahead.u > 0.5
    assert (ahead.v, ahead.r) == (0.0, 0.0)
    assert starboard.r > 0.05
    assert starboard.v < 0.0  # the stern swings out
    y_0 = ship(description=by_hand).vessel.params().start.y_0
    assert port[1:6] == pytest.approx(
        (2.0 * y_0 - starboard.y, -starboard.psi, starboard.u, -starboard.v, -starboard.r)
    )


# CyberShip Enterprise 1


def test_the_file_of_cse1_says_what_controllers_have_of_table_2_1():
    mine = {v.name: v for v in variables(ship().vessel.params)}
    for v in (*variables(Inertia), *variables(Damping)):
        assert mine[v.name].start == v.start, v.name
        if v.start != 0.0:
            assert mine[v.name].known == v.known, v.name
    assert SHIPS["cse1"].scale.length == 1.0


def test_no_ship_is_the_default_ship():
    assert ship() is ship(description=SHIPS["cse1"])


@pytest.mark.parametrize(("alpha_max", "way"), [(3.2, 0.4), (3.0, 0.4 - 2.0 * pi)])
def test_an_azimuth_turns_by_the_shorter_way_where_it_can(alpha_max, way):
    """From one side of astern to the other: through astern, or all around where a stop is in between."""
    pod = part("pod", "azimuth", {**AZIMUTH, "x": -0.9, "alpha_max": alpha_max, "alpha_rate": 0.5})
    drive = ship(description=described(pod)).nominal_drive
    first, last, h = pi - 0.2, 0.2 - pi, 0.01
    past, turned = at_rest(drive.effects)._replace(limited=(first, 0.0)), [first]
    for _ in range(round(abs(way) / 0.5 / h) + 2):
        past, (alpha, _) = command_response(past, (last, 0.0), drive, h)
        turned.append(alpha)
    assert turned[2] - turned[1] == pytest.approx(0.5 * h * np.sign(way))
    assert turned[-1] - first == pytest.approx(way)


def test_power_of_a_cycloidal_propeller_is_an_output_where_it_is_described():
    """From idle to full with the force to 3/2, alike in all directions; none is told where none is given."""
    cse1 = SHIPS["cse1"]
    vsp, bow = cse1.actuators
    watts = (Value("P_idle", 0.5, "made up", 0.0), Value("P_full", 4.5, "made up", 0.0))
    described = cse1._replace(actuators=(vsp._replace(values=(*vsp.values, *watts)), bow))
    thrusters = ship(description=described).thrusters
    assert [v.name for v in variables(thrusters.outputs)][-1] == "vsp_power"
    assert "vsp_power" not in [v.name for v in variables(ship(description=cse1).thrusters.outputs)]

    def taken(*tau):
        p = thrusters.params()
        _, out = thrusters.step(thrusters.init(None, p), thrusters.inputs(Force(*tau)), p, 0.01)
        return out.vsp_power

    assert taken(0.0, 0.0, 0.0) == pytest.approx(0.5)
    assert taken(1.165, 0.0, 0.0) == pytest.approx(4.5)
    assert taken(-1.165 / 4.0, 0.0, 0.0) == pytest.approx(0.5 + 4.0 / 8.0)
    aside = taken(0.0, 1.165 / 4.0, -0.4575 * 1.165 / 4.0)  # by the propeller alone
    assert aside == pytest.approx(0.5 + 4.0 / 8.0)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_the_gains_of_the_pid_controller_are_of_the_masses_and_one_frequency(share):
    """K_P = m w^2 on each axis, with w = 0.5 rad/s for CyberShip Enterprise 1, slower for a longer ship."""
    otter = read_ship("otter")
    of = ship(
        description=otter._replace(
            inertia=tuple(v._replace(value=share * v.value) for v in otter.inertia)
        )
    )
    params = of.components["controller_pid"][1].params
    gains = {v.name: v.start for v in variables(params)}
    w = 0.5 / (otter.length / 1.105) ** 0.5
    masses = np.diag(of.mass)
    for k, axis in enumerate(("x", "y", "psi")):
        assert gains[f"K_P_{axis}"] == pytest.approx(masses[k] * w**2)
        assert gains[f"K_D_{axis}"] == pytest.approx(2.0 * masses[k] * w)
        assert gains[f"K_I_{axis}"] == pytest.approx(0.1 * masses[k] * w**3)
