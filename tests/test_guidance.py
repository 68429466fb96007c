"""Guidance: the derivatives are those of the path, and the paths are those of the thesis."""

import math
import random

import numpy as np
import pytest
from support.ccode import stepped
from support.project import COMPONENTS, with_values

from fmus.declare import flatten, packer, variables
from fmus.guidance.pace import PathTiming, PulseClock, tick
from fmus.signals import Target

# Paths that follow nothing but time.
GUIDANCE = [n for n, c in COMPONENTS.items() if c.outputs is Target and not variables(c.inputs)]


def follow(name, seconds, h=0.01, **parameters):
    """Rows of the target along a path, at steps of h [s], or of several in turn."""
    c = COMPONENTS[name]
    path = stepped(c, with_values(c, **parameters), c.inputs())
    steps = np.atleast_1d(h).tolist() * round(seconds / np.sum(h))
    return np.array([path.advance([], each) for each in (0.0, *steps)])


# What makes a path show all that it has.
LIVELY = {
    "guidance_setpoint": {"psi_s": 2.5},
    "guidance_ellipse": {"a_x": 1.5, "a_y": 0.6, "pulse": 1.0},
    "guidance_eight": {"a_x": 1.5, "a_y": 0.6, "pulse": 0.7, "pulse_rise": 100.0},
    "guidance_zigzag_path": {"length": 1.0, "psi_c": 2.0, "pulse": 0.5},
    "guidance_waypoints": {
        "x_2": 6.0, "loop": 0.0, "psi_given": 1.0, "psi_2": 1.0, "psi_3": 3.0, "psi_4": -3.0,
        "u_given": 1.0, "u_1": 0.08, "u_2": 0.05, "u_3": 0.07, "pulse": 0.3,
    },
}  # fmt: skip
PACED = ["guidance_ellipse", "guidance_eight", "guidance_zigzag_path", "guidance_waypoints"]


@pytest.mark.parametrize("parameters", [{}, LIVELY], ids=["plain", "lively"])
@pytest.mark.parametrize("name", GUIDANCE)
def test_derivatives_are_those_of_the_target(name, parameters):
    """Central differences, at times that are 11 ms apart."""
    h, between = 0.001, 0.009
    rows = follow(name, 60.0, (h, h, between), **parameters.get(name, {}))
    before, at, after = (rows[k : len(rows) - 2 + k : 3][100:-1] for k in range(3))
    turn = np.unwrap(np.stack([before, at, after])[:, :, 2], axis=0)
    before, after = before.copy(), after.copy()
    before[:, 2], after[:, 2] = turn[0], turn[2]
    for value, rate in ((slice(0, 3), slice(3, 6)), (slice(3, 6), slice(6, 9))):
        differenced = (after[:, value] - before[:, value]) / (2.0 * h)
        assert np.allclose(differenced, at[:, rate], atol=2e-5)


@pytest.mark.parametrize("name", PACED)
def test_heading_is_along_the_path(name):
    rows = follow(name, 60.0)[1:]
    course = np.arctan2(rows[:, 4], rows[:, 3])
    assert np.allclose(np.cos(course - rows[:, 2]), 1.0, atol=1e-12)


def test_ellipse_starts_and_runs_as_in_the_thesis():
    rows = follow("guidance_ellipse", 99.2)
    assert rows[0, :3] == pytest.approx([5.0, 2.0, 0.0])
    assert np.hypot(rows[:, 3], rows[:, 4]) == pytest.approx(0.08)
    # The errata: the perimeter is 7.93 m, so a round takes 99 s.
    assert np.hypot(*np.diff(rows[:, :2], axis=0).T).sum() == pytest.approx(7.93, abs=0.01)
    assert rows[-1, :2] == pytest.approx([5.0, 2.0], abs=0.02)


def test_eight_starts_and_runs_as_in_the_errata():
    rows = follow("guidance_eight", 422.2, 0.1)
    assert rows[0, :3] == pytest.approx([6.0, 0.5, -math.pi / 2])
    assert rows[-1, :2] == pytest.approx([6.0, 0.5], abs=0.01)
    speed = np.hypot(rows[:, 3], rows[:, 4])
    assert (speed.min(), speed.max()) == pytest.approx((0.01, 0.033), abs=0.005)
    assert speed.mean() == pytest.approx(0.14 * 0.16, rel=0.05)


@pytest.mark.parametrize("pulse", [0.0, 0.5])
@pytest.mark.parametrize("name", PACED)
def test_fault_of_the_experiment_runs_four_times_too_fast(name, pulse):
    """The target moves at four times the speed that its own derivative states."""
    rows = follow(name, 12.0, calls=4.0, pulse=pulse)[200:]
    moved = np.hypot(*np.diff(rows[:, :2], axis=0).T) / 0.01
    stated = np.hypot(rows[:, 3], rows[:, 4])
    assert moved == pytest.approx(4.0 * 0.5 * (stated[1:] + stated[:-1]), rel=1e-3, abs=1e-6)


@pytest.mark.parametrize("name", PACED)
def test_without_pulses_their_period_does_not_matter(name):
    other = follow(name, 40.0, pulse_period=3.0, pulse_width=0.2, pulse_rise=0.1)
    assert (other == follow(name, 40.0)).all()


def test_pulsing_target_stands_still_and_goes_on_at_full_speed():
    rows = follow("guidance_ellipse", 30.0, pulse=1.0)
    t = 0.01 * np.arange(len(rows)) % 15.0
    speed = np.hypot(rows[:, 3], rows[:, 4])
    assert speed[(t > 2.0) & (t < 10.5)] == pytest.approx(0.08)
    still = (t > 12.5 + 1e-6) & (t < 15.0 - 1e-6)
    assert (rows[still, 3:] == 0.0).all()
    assert np.ptp(rows[still & (np.arange(len(rows)) < 1500), 0]) < 1e-12
    assert speed.min() == 0.0


@pytest.mark.parametrize("width", [0.07, 0.5, 0.9])
@pytest.mark.parametrize("asked", [1e-3, 0.2, 100.0])
def test_a_change_of_speed_takes_its_time_but_no_longer_than_the_shorter_part(asked, width):
    p = PathTiming(pulse=0.75, pulse_period=4.0, pulse_width=width, pulse_rise=asked)
    rise = min(asked, 4.0 * width, 4.0 * (1.0 - width))

    def speed(t):
        return tick(PulseClock(), p, t)[1].factor

    for begins, slow, quick in ((8.0, 0.25, 1.0), (8.0 + 4.0 * width, 1.0, 0.25)):
        seen = [speed(begins + share * rise) for share in (1e-6, 0.5, 1.0 - 1e-6)]
        assert seen == pytest.approx([slow, 0.625, quick], abs=1e-6)


@pytest.mark.parametrize("h", [0.01, 0.7, 15.0])
@pytest.mark.parametrize(("pulse", "width"), [(1.0, 0.7), (0.4, 0.25)])
def test_mean_speed_of_pulses_is_exact_whatever_the_step(pulse, width, h):
    rows = follow("guidance_eight", 105.0, h, pulse=pulse, pulse_width=width)
    passed = 105.0 * (1.0 - pulse * (1.0 - width))
    assert rows[-1, :3] == pytest.approx(follow("guidance_eight", passed, passed)[-1, :3], abs=1e-9)


def test_zigzag_goes_along_its_course_and_returns_astern():
    rows = follow("guidance_zigzag_path", 137.5)
    x, y, psi = rows[:, :3].T
    assert rows[0, :6] == pytest.approx([3.0, 0.5, 0.35, 0.0, 0.0, 0.0])
    assert (x.min(), x.max()) == pytest.approx((3.0, 7.0), abs=1e-6)
    assert (psi.min(), psi.max()) == pytest.approx((-0.35, 0.35), abs=1e-9)
    assert y.max() - 0.5 == pytest.approx(0.5 - y.min(), abs=1e-6)
    assert 0.05 < np.ptp(y) < 1.0
    # Four legs of a metre on the way: the heading changes sides four times, and as often on the way back.
    assert (np.diff(np.sign(psi[np.abs(psi) > 0.01])) != 0).sum() == 8
    ahead = np.cos(psi) * rows[:, 3] + np.sin(psi) * rows[:, 4]
    assert (ahead[50:6800] > 0.0).all()
    assert (ahead[7000:13700] < 0.0).all()
    speed = np.abs(rows[:, 3])
    assert speed[(x > 3.4) & (x < 6.6)] == pytest.approx(0.06)
    assert rows[-1, :6] == pytest.approx(rows[0, :6], abs=1e-6)


def test_zigzag_lies_where_it_is_wanted():
    """Another course turns the path about its start."""
    north = follow("guidance_zigzag_path", 50.0, x_0=0.0, y_0=0.0)
    turned = follow("guidance_zigzag_path", 50.0, x_0=2.0, y_0=-1.0, psi_c=1.1)
    c, s = math.cos(1.1), math.sin(1.1)
    for k in (0, 3, 6):
        offset = ([2.0, -1.0], [0.0, 0.0], [0.0, 0.0])[k // 3]
        expected = north[:, k : k + 2] @ np.array([[c, s], [-s, c]]) + offset
        assert np.allclose(turned[:, k : k + 2], expected, atol=1e-12)
    assert np.allclose(turned[:, 2], north[:, 2] + 1.1, atol=1e-12)


def route(points, seconds, h=0.01, **parameters):
    """Rows along a route, given as (x, y), (x, y, psi), ... or with names of further columns."""
    for k, point in enumerate(points, 1):
        parameters |= {f"x_{k}": float(point[0]), f"y_{k}": float(point[1])}
    return follow("guidance_waypoints", seconds, h, count=float(len(points)), **parameters)


SQUARE = [(0, 0), (4, 0), (4, 3), (0, 3)]


def test_route_follows_its_legs_and_cuts_its_corners():
    rows = route(SQUARE, 120.0, 0.05, loop=0.0, u_t=0.1, corner=0.5)
    x, y = rows[:, :2].T
    on_a_leg = (
        ((np.abs(y) < 1e-9) & (x < 3.5 + 1e-9))
        | ((np.abs(x - 4.0) < 1e-7) & (y > 0.5 - 1e-9) & (y < 2.5 + 1e-9))
        | ((np.abs(y - 3.0) < 1e-7) & (x < 3.5 + 1e-9))
    )
    in_a_corner = np.hypot(x - 4.0, np.minimum(y, 3.0 - y)) < 0.5 + 1e-6
    assert (on_a_leg | in_a_corner).all()
    # The bend leaves out less than the chord would, and stays inside of the corner.
    assert 0.05 < np.hypot(x - 4.0, y).min() < 0.5 / math.sqrt(2.0)
    assert x.max() < 4.0 + 1e-7


def test_route_keeps_its_speed_and_ends_at_rest():
    rows = route(SQUARE, 130.0, loop=0.0, u_t=0.1, run_up=0.2)
    speed = np.hypot(rows[:, 3], rows[:, 4])
    assert rows[0, :6] == pytest.approx(np.zeros(6))
    assert speed[200:9500] == pytest.approx(0.1)
    moved = np.diff(rows[:, :2], axis=0) / 0.01
    assert np.allclose(moved, 0.5 * (rows[1:, 3:5] + rows[:-1, 3:5]), atol=1e-5), "down to the end"
    assert rows[-1] == pytest.approx([0.0, 3.0, math.pi, *np.zeros(6)], abs=1e-6)


def test_loop_closes():
    rows = route(SQUARE, 400.0, 0.02, u_t=0.1, corner=0.5)
    assert rows[0, :2] == pytest.approx([0.5, 0.0])
    later = rows[5000:]
    again = np.hypot(*(later[:, :2] - rows[2500, :2]).T)
    assert again.min() < 0.002
    assert np.abs(np.diff(np.unwrap(rows[:, 2]))).max() < 0.02 * rows[:, 5].max() * 1.01
    assert np.hypot(*np.diff(rows[:, :2], axis=0).T).max() == pytest.approx(0.002, rel=1e-4)
    assert np.ptp(np.unwrap(rows[:, 2])) > 4.0 * math.pi


def test_route_takes_speeds_and_headings_of_its_points():
    given = {"u_given": 1.0, "u_1": 0.1, "u_2": 0.05, "u_3": 0.2, "psi_given": 1.0, "psi_2": 1.0}
    rows = route(SQUARE, 200.0, 0.05, loop=0.0, corner=0.5, psi_3=-2.5, psi_4=-2.0, **given)
    x, y, psi = rows[:, :3].T
    speed = np.hypot(rows[:, 3], rows[:, 4])
    legs = (
        (x > 0.5) & (x < 3.49) & (y < 1.0),
        (y > 0.51) & (y < 2.49),
        (x > 0.51) & (x < 3.49) & (y > 2.0),
    )
    for leg, u, heading in zip(legs, (0.1, 0.05, 0.2), (0.0, 1.0, -2.5), strict=True):
        assert speed[leg] == pytest.approx(u)
        assert psi[leg] == pytest.approx(heading)
    assert psi[-1] == pytest.approx(-2.0)
    assert (speed < 0.2 + 1e-9).all()
    # From 1 to -2.5 rad the shorter way crosses pi.
    assert np.unwrap(psi)[-1] == pytest.approx(2.0 * math.pi - 2.0)


@pytest.mark.parametrize("loop", [0.0, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_any_route_is_gone_without_a_jump(seed, loop):
    """Random points, some of them twice and some straight back on the leg before."""
    rng = np.random.default_rng(seed)
    points = rng.integers(-2, 3, (rng.integers(2, 21), 2)).tolist()
    rows = route(points, 300.0, 0.05, u_t=0.3, loop=loop)
    assert np.isfinite(rows).all()
    moved = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    assert moved.max() <= 0.3 * 0.05 * (1.0 + 1e-3) + 1e-6
    assert np.hypot(rows[:, 3], rows[:, 4]).max() <= 0.3 * (1.0 + 1e-9)
    assert np.abs(rows[:, :2]).max() <= 2.0 + 1e-5


@pytest.mark.parametrize("name", PACED)
def test_path_hardly_depends_on_the_step(name):
    fine, coarse = (follow(name, 60.0, h, pulse=0.6) for h in (0.01, 0.5))
    assert np.allclose(fine[::50, :2], coarse[:, :2], atol=2e-4 if name == "guidance_ellipse" else 1e-9)


def test_set_point_is_reached_smoothly_and_whatever_the_step():
    p = {"x_s": 7.0, "y_s": -1.0, "psi_s": 3.0, "psi_0": -3.0}
    fine, coarse = (
        follow("guidance_setpoint", 60.0, 0.01, **p),
        follow("guidance_setpoint", 60.0, 1.0, **p),
    )
    assert np.allclose(fine[::100], coarse, atol=1e-9)
    assert fine[-1, :3] == pytest.approx([7.0, -1.0, 3.0], abs=2e-3)
    assert (np.diff(fine[:, 0]) >= 0.0).all(), "no overshoot"
    # From -3 rad to 3 rad the shorter way crosses pi.
    assert np.ptp(np.unwrap(fine[:, 2])) == pytest.approx(2.0 * math.pi - 6.0, abs=2e-3)


def test_set_point_may_change_during_a_run():
    c = COMPONENTS["guidance_setpoint"]
    p = c.params(x_s=6.0)
    s = c.init(c.inputs(), p)
    for k in range(20000):
        if k == 10000:
            p = p._replace(x_s=4.0)
        s, target = c.step(s, c.inputs(), p, 0.01)
        if k == 9999:
            assert target.x_t == pytest.approx(6.0, abs=1e-3)
    assert target.x_t == pytest.approx(4.0, abs=1e-3)


def test_multisine_starts_from_rest_and_excites_everything():
    rows = follow("guidance_multisine", 240.0, 0.1)
    assert rows[0, :6] == pytest.approx([5.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    c, s = np.cos(rows[:, 2]), np.sin(rows[:, 2])
    u, v, r = c * rows[:, 3] + s * rows[:, 4], c * rows[:, 4] - s * rows[:, 3], rows[:, 5]
    assert 0.05 < np.hypot(u, v).max() < 0.25
    # Ahead, astern and sideways; the velocities hardly go together.
    assert u.min() < -0.03 < 0.03 < u.max()
    assert v.min() < -0.03 < 0.03 < v.max()
    assert np.abs(np.corrcoef([u, v, r]) - np.eye(3)).max() < 0.5


@pytest.mark.parametrize("name", GUIDANCE)
def test_outputs_are_finite_for_all_parameters_in_their_ranges(name):
    c = COMPONENTS[name]
    rng = random.Random(name)
    for _ in range(100):
        values = []
        for v in variables(c.params):
            low = -1e3 if v.range.min is None else v.range.min
            high = 1e3 if v.range.max is None else v.range.max
            values.append(rng.choice([low, high, v.start, v.start, rng.uniform(low, high)]))
        p = packer(c.params)(values)
        s = c.init(c.inputs(), p)
        for h in (0.0, 0.01, 1.0, 100.0, 0.001, 0.01):
            s, target = c.step(s, c.inputs(), p, h)
            assert all(map(math.isfinite, flatten(target) + flatten(s)))


def test_routes_may_be_laid_out_many_at_once():
    c = COMPONENTS["guidance_waypoints"]
    names = [v.name for v in variables(c.params)]
    rng = np.random.default_rng(3)
    changes = {n: rng.uniform(-3.0, 3.0, 5) for n in ("x_1", "y_2", "x_4", "y_5")}
    changes |= {
        "count": np.array([2.0, 3.0, 4.0, 5.0, 20.0]),
        "loop": np.array([0.0, 1.0, 0.0, 1.0, 1.0]),
    }

    def last(pick):
        values = [
            pick(changes[n]) if n in changes else x
            for n, x in zip(names, flatten(c.params()), strict=True)
        ]
        p = packer(c.params)(values)
        s = c.init(c.inputs(), p)
        for _ in range(40):
            s, target = c.step(s, c.inputs(), p, 1.0)
        return flatten(target)

    together = last(lambda column: column)
    for k in range(5):
        alone = last(lambda column, k=k: float(column[k]))
        assert [float(np.broadcast_to(x, 5)[k]) for x in together] == pytest.approx(alone, abs=1e-12)
