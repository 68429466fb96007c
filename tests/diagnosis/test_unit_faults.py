"""Channels in another unit or with another sign: by windows of a run whose motion is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis import Run
from diagnosis.runs.cleaning import Z95
from diagnosis.runs.columns.columns import POSE
from diagnosis.runs.columns.unit_check import UNITS
from diagnosis.runs.run_constants import HORIZON, IN_A_ROW
from diagnosis.runs.sensors.evidence import ALIKE, SURE, evidence
from diagnosis.runs.sensors.unit_faults import (
    NEAR,
    OPPOSITE,
    SIGN,
    _alike,
    _nearest,
    _windows,
    mirrored,
    sway,
    units,
)
from fmus.scale import REFERENCE

H = 0.2
T = np.arange(0.0, 400.0, H)


def sailed(seconds=400.0, noise=1e-4, v_size=0.1, place=0.0):
    """A ship that winds, measured with a little noise; ``place`` [m] ahead of the place of its velocity."""
    t = T[seconds > T]
    u, v = 0.6 + 0.1 * np.sin(0.11 * t), v_size * np.sin(0.17 * t)
    psi = 0.8 * np.sin(0.07 * t) + 0.02 * t
    r = 0.056 * np.cos(0.07 * t) + 0.02
    rate = np.column_stack([u * np.cos(psi) - v * np.sin(psi), u * np.sin(psi) + v * np.cos(psi)])
    steps = 0.5 * H * (rate[1:] + rate[:-1])
    xy = np.cumsum(np.vstack([[5.0, -3.0], steps]), axis=0)
    xy += place * np.column_stack([np.cos(psi), np.sin(psi)])
    rng = np.random.default_rng(0)
    pose = np.column_stack([xy, psi]) + noise * rng.standard_normal((t.size, 3))
    return Run("made", t, pose, np.zeros((t.size, 3)), measured={"u": u, "v": v, "r": r})


def times(run, **factors):
    return replace(
        run, measured=dict(run.measured) | {n: run.measured[n] * f for n, f in factors.items()}
    )


@given(st.integers(0, 100), st.floats(-3.0, 3.0).filter(lambda x: abs(x) > 0.1))
def test_the_correlation_of_windows_is_the_cosine_of_their_angle(seed, factor):
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2, 10, 2))
    cosine = a.ravel() @ b.ravel() / np.linalg.norm(a) / np.linalg.norm(b)
    assert _alike(a, factor * b) == pytest.approx(np.sign(factor) * cosine)
    assert _alike(a, factor * a) == pytest.approx(np.sign(factor))
    assert _alike(a, 0.0 * a) == 0.0


@pytest.mark.parametrize(("step", "apart"), [(0.05, 160), (0.2, 40), (3.0, 10)])
def test_windows_last_a_prediction_or_ten_samples(step, apart):
    run = sailed(noise=0.0)
    e = replace(evidence(run), run=replace(run, time=step * np.arange(run.time.size)))
    assert apart == max(round(HORIZON / step), 10)
    path = np.arange(run.time.size)[:, None] ** 2.0
    (found,) = _windows(e, path)
    assert found.tolist() == np.diff(path[::apart], axis=0).tolist()
    every_other = replace(e, rows=np.arange(0, run.time.size, 2), run=replace(run, time=0.5 * e.time))
    (found,) = _windows(every_other, path)
    assert found.tolist() == np.diff(path[:: 2 * apart], axis=0).tolist()


@pytest.mark.parametrize(
    ("value", "quantity", "name", "factor"),
    [
        (1.0 / UNITS["speed"]["kn"], "speed", "kn in place of m/s", 1.0 / UNITS["speed"]["kn"]),
        (UNITS["speed"]["kn"], "speed", "m/s in place of kn", UNITS["speed"]["kn"]),
        (3.6 * 1.1, "speed", "km/h in place of m/s", 3.6),
        (1000.0 / 1.1, "speed", "mm/s in place of m/s", 1000.0),
        (np.degrees(1.0), "rate", "deg/s in place of rad/s", np.degrees(1.0)),
        (60.0, "rate", "deg/min in place of deg/s", 60.0),
        (1.05, "speed", SIGN, 1.0),
        (np.exp(-0.99 * NEAR), "rate", SIGN, 1.0),
        (7.0, "rate", "", 7.0),
    ],
)
def test_a_factor_is_that_of_the_nearest_mistake_within_a_seventh(value, quantity, name, factor):
    found, known = _nearest(value, quantity)
    if name.endswith("deg/s") and found:  # ° and deg are one unit
        assert found.replace("°", "deg") == name
    else:
        assert found == name
    assert known == pytest.approx(factor)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_factor_within_its_distance_is_named_and_one_beyond_it_is_not(side):
    inside, beyond = (3.6 * np.exp(side * far * NEAR) for far in (0.97, 1.03))
    assert _nearest(inside, "speed")[0] == "km/h in place of m/s"
    assert "km/h in place of m/s" not in _nearest(beyond, "speed")[0]


# A pose that is mirrored


@pytest.mark.parametrize("k", range(3))
def test_of_a_pose_the_channel_with_the_other_sign_is_found_and_turned(k):
    true = sailed()
    flip = np.where(np.arange(3) == k, -1.0, 1.0)
    found = mirrored(replace(true, pose=true.pose * flip))
    (finding,) = found.findings
    assert finding.sentence == f"{POSE[k]} contradicts u, v and r: {OPPOSITE}"
    assert (finding.channel, finding.kind, finding.value) == (POSE[k], "scale", -1.0)
    assert found.run.pose == pytest.approx(true.pose)


def test_a_pose_that_agrees_or_that_two_signs_spoil_is_as_it_was():
    true = sailed()
    assert mirrored(true).run is true
    twice = replace(true, pose=true.pose * [-1.0, -1.0, 1.0])
    assert mirrored(twice).run is twice
    for name in "uvr":
        less = replace(true, measured={n: x for n, x in true.measured.items() if n != name})
        wrong = replace(less, pose=less.pose * [-1.0, 1.0, 1.0])
        assert mirrored(wrong).findings == ()


# Sway


def test_a_sway_with_the_other_sign_is_found_beside_a_place():
    """What a place adds comes with the yaw rate."""
    for place in (0.0, 1.5):
        true = sailed(place=place)
        assert sway(true, REFERENCE).findings == ()
        wrong = times(true, v=-0.8)
        found = sway(wrong, REFERENCE)
        (finding,) = found.findings
        assert finding.value == pytest.approx(-0.8, rel=0.02)
        assert (finding.channel, finding.kind) == ("v", "scale")
        assert f"times that by the pose: {OPPOSITE}" in finding.sentence
        assert found.run.measured["v"] == pytest.approx(0.8 * true.measured["v"])
        assert found.run.measured["u"] is wrong.measured["u"]


def test_a_sway_that_is_not_sure_or_too_few_windows_or_another_pair_say_nothing():
    faint = times(sailed(noise=0.3, v_size=0.01), v=-1.0)
    assert sway(faint, REFERENCE).run is faint
    windows = {n: times(sailed(seconds=HORIZON * n + 1.0), v=-1.0) for n in (IN_A_ROW - 1, IN_A_ROW)}
    assert [len(sway(run, REFERENCE).findings) for run in windows.values()] == [0, 1]
    true = sailed()
    north = replace(true, measured={"x_dot": true.measured["u"], "y_dot": -true.measured["v"]})
    assert sway(north, REFERENCE).run is north


def test_the_interval_of_a_sway_is_that_of_its_inverse():
    found = sway(times(sailed(noise=3e-2), v=-1.0), REFERENCE).findings[0]
    std = (found.ci95[1] - found.value) / Z95
    assert abs(found.value) > SURE * std > 0.0
    assert found.ci95[0] <= -1.0 <= found.ci95[1]


# Channels that are many times what the pose says


@pytest.mark.parametrize(("factor", "stated"), [(1.0 - 0.9 * ALIKE, False), (1.0 + 1.2 * ALIKE, True)])
def test_a_scale_that_is_near_one_is_left_to_the_estimate(factor, stated):
    found = units(times(sailed(), u=1.0 / factor, v=1.0 / factor), REFERENCE)
    assert bool(found.findings) == stated


@pytest.mark.parametrize("factor", [7.0, -7.0, -1.0])
def test_a_rate_is_divided_by_its_factor_with_its_interval(factor):
    run = sailed(noise=1e-3)
    found = units(times(run, r=factor), REFERENCE)
    (finding,) = found.findings
    assert finding.value == pytest.approx(factor, rel=0.01)
    assert finding.ci95[0] <= finding.value <= finding.ci95[1]
    assert 0.0 < finding.ci95[1] - finding.ci95[0] < 0.05 * abs(factor)
    assert found.run.measured["r"] == pytest.approx(run.measured["r"], rel=0.01)
    assert finding.sentence.endswith(OPPOSITE) == (factor < 0.0)
    assert finding.sentence.startswith(f"r is {finding.value:.4g} times that by the pose")
    assert ((finding.start, finding.end)) == (0.0, run.time[-1])


def test_a_run_with_too_few_windows_of_motion_is_as_it_was():
    run = times(sailed(seconds=HORIZON * (IN_A_ROW - 1) + 1.0), r=-1.0)
    assert units(run, REFERENCE).run is run
