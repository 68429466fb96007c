"""The modified derivative filter: freezes, lost samples, whole turns, other step sizes."""

import math
import random
from itertools import pairwise

import pytest
from support.project import with_values

from fmus.declare import variables
from fmus.observer.mdf import COMPONENT, State
from fmus.observer.screen import Inputs
from fmus.signals import Force, Measurement

H = 0.01


def params(component=COMPONENT, **changes):
    """Parameters of an observer, some changed by name."""
    return with_values(component, **changes)


NAN = math.nan


def run(measurements, p=params(), h=H):
    """Estimates for a sequence of measured poses."""
    first = Inputs(Measurement(*measurements[0]), Force())
    state, estimate = COMPONENT.step(COMPONENT.init(first, p), first, p, 0.0)
    estimates = [estimate]
    for m in measurements[1:]:
        state, estimate = COMPONENT.step(state, Inputs(Measurement(*m), Force()), p, h)
        estimates.append(estimate)
    return estimates


def circle(k, noise=None, h=H, speed=0.08, rate=0.1):
    """Pose on a circle, heading in (-pi, pi], as a measurement system reports it."""
    t = k * h
    psi = rate * t
    pose = [5.0 + speed / rate * math.sin(psi), 2.0 - speed / rate * math.cos(psi), psi]
    if noise:
        pose = [
            pose[0] + noise.gauss(0, 2e-4),
            pose[1] + noise.gauss(0, 2e-4),
            psi + noise.gauss(0, 3e-4),
        ]
    return (*pose[:2], math.remainder(pose[2], math.tau))


def unmodified(measurements, a=0.08, b=0.05, h=H):
    """Surge velocity by the filter before its modification, (4.45), on unwrapped headings."""
    filtered, rates, surges = list(measurements[0]), [0.0, 0.0, 0.0], []
    for m in measurements:
        for k in range(3):
            new = filtered[k] + a * (m[k] - filtered[k])
            rates[k] += b * ((new - filtered[k]) / h - rates[k])
            filtered[k] = new
        surges.append(math.cos(filtered[2]) * rates[0] + math.sin(filtered[2]) * rates[1])
    return surges


def test_velocity_and_acceleration_of_steady_motion():
    last = run([circle(k) for k in range(3000)])[-1]
    assert (last.u_hat, last.r_hat) == pytest.approx((0.08, 0.1), rel=2e-3)
    assert last.v_hat == pytest.approx(0.0, abs=2e-3)
    assert last.frozen == 0.0
    assert abs(last.r_dot_hat) < 1e-6


def test_heading_is_continuous_over_many_turns():
    estimates = run([circle(k, rate=0.5) for k in range(30000)])
    steps = [b.psi_hat - a.psi_hat for a, b in pairwise(estimates)]
    assert max(steps) < 0.01
    assert min(steps) >= 0.0
    # 150 rad, less the lag of the position filter.
    lag = 0.5 * -H / math.log(1 - 0.08)
    assert estimates[-1].psi_hat == pytest.approx(0.5 * 29999 * H - lag, abs=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_unwrapped_heading_is_the_measured_one_plus_whole_turns(sign):
    p = params(a=0.999999, b=0.5)
    for k, e in enumerate(run([circle(k, rate=sign * 2.0) for k in range(5000)], p)):
        assert e.psi_hat == pytest.approx(sign * 2.0 * k * H, abs=1e-4)


@pytest.mark.parametrize("seed", range(5))
def test_spike_after_a_freeze_is_at_most_half_of_the_unmodified_filter(seed):
    rng = random.Random(seed)
    poses = [circle(k, rng, rate=0.01) for k in range(2000)]
    frozen_for = rng.randint(30, 100)
    for k in range(1500, 1500 + frozen_for):
        poses[k] = poses[1499]
    after = slice(1500 + frozen_for, 1600 + frozen_for)
    modified = [e.u_hat for e in run(poses)]
    spike = max(abs(u - 0.08) for u in modified[after])
    before = max(abs(u - 0.08) for u in unmodified(poses)[after])
    assert spike <= 0.5 * before


def test_freeze_is_reported_and_bridged_at_constant_velocity():
    poses = [circle(k, rate=0.01) for k in range(2000)]
    poses[1500:1600] = [poses[1499]] * 100
    estimates = run(poses)
    assert [e.frozen for e in estimates[1499:1601]] == [0.0, *[1.0] * 100, 0.0]
    assert estimates[1599].u_hat == pytest.approx(estimates[1499].u_hat, rel=1e-6)
    travelled = math.dist(estimates[1599][:2], estimates[1499][:2])
    assert travelled == pytest.approx(0.08 * 1.0, rel=0.01)


@pytest.mark.parametrize(
    "lost", [(NAN, NAN, NAN), (0.0, 0.0, 0.0), (5.0, math.inf, 0.1), (NAN, 2.0, 0.0)]
)
def test_lost_samples_are_bridged(lost):
    poses = [circle(k) for k in range(2000)]
    expected = run(poses)[-1]
    poses[1500:1580] = [lost] * 80
    estimates = run(poses)
    assert all(e.frozen == 1.0 for e in estimates[1500:1580])
    assert all(math.isfinite(x) for e in estimates for x in e)
    assert estimates[-1] == pytest.approx(expected, abs=2e-3)


def test_start_without_a_measurement():
    poses = [(NAN, NAN, NAN)] * 50 + [circle(k) for k in range(50, 400)]
    estimates = run(poses)
    assert estimates[49][:3] == (0.0, 0.0, 0.0)
    assert estimates[50][:3] == pytest.approx(circle(50), abs=1e-9)
    assert max(abs(e.u_hat) for e in estimates) < 0.09, "no spike at the first sample"


def test_ship_at_rest_looks_frozen_and_that_is_harmless():
    estimates = run([(5.0, 2.0, 1.0)] * 1000)
    assert estimates[10].frozen == 1.0
    assert all(e[:3] == (5.0, 2.0, 1.0) and e[3:9] == (0.0,) * 6 for e in estimates)


def test_ship_that_comes_to_rest_is_found_where_it_lies():
    moving = [circle(k) for k in range(1000)]
    estimates = run(moving + [moving[-1]] * 2000)
    assert estimates[-1][:3] == pytest.approx(moving[-1], abs=1e-6)
    assert estimates[-1].u_hat == pytest.approx(0.0, abs=1e-6)


def test_ship_that_is_lost_for_good_is_not_carried_away():
    estimates = run([circle(k) for k in range(1000)] + [(NAN, NAN, NAN)] * 20000)
    assert abs(estimates[-1].u_hat) < 1e-6
    assert math.dist(estimates[-1][:2], estimates[999][:2]) < 0.5


def test_slower_measurement_is_not_a_freeze():
    """20 Hz samples held for a 100 Hz observer."""
    p = params(measurement_period=0.05)
    estimates = run([circle(5 * (k // 5)) for k in range(3000)], p)
    assert not any(e.frozen for e in estimates)
    held = run([circle(5 * (k // 5)) for k in range(2995)] + [circle(2994)] * 10, p)
    assert held[-1].frozen == 1.0


def test_another_step_size_gives_the_same_filter():
    fine = run([circle(k) for k in range(4001)])[-1]
    coarse = run([circle(k, h=0.02) for k in range(2001)], params(measurement_period=0.02), 0.02)[-1]
    assert coarse[:6] == pytest.approx(fine[:6], abs=2e-3)


def test_state_is_all_there_is():
    """Two observers in the same state go on identically."""
    poses = [circle(k) for k in range(200)]
    state = State()
    for m in poses[:100]:
        state, _ = COMPONENT.step(state, Inputs(Measurement(*m), Force()), params(), H)
    copy = State._make(state)
    for m in poses[100:]:
        state, a = COMPONENT.step(state, Inputs(Measurement(*m), Force()), params(), H)
        copy, b = COMPONENT.step(copy, Inputs(Measurement(*m), Force()), params(), H)
        assert a == b


def test_weights_of_the_filters_are_shares():
    """A weight of one or more would never let a filter settle."""
    shares = {v.name: v.range for v in variables(COMPONENT.params) if v.name in ("a", "b")}
    assert set(shares) == {"a", "b"}
    for allowed in shares.values():
        assert allowed.min == 0.0
        assert 0.9 < allowed.max < 1.0
