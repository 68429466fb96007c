"""The courses of both libraries of manoeuvres: what their numbers from 0 to 1 mean, by formulas of their own."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.design.manoeuvre_library import (
    DIMENSIONS,
    LIBRARY,
    USUAL_MANOEUVRES,
    PlanStep,
    Reach,
    moved,
    poses,
    sequence,
    there_and_back,
    usual,
    visits,
)
from diagnosis.design.order_library import ORDERS, USUAL_ORDERS, Orders
from fmus.guidance.multisine import FREQUENCIES

REACH = Reach(speed=0.5, rate=0.2, room=8.0, time=1.0, aft=-0.5, fore=0.4)
H = 0.01
MIDDLE = (0.5,) * 5


def course(name, x, seconds, reach=REACH):
    t = np.arange(0.0, seconds + H / 2.0, H)
    return t, LIBRARY[name](t, seconds, x, reach)


def rounds(reach, speed, rise):
    """Duration in which there is time for two rounds, but not for a third [s]."""
    return 2.4 * (4.0 * reach / speed + 2.0 * rise)


def top(values):
    """Largest rate of change."""
    return np.abs(np.gradient(values, H)).max()


@settings(max_examples=25)
@given(st.floats(-5.0, 5.0), st.floats(4.0, 30.0), st.floats(0.1, 1.5))
def test_a_move_goes_its_distance_at_one_speed_between_its_ramps(distance, seconds, rise):
    t = np.linspace(-1.0, seconds + 1.0, 2001)
    s = moved(t, distance, seconds, rise)
    assert s[t <= 0.0] == pytest.approx(0.0)
    assert s[t >= seconds] == pytest.approx(distance)
    steady = (t > rise) & (t < seconds - rise)
    assert np.diff(s[steady]) == pytest.approx(distance / (seconds - rise) * (t[1] - t[0]), abs=1e-9)
    assert s + s[::-1] == pytest.approx(distance), "start and stop are alike"
    assert moved(seconds / 2.0, distance, seconds, 9.0 * seconds) == pytest.approx(distance / 2.0)


@settings(max_examples=25)
@given(st.lists(st.floats(0.1, 3.0), min_size=1, max_size=4), st.floats(0.5, 3.0))
def test_visits_reach_each_place_in_turn_within_their_speed_and_time(places, rise):
    speed, way = 0.4, np.abs(np.diff([0.0, *places, 0.0])).sum()
    T = 1.2 * (way / speed + rise * (len(places) + 1))
    t = np.arange(0.0, T + H, H)
    s = visits(t, places, speed, rise, T)
    assert (s[0], s[-1]) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert top(s) <= speed + 1e-6
    after = 0
    for place in places:
        near = np.flatnonzero(np.abs(s[after:] - place) < 0.01)
        assert near.size
        after += int(near[0])
    half = visits(t, places, speed, rise, T / 4.0)  # too short a time: the same, but smaller
    assert np.abs(half).max() < np.abs(s).max() + 1e-9
    assert top(half) <= speed * 1.01 + 1e-6


def test_as_many_rounds_as_fit_into_the_time():
    assert there_and_back(2.0, 0.5, 2.0, 20.0) == [2.0, -2.0]
    assert there_and_back(2.0, 0.5, 2.0, 60.0) == [2.0, -2.0] * 3  # 4 * 2 / 0.5 + 2 * 2 = 20 s each
    assert there_and_back(2.0, 0.5, 2.0, 1.0) == [2.0, -2.0]


@pytest.mark.parametrize("x", [0.0, 0.5, 1.0])
def test_legs_reach_their_share_of_the_room_at_their_share_of_the_speed(x):
    T = rounds(4.0 * (0.3 + 0.7 * x), 0.5 * (0.25 + 0.75 * x), 2.0)
    _, pose = course("legs", (x, 0.0, x, 0.0, 0.0), T)
    assert np.abs(pose[:, 0]).max() == pytest.approx(4.0 * (0.3 + 0.7 * x), rel=1e-3)
    assert top(pose[:, 0]) <= 0.5 * (0.25 + 0.75 * x) + 1e-6
    assert top(pose[:, 0]) > 0.7 * 0.5 * (0.25 + 0.75 * x)
    assert not pose[:, 1:].any()
    _, crab = course("crab", (x, 0.0, x, 0.5, 0.0), T)
    assert np.hypot(*crab[:, :2].T) == pytest.approx(np.abs(pose[:, 0]))
    moving = np.abs(pose[:, 0]) > 0.1
    assert np.arctan2(crab[moving, 1], crab[moving, 0]) % np.pi == pytest.approx(np.pi * 0.5)
    _, slow = course("legs", (x, 1.0, x, 0.0, 0.0), T)
    ramp = np.abs(np.gradient(np.gradient(pose[:, 0], H), H)).max()
    assert np.abs(np.gradient(np.gradient(slow[:, 0], H), H)).max() < 0.6 * ramp  # 5 s in place of 2


def test_stairs_have_three_speeds_from_slow_to_fast():
    _, pose = course("stairs", (0.5, 0.0, 1.0, 0.0, 0.0), 120.0)
    s = pose[:, 0]
    turns = np.flatnonzero(np.diff(np.sign(np.diff(s[(s != 0.0)]))) != 0)
    assert np.abs(s).max() == pytest.approx(4.0 * 0.7, rel=0.02)
    legs = np.split(np.abs(np.diff(s)) / H, turns + 1)
    fastest = np.array([leg.max() for leg in legs if leg.size > 100])[:4]
    assert fastest / fastest[2] == pytest.approx([0.2, 0.6, 1.0, 0.2], abs=0.06)
    assert fastest[2] <= 0.5 + 1e-6


@pytest.mark.parametrize("side", [0.0, 1.0])
@pytest.mark.parametrize("astern", [0.0, 1.0])
def test_circles_are_ellipses_with_the_heading_along_them(side, astern):
    _, pose = course("circle", (side, astern, 0.4, 0.5, 0.5), 300.0)
    x, y, psi = pose.T
    sign, along = (1.0 if side < 0.5 else -1.0), (1.0 if astern < 0.5 else -1.0)
    a, b = 4.0 * (0.25 + 0.75 * 0.4), 4.0 * (0.25 + 0.75 * 0.4) * 0.75
    assert (x / a) ** 2 + (along * sign * y / b - 1.0) ** 2 == pytest.approx(1.0, abs=0.02)
    assert top(psi) <= 0.2 * 1.1
    assert abs(psi[-1]) % (2.0 * np.pi) == pytest.approx(0.0, abs=1e-6)
    assert np.sign(psi[-1]) == sign
    u = np.gradient(x) * np.cos(psi) + np.gradient(y) * np.sin(psi)
    v = np.gradient(y) * np.cos(psi) - np.gradient(x) * np.sin(psi)
    assert (along * u > -1e-9).all()
    assert np.abs(v).max() < 1e-3 * np.abs(u).max()
    assert np.hypot(np.gradient(x, H), np.gradient(y, H)).max() <= 0.5 * 1.1


@pytest.mark.parametrize("x", [0.0, 0.5, 1.0])
def test_the_quickest_circle_is_as_quick_as_the_reach(x):
    """From 0.3 of its speed to all of it, where no yaw rate limits it."""
    _, pose = course("circle", (0.0, 0.0, 1.0, 1.0, x), 2000.0)
    speed = np.hypot(np.gradient(pose[:, 0], H), np.gradient(pose[:, 1], H))
    assert np.median(speed) == pytest.approx(0.5 * (0.3 + 0.7 * x), rel=0.05)


@pytest.mark.parametrize("x", [0.0, 0.3, 1.0])
def test_a_rotation_keeps_its_point_where_it_is(x):
    T = rounds(np.pi * (0.3 + 0.7 * x), 0.125, 3.5)
    _, pose = course("rotation", (0.5, 0.5, x, x, 0.0), T)
    pivot, psi = -0.5 + 0.9 * x, pose[:, 2]
    assert pose[:, 0] + pivot * np.cos(psi) == pytest.approx(pivot)
    assert pose[:, 1] + pivot * np.sin(psi) == pytest.approx(0.0, abs=1e-9)
    assert np.abs(psi).max() == pytest.approx(np.pi * (0.3 + 0.7 * x), rel=1e-3)
    assert psi.min() == pytest.approx(-psi.max(), rel=1e-3)
    assert top(psi) <= 0.2 * 0.625 + 1e-6


@pytest.mark.parametrize(("x", "count"), [(0.0, 2), (0.5, 3), (1.0, 4)])
def test_station_is_kept_at_headings_that_share_a_turn(x, count):
    _, pose = course("headings", (x, 0.5, 0.0, 0.0, 0.0), 200.0)
    assert not pose[:, :2].any()
    psi = pose[:, 2]
    held = np.unique(psi[np.abs(np.gradient(psi)) < 1e-9].round(6))
    assert held == pytest.approx(2.0 * np.pi / count * np.arange(count + 1), abs=1e-4)
    assert top(psi) <= 0.2 * 0.65 + 1e-6


def test_a_zigzag_swings_by_its_angle_and_period_and_comes_back():
    _, pose = course("zigzag", (0.5, 0.5, 0.5, 0.5, 0.5), 200.0)
    psi = pose[:, 2]
    period, angle = 20.0, min(np.radians(25.0), 0.2 * 20.0 / (2.0 * np.pi))
    assert psi.max() == pytest.approx(angle, rel=0.01)
    middle = np.arange(psi.size) * H
    away = (middle > 20.0) & (middle < 180.0)
    assert psi[away] == pytest.approx(angle * np.sin(2.0 * np.pi * middle[away] / period), abs=1e-6)
    assert pose[-1, 1] == pytest.approx(0.0, abs=1e-9)
    assert pose[:, 0] == pytest.approx(course("legs", (0.5, 0.5, 0.5, 0.0, 0.0), 200.0)[1][:, 0])


def test_a_multisine_has_its_frequencies_and_shares():
    t, pose = course("multisine", (0.5, 0.2, 0.4, 0.6, 0.5), 100.0)
    inner = (t > 15.0) & (t < 85.0)
    omega = 1.4 * np.array(FREQUENCIES)
    for k, limit in enumerate((0.5 * 0.2, 0.5 * 0.4, 0.2 * 0.6)):
        waves = [w / 1.5 * limit / o * np.sin(o * t) for w, o in zip((1.0, 0.5), omega[k], strict=True)]
        assert pose[inner, k] == pytest.approx(sum(waves)[inner], abs=1e-6)
    assert pose[[0, -1]] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("x", "order"), [(0.0, [0, 1, 2]), (0.5, [2, 0, 1]), (1.0, [1, 2, 0])])
def test_steps_move_one_axis_after_the_other(x, order):
    t, pose = course("steps", (0.5, 0.5, x, 0.0, 0.0), 264.0)
    size = (
        np.array([0.5, 0.35, 0.2]) * 0.65 * 2.0 * 2.0
    )  # a speed, its share, 2 s of a ramp, twice as far
    for axis in range(3):
        moving = np.abs(np.gradient(pose[:, axis])) > 1e-9
        third = t[moving] / 88.0
        assert third.min() > order[axis] - 0.02
        assert third.max() < order[axis] + 1.02
        assert pose[:, axis].max() == pytest.approx(size[axis], rel=0.02)


@settings(max_examples=20)
@given(st.lists(st.floats(0.0, 0.999), min_size=3 * DIMENSIONS, max_size=3 * DIMENSIONS))
def test_a_point_of_the_cube_is_a_plan(point):
    plan = sequence(np.array(point), 300.0)
    rows = np.reshape(point, (3, DIMENSIONS))
    names = list(LIBRARY)
    assert [s.name for s in plan] == [names[int(r[0] * len(names))] for r in rows]
    assert [s.numbers for s in plan] == [tuple(r[2:]) for r in rows]
    assert [s.seconds for s in plan] == [100.0] * 3
    heading = 2.0 * np.pi * rows[0, 1]
    assert plan[0].heading == pytest.approx(heading)
    for s, r in zip(plan[1:], rows[1:], strict=True):
        heading += 0.0 if r[1] < 0.5 else 2.0 * np.pi * (r[1] - 0.75)
        assert s.heading == pytest.approx(heading)


def test_a_plan_is_its_manoeuvres_in_their_headings_with_turns_between():
    parts = [PlanStep("legs", MIDDLE, 100.0, 0.5), PlanStep("legs", MIDDLE, 100.0, 1.5)]
    whole = poses(parts, 200.0, 0.1, REACH)
    assert whole.shape == (2001, 3)
    turn = 1.0 / (0.7 * 0.2) + 5.0
    T = (200.0 - turn) / 2.0
    t = np.arange(0.0, T, 0.1)
    own = LIBRARY["legs"](t, T, MIDDLE, REACH)
    assert whole[: t.size, 0] == pytest.approx(own[:, 0] * np.cos(0.5))
    assert whole[: t.size, 1] == pytest.approx(own[:, 0] * np.sin(0.5))
    assert whole[: t.size, 2] == pytest.approx(0.5)
    assert whole[-t.size :, 2] == pytest.approx(1.5)
    assert np.abs(np.diff(whole[:, 2])).max() <= 0.1 * 0.7 * 0.2 * 1.01
    straight = poses([p._replace(heading=0.5) for p in parts], 200.0, 0.1, REACH)
    assert straight[:, 2] == pytest.approx(0.5), "without another heading there is no turn"
    for name, runs in USUAL_MANOEUVRES.items():
        plan = usual(name, 90.0)
        assert [(s.name, s.numbers) for s in plan] == list(runs)
        assert sum(s.seconds for s in plan) == 90.0
        assert {s.heading for s in plan} == {0.0}


def asked(name, x, T=90.0, scale=1.0):
    t = np.arange(0.0, T, 0.1)
    return t, ORDERS[name](t, T, x, scale)


def test_orders_are_shares_of_thrust_and_rudder():
    level = 0.3 + 0.7 * 0.5
    t, got = asked("straight", (0.0, 0.5, 1.0, 0.0, 0.0))
    expected = np.where(t < 30.0, 0.3, np.where(t < 60.0, level, 1.0))
    assert got == pytest.approx(np.column_stack([expected, 0.0 * t]))
    for x, side in ((0.0, 1.0), (1.0, -1.0)):
        t, got = asked("turn", (0.5, x, 1.0, 0.0, 0.0))
        assert got == pytest.approx(np.column_stack([level + 0.0 * t, side + 0.0 * t]))
        t, got = asked("spiral", (0.5, 1.0, x, 0.0, 0.0))
        stairs = side * np.array([1.0, 0.5, 0.0, -0.5, -1.0])[np.minimum(t // 18.0, 4).astype(int)]
        assert got == pytest.approx(np.column_stack([level + 0.0 * t, stairs]))
        t, got = asked("stop", (x, 0.5, 1.0, 0.0, 0.0))
        ahead = t < 90.0 * (0.7 if x else 0.4)
        assert got == pytest.approx(np.column_stack([np.where(ahead, level, -1.0), 0.0 * t]))


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_rudder_changes_sides_after_half_a_period_at_first_after_half_of_that(scale):
    t, got = asked("swing", (0.5, 1.0, 0.2, 0.0, 0.0), scale=scale)
    half = scale * (5.0 + 25.0 * 0.2)
    changes = t[1:][np.diff(got[:, 1]) != 0.0]
    assert changes == pytest.approx(np.arange(half / 2.0, 90.0, half), abs=0.11)
    assert got[0] == pytest.approx([0.65, 1.0])
    t, got = asked("order steps", (1.0, 0.0, 0.2, 0.4, 0.5), scale=scale)
    thrust = t[1:][np.diff(got[:, 0]) != 0.0]
    assert thrust == pytest.approx(np.arange(half, 90.0, half), abs=0.11)
    other = scale * (5.0 + 25.0 * 0.4)
    changes = t[1:][np.diff(got[:, 1]) != 0.0]
    assert changes == pytest.approx(np.arange(other / 2.0, 90.0, other), abs=0.11)
    assert sorted(set(got[:, 0].tolist())) == pytest.approx([0.15, 1.0])
    assert set(np.abs(got[:, 1]).tolist()) == {0.3}


def test_an_order_is_of_the_largest_thrust_ahead_or_astern_and_of_full_rudder():
    orders = Orders(("n", "delta"), np.array([-4.0, 0.0]), np.array([10.0, 0.0]), np.array([0.0, 0.6]))
    plan = [
        PlanStep("stop", (0.0, 1.0, 1.0, 0.0, 0.0), 10.0, 0.0),
        PlanStep("turn", (1.0, 0.0, 1.0, 0.0, 0.0), 10.0, 0.0),
    ]

    class Sized:
        class ship:  # noqa: N801
            class scale:  # noqa: N801
                time = 1.0

    t = np.arange(0.0, 20.0, 0.5)
    found = orders._asked(plan, t, 0.5, Sized)
    assert found[:, 0] == pytest.approx(np.where((t >= 4.0) & (t < 10.0), -2.0, 5.0))
    assert found[:, 1] == pytest.approx(np.where(t < 10.0, 0.0, 0.3))
    assert {m for parts in USUAL_ORDERS.values() for m, _ in parts} <= set(ORDERS)
