"""Guidance: the derivatives are those of the path, and the paths are those of the thesis."""

import math

import numpy as np
import pytest
from conftest import COMPONENTS

from fmus.declare import flatten, packer, variables

GUIDANCE = [name for name in COMPONENTS if name.startswith("guidance_")]


def follow(name, seconds, h=0.01, **parameters):
    """Rows of (time, target) along a path."""
    c = COMPONENTS[name]
    names = [v.name for v in variables(c.params)]
    p = packer(c.params)(
        [parameters.pop(n, start) for n, start in zip(names, flatten(c.params()), strict=True)]
    )
    assert not parameters
    s = c.init(c.inputs(), p)
    rows = [c.step(s, c.inputs(), p, 0.0)[1]]
    for _ in range(round(seconds / h)):
        s, target = c.step(s, c.inputs(), p, h)
        rows.append(target)
    return np.array(rows)


@pytest.mark.parametrize("name", GUIDANCE)
def test_derivatives_are_those_of_the_target(name):
    extra = {"psi_s": 2.5} if name == "guidance_setpoint" else {}
    h = 0.005
    rows = follow(name, 60.0, h, **extra)
    pose, rate, acceleration = rows[:, 0:3], rows[:, 3:6], rows[:, 6:9]
    pose = np.unwrap(pose, axis=0)
    middle = slice(200, -2)  # a set point starts with a jump in its third derivative
    differenced = (pose[2:] - pose[:-2]) / (2.0 * h)
    assert np.allclose(differenced[middle], rate[1:-1][middle], atol=2e-5)
    differenced = (rate[2:] - rate[:-2]) / (2.0 * h)
    assert np.allclose(differenced[middle], acceleration[1:-1][middle], atol=2e-5)


@pytest.mark.parametrize("name", ["guidance_ellipse", "guidance_eight"])
def test_heading_is_along_the_path(name):
    rows = follow(name, 80.0)
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


@pytest.mark.parametrize("name", ["guidance_ellipse", "guidance_eight"])
def test_fault_of_the_experiment_runs_four_times_too_fast(name):
    """The target moves at four times the speed that its own derivative states."""
    rows = follow(name, 10.0, calls=4.0)
    moved = np.hypot(*np.diff(rows[:, :2], axis=0).T) / 0.01
    stated = np.hypot(rows[1:, 3], rows[1:, 4])
    assert moved / stated == pytest.approx(4.0, rel=1e-3)


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
