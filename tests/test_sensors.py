"""Redundant channels of a run: a fault is named with its size, a clean run has none, and a repair closes."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.ndimage import gaussian_filter1d
from support.measured import DATA

import diagnosis
from diagnosis import Run
from diagnosis import repair as command
from diagnosis.predictors import Model
from diagnosis.runs import closure, examine, prepare
from diagnosis.runs.files.telegrams import filled
from diagnosis.runs.sensors import motion
from diagnosis.runs.sensors.clock_path import integral_of
from diagnosis.runs.sensors.further_channels import accelerations, receivers
from diagnosis.runs.sensors.wraps import unwrapped
from diagnosis.runs.smoothing import smoother
from diagnosis.search.findings import Finding
from diagnosis.verdict.confidence import Doubts, confidence_of, doubt_of_data
from fmus.frames import rotate_to_earth
from fmus.scale import REFERENCE, Scale

H, SECONDS = 0.1, 160.0
NOISE = (1e-3, 1e-3, 1e-3)


def made(seed=0, turning=1.0):
    """A run along bends by its velocities, all channels with noise."""
    fine = 20
    t = np.arange(round(SECONDS / H) * fine + 1) * H / fine
    u = 0.25 + 0.08 * np.sin(0.21 * t)
    v = 0.03 * np.sin(0.37 * t + 1.0)
    r = turning * (0.12 * np.sin(0.29 * t) + 0.05 * np.sin(0.11 * t))
    psi = np.cumsum(r) * H / fine
    x = np.cumsum(u * np.cos(psi) - v * np.sin(psi)) * H / fine
    y = np.cumsum(u * np.sin(psi) + v * np.cos(psi)) * H / fine
    at = slice(None, None, fine)
    rng = np.random.default_rng(seed)
    pose = np.column_stack([x, y, psi])[at]
    nu = np.column_stack([u, v, r])[at]
    pose = pose + NOISE * rng.standard_normal(pose.shape)
    nu = nu + 2e-3 * rng.standard_normal(nu.shape)
    measured = dict(zip(("u", "v", "r"), nu.T, strict=True))
    tau = np.column_stack([0.5 + 0.1 * np.sin(t[at]), 0.1 * np.cos(t[at]), 0.1 * np.sin(0.5 * t[at])])
    return Run("made", t[at], pose, tau, measured=measured)


def beside(run, **channels):
    return replace(run, measured=dict(run.measured) | channels)


def stated(run, scale=REFERENCE):
    return {(f.channel, f.kind): f for f in examine(run, scale).findings}


@pytest.mark.parametrize("seed", range(2))
def test_nothing_is_told_of_a_clean_run(seed):
    found = examine(made(seed), REFERENCE)
    assert found.findings == ()
    assert found.run.time.size == made(seed).time.size
    assert found.agreeing == pytest.approx(dict.fromkeys("uvr", 2e-3), rel=0.25), "their noise"


CONSTANT = {
    "speed scale": (("u", "scale"), 0.95, lambda r: beside(r, u=0.95 * r.measured["u"], v=0.95 * r.measured["v"])),
    "rate scale": (("r", "scale"), 1.05, lambda r: beside(r, r=1.05 * r.measured["r"])),
    "rate offset": (("r", "offset"), 0.01, lambda r: beside(r, r=0.01 + r.measured["r"])),
    "place": (("x", "place"), 0.3, lambda r: beside(r, v=r.measured["v"] - 0.3 * r.measured["r"])),
    "axis": (("psi", "offset"), 0.04, lambda r: replace(r, pose=r.pose + np.array([0.0, 0.0, 0.04]))),
    "late": (("r", "delay"), 0.5, lambda r: beside(r, r=np.interp(r.time - 0.5, r.time, r.measured["r"]))),
    "even clock": (("time", "clock_rate"), 1.1, lambda r: replace(r, time=r.time / 1.1)),
}  # fmt: skip


@pytest.mark.parametrize("name", CONSTANT)
def test_a_constant_fault_is_named_with_its_size_and_repaired(name):
    key, value, put = CONSTANT[name]
    broken = put(made())
    found = examine(broken, REFERENCE)
    assert [(f.channel, f.kind) for f in found.findings] == [key]
    assert found.findings[0].value == pytest.approx(value, rel=0.1)
    assert not stated(found.run)
    assert closure(found.run, 30.0, 10.0).position < 0.02


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("turning", "named"), [(0.5, ("psi", "offset")), (2.0, ("psi", "deviation_cos"))]
)
def test_an_error_that_goes_with_speed_and_course_is_no_scale_of_the_yaw_rate(turning, named, seed):
    """A gyrocompass errs by the speed to the north: nearly an offset on few headings, a cosine on all."""
    run = made(seed, turning)
    north = gaussian_filter1d(np.gradient(run.pose[:, 0], run.time), 10.0)
    found = stated(
        replace(run, pose=run.pose + np.column_stack([0.0 * north, 0.0 * north, -1.0 * north]))
    )
    assert named in found
    assert {channel for channel, _ in found} <= {"psi", "u"}
    assert {kind for channel, kind in found if channel == "psi"} == {named[1]}


def test_a_constant_of_half_of_the_run_has_the_uncertainty_of_its_parts():
    """An axis that is off by 0.04 rad in the second half alone: parts of 0, 0, 0.04 and 0.04."""
    run = made()
    off = np.where(run.time > SECONDS / 2.0, 0.04, 0.0)
    broken = replace(run, pose=run.pose + np.column_stack([0.0 * off, 0.0 * off, off]))
    assert ("psi", "offset") not in stated(broken)
    whole = replace(run, pose=run.pose + np.array([0.0, 0.0, 0.04]))
    fault = stated(whole)["psi", "offset"]
    assert fault.ci95[0] < 0.04 < fault.ci95[1]
    assert np.ptp(fault.ci95) < 0.02


def test_a_unit_of_the_rate_is_named():
    found = stated(beside(made(), r=np.degrees(made().measured["r"])))
    assert "deg/s in place of rad/s" in found["r", "scale"].sentence


@pytest.mark.parametrize("names", ["u", "v", "uv"])
def test_of_two_velocities_the_one_in_another_unit_is_named_and_repaired(names):
    """A second fault, of the yaw rate, is found beside it."""
    run = made()
    knots = {name: run.measured[name] / 0.514444 for name in names}
    found = examine(beside(run, r=1.05 * run.measured["r"], **knots), REFERENCE)
    assert [(f.channel, f.kind) for f in found.findings] == [(names[0], "scale"), ("r", "scale")]
    assert found.findings[0].value == pytest.approx(1.944, rel=0.02)
    assert "kn in place of m/s" in found.findings[0].sentence
    assert found.findings[0].sentence.startswith(" and ".join(names))
    for name in "uv":
        np.testing.assert_allclose(found.run.measured[name], run.measured[name], rtol=1e-5)


@pytest.mark.parametrize("name", ["x", "y", "psi"])
def test_a_mirrored_channel_of_the_pose_is_named_not_the_three_that_contradict_it(name):
    run = swung()
    signs = np.where(np.array(["x", "y", "psi"]) == name, -1.0, 1.0)
    found = examine(replace(run, pose=run.pose * signs), REFERENCE)
    assert [(f.channel, f.kind, f.value) for f in found.findings] == [(name, "scale", -1.0)]
    np.testing.assert_array_equal(found.run.pose, run.pose)
    assert [*stated(beside(run, r=-run.measured["r"]))] == [("r", "scale")], "one that is alone is it"


def test_sway_with_the_other_sign_is_no_place_of_the_antenna():
    run = made()
    ahead = np.column_stack([*rotate_to_earth(run.pose[:, 2], 0.3, 0.0), 0.0 * run.time])
    found = examine(beside(replace(run, pose=run.pose + ahead), v=-run.measured["v"]), REFERENCE)
    assert [(f.channel, f.kind) for f in found.findings] == [("v", "scale"), ("x", "place")]
    assert found.findings[0].value == pytest.approx(-1.0, abs=0.05)
    assert found.findings[1].value == pytest.approx(0.3, abs=0.02)
    assert closure(found.run, 30.0, 10.0).position < 0.02


@pytest.mark.parametrize(("delay", "way"), [(0.5, "later"), (-0.5, "earlier")])
def test_a_delay_that_is_found_in_steps_is_stated_as_it_is_repaired(delay, way):
    run = made()
    u, v, r = (np.interp(run.time - delay, run.time, run.measured[name]) for name in "uvr")
    found = stated(beside(run, u=u, v=v, r=r))
    for channel, name, of in (("u", "u and v are", "pose"), ("r", "r is", "heading")):
        value = abs(found[channel, "delay"].value)
        assert value == pytest.approx(0.5, abs=0.05)
        late = f", so that the {of} is probably late" if way == "earlier" else ""
        assert found[channel, "delay"].sentence == f"{name} {value:.3g} s {way} than the {of}{late}"


def test_a_scale_is_stated_in_percent():
    run = made()
    found = stated(beside(run, u=0.95 * run.measured["u"], v=0.95 * run.measured["v"]))
    assert found["u", "scale"].sentence.startswith("u and v are 5.0 % too small")


def swung(deviation=0.0, turning=0.06):
    """A run all round the compass, a turn and a half, which is off by heading as iron makes it."""
    run = made()
    more = turning * run.time
    r, psi = run.measured["r"] + turning, run.pose[:, 2] + more
    v_n, v_e = rotate_to_earth(psi, run.measured["u"], run.measured["v"])
    x, y = (np.concatenate([[0.0], np.cumsum((a[1:] + a[:-1]) * H / 2)]) for a in (v_n, v_e))
    rng = np.random.default_rng(3)
    pose = np.column_stack([x, y, psi + deviation * np.sin(psi) - 0.5 * deviation * np.cos(2 * psi)])
    return beside(replace(run, pose=pose + NOISE * rng.standard_normal(pose.shape)), r=r)


def test_a_compass_off_by_heading_is_no_clock_that_wanders():
    found = stated(swung(0.07))
    assert set(found) == {("psi", "deviation_sin"), ("psi", "deviation_cos_2")}
    assert found["psi", "deviation_sin"].value == pytest.approx(0.07, abs=0.004)
    assert found["psi", "deviation_cos_2"].value == pytest.approx(-0.035, abs=0.004)
    assert not stated(swung())
    repaired = examine(swung(0.07), REFERENCE).run.pose[:, 2]
    assert np.std(repaired - swung().pose[:, 2]) < 0.006


def test_a_compass_is_told_from_a_clock_by_a_part_of_the_headings():
    """Though no speed is measured; and noise that a repair would lessen speaks for no compass."""
    seen, true = swung(0.05, 0.02), swung(0.0, 0.02)
    assert np.ptp(true.pose[:, 2]) < 5.0
    found = examine(replace(seen, measured={"r": seen.measured["r"]}), REFERENCE)
    assert {f.channel for f in found.findings} == {"psi"}
    off = found.run.pose[:, 2] - true.pose[:, 2]
    assert np.std(off) < 0.1 * np.std(seen.pose[:, 2] - true.pose[:, 2])


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_of_a_yaw_rate_is_no_clock(seed):
    """Of a gyro whose noise turns it by more between two nodes than the heading is uncertain by."""
    t, rng = np.arange(0.0, 400.0, 0.2), np.random.default_rng(seed)
    psi = 2.5 * np.sin(0.05 * t) + 0.8 * np.sin(0.11 * t)
    noise = rng.normal(size=(3, t.size)) * [[0.05], [0.05], [np.radians(0.025)]]
    pose = np.column_stack([2.0 * t, 0.0 * t, psi]) + noise.T
    rate = np.gradient(psi, t) + rng.normal(0.0, np.radians(0.25), t.size)
    assert not stated(Run("a", t, pose, np.zeros((t.size, 3)), measured={"r": rate}))


@pytest.mark.parametrize("heading", [0.1, 0.5])
def test_a_yaw_rate_with_more_noise_than_turn_has_no_scale(heading):
    """Its noise would lessen any factor between rate and heading."""
    t, rng = np.arange(0.0, 400.0, 0.2), np.random.default_rng(0)
    psi = 0.3 * np.sin(0.02 * t)
    noise = rng.normal(size=(3, t.size)) * [[0.05], [0.05], [np.radians(heading)]]
    pose = np.column_stack([2.0 * t, 0.0 * t, psi]) + noise.T
    rate = np.gradient(psi, t) + rng.normal(0.0, np.radians(0.6), t.size)
    assert not stated(Run("a", t, pose, np.zeros((t.size, 3)), measured={"r": rate}))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_noise_of_the_heading_is_no_deviation_of_the_compass(seed):
    """A ship that once turned about, and then heads north: both sides of the fit have the same noise."""
    t, rng = np.arange(0.0, 400.0, 0.2), np.random.default_rng(seed)
    psi = 0.5 * np.sin(0.2 * t) + np.pi * (1.0 + np.tanh((t - 60.0) / 20.0))
    noise = rng.normal(0.0, 0.01, (2, t.size))
    pose = np.column_stack([t, 0.0 * t, psi + noise[0]]) + rng.normal(
        0.0, [0.01, 0.01, 1e-9], (t.size, 3)
    )
    run = Run("a", t, pose, np.zeros((t.size, 3)), measured={"r": np.gradient(psi, t) + noise[1]})
    assert not stated(run)


@pytest.mark.parametrize("either", [True, False])
def test_a_clock_that_a_compass_would_look_like_is_told_with_it(monkeypatch, either):
    monkeypatch.setattr(motion, "_stretches", lambda path: [(0.0, 60.0, 1.1, 0.01)])
    faults = SimpleNamespace(wanders=True, either=either, by_way=False, path=None)
    (found,) = motion._clock(faults, SimpleNamespace(by=None))
    assert ("compass" in found.sentence) == ("deviation_sin" in found.alike) == either
    assert found.repaired != either


def test_without_a_speed_clock_and_scale_of_the_rate_are_one():
    run = beside(made(), r=1.06 * made().measured["r"])
    alone = replace(run, measured={"r": run.measured["r"]})
    (found,) = stated(alone).values()
    assert (found.channel, found.kind, found.alike, found.repaired) == (
        "r",
        "scale",
        ("clock_rate",),
        False,
    )
    assert stated(run)["r", "scale"].repaired


def test_findings_do_not_depend_on_where_and_how_the_earth_lies():
    run = beside(made(), r=1.05 * made().measured["r"])
    turn = 2.0
    c, s = np.cos(turn), np.sin(turn)
    x, y, psi = run.pose.T
    other = replace(run, pose=np.column_stack([c * x - s * y + 1e3, s * x + c * y - 5e3, psi + turn]))
    a, b = stated(run)["r", "scale"].value, stated(other)["r", "scale"].value
    assert a == pytest.approx(b, abs=1e-4)


def test_a_clock_that_wanders_is_told_by_its_stretches_and_repaired():
    run = made()
    log = run.time + 0.1 * 60.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * run.time / 60.0)
    found = examine(replace(run, time=log), REFERENCE)
    rates = [f for f in found.findings if f.kind == "clock_rate"]
    assert len(rates) >= 3
    assert min(f.value for f in rates) < 0.96
    assert max(f.value for f in rates) > 1.04
    assert {f.kind for f in found.findings} == {"clock_rate"}
    between = found.run.time - found.run.time[0] - (run.time - run.time[0])
    assert np.abs(between).max() < 0.2  # s; the log is up to 1.9 s off
    assert (
        closure(found.run, 30.0, 10.0).position
        < 0.3 * closure(replace(run, time=log), 30.0, 10.0).position
    )


def test_without_a_way_a_clock_that_wanders_may_be_a_heading_that_is_none():
    """As a course over ground in place of the heading."""
    run = made()
    course = run.pose[:, 2] + np.arctan2(run.measured["v"], run.measured["u"])
    pose = np.column_stack([run.pose[:, :2], course])
    found = examine(replace(run, pose=pose, measured={"r": run.measured["r"]}), REFERENCE)
    rates = [f for f in found.findings if f.kind == "clock_rate"]
    assert rates
    assert not any(f.repaired for f in rates)
    assert np.array_equal(found.run.time, run.time)


def test_without_a_turn_a_clock_that_wanders_may_be_a_speed_that_is_filtered():
    """A receiver that averages its speed looks like a clock that follows the throttle."""
    run = made()
    log = run.time + 0.1 * 60.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * run.time / 60.0)
    speeds = {n: run.measured[n] for n in ("u", "v")}
    found = examine(replace(run, time=log, measured=speeds), REFERENCE)
    rates = [f for f in found.findings if f.kind == "clock_rate"]
    assert rates
    assert not any(f.repaired for f in rates)
    assert all(f.aside == ("u", "v") and "no yaw rate is measured" in f.sentence for f in rates)
    assert np.array_equal(found.run.time, log)


def held(run):
    """Its position north stands still for a tenth of the run, as the log's writer held it."""
    x = run.pose[:, 0].copy()
    x[600:760] = x[600]
    return replace(run, pose=np.column_stack([x, run.pose[:, 1:]]))


def behind(run):
    """Its pose is filtered over a second and a half."""
    pose, share = run.pose.copy(), 1.0 - np.exp(-H / 1.5)
    for k in range(1, len(pose)):
        pose[k] = pose[k - 1] + share * (pose[k] - pose[k - 1])
    return replace(run, pose=pose)


@pytest.mark.parametrize(("lie", "seconds"), [(held, SECONDS), (behind, 70.0)])
def test_what_way_and_turn_tell_differently_is_no_clock(lie, seconds):
    run = lie(made())
    run = run.rows(run.time <= seconds)
    found = examine(run, REFERENCE)
    assert {f.kind for f in found.findings} <= {"delay"}
    assert np.array_equal(found.run.time, run.time)


def test_a_position_that_was_held_needs_two_clocks():
    assert [n for n in examine(held(made()), REFERENCE).notes if "another clock" in n]


def test_true_time_rises_where_noise_makes_the_rate_of_the_clock_negative():
    edges, clock = np.arange(0.0, 6.0), np.array([0.9, 1.1, -0.4, 1.0, 1.0])
    true = integral_of(edges, clock)
    assert (np.diff(true) > 0.0).all()
    assert true[[0, 1, 2, 4, 5]] == pytest.approx([0.0, 0.9, 2.0, 2.6, 3.6])


def test_seconds_that_the_log_lacks_are_told():
    run = made()
    keep = (run.time < 80.0) | (run.time > 90.0)
    cut = run.rows(keep)
    found = examine(replace(cut, time=np.where(cut.time < 80.0, cut.time, cut.time - 10.0)), REFERENCE)
    (gap,) = found.findings
    assert gap.kind == "clock_gap"
    assert gap.ci95[0] < 10.0 < gap.ci95[1]
    assert np.diff(found.run.time).max() == pytest.approx(gap.value, abs=0.3)


@pytest.mark.parametrize("factor", [0.9, 0.98])
def test_without_turns_clock_and_scale_are_one_and_the_speed_is_set_aside(factor):
    """What is learned of it is not sure where a clock at that rate would matter."""
    straight = made(turning=0.0)
    run = beside(straight, u=factor * straight.measured["u"], v=factor * straight.measured["v"])
    found = stated(run)["u", "scale"]
    assert found.alike == ("clock_rate",)
    assert not found.repaired
    assert found.aside == ("u", "v")
    (prepared,) = diagnosis.gather([run], anyway=True)  # its commands are of no ship
    assert not {"u", "v"} & {*prepared.run.measured, *prepared.smoothed.sensors.agreeing}
    np.testing.assert_array_equal(prepared.run.time, run.time)
    assert bool(doubt_of_data([prepared])) == (factor == 0.9)
    f = Finding("mass", {"mass": 30.0}, {"mass": (20.0, 40.0)}, 0.99, [], 0.9, 0.9, together=0.99)
    seen = confidence_of(f, Model(), Doubts(of_data=doubt_of_data([prepared])))
    assert (seen.own == 0.99) == (not seen.doubt) == (factor != 0.9)


def test_an_angle_interpolated_through_its_wrap_is_put_on_the_short_way():
    true = np.linspace(5.9, 6.7, 33)
    telegrams = np.mod(true[::4], 2.0 * np.pi)
    seen = np.interp(np.arange(33), np.arange(0, 33, 4), telegrams)
    repaired, rows = unwrapped(seen)
    assert rows.size == 3
    np.testing.assert_allclose(np.mod(repaired, 2.0 * np.pi), np.mod(true, 2.0 * np.pi), atol=1e-9)
    assert unwrapped(np.mod(true, 2.0 * np.pi))[1].size == 0


def test_a_course_at_rest_is_not_interpolated():
    """A receiver that does not move states any course; under way it is as smooth as the motion."""
    rng = np.random.default_rng(0)
    course = np.concatenate([rng.uniform(0.0, 2.0 * np.pi, 300), 0.01 * np.arange(300)])
    assert unwrapped(course)[1].size == 0


def idle(run, speed, seconds=60.0):
    """The run after some time at rest, whose receiver states a speed along a course that is held."""
    rng = np.random.default_rng(1)
    n = round(seconds / H)
    s = np.abs(run.measured["u"] + 1j * run.measured["v"])
    drift = np.arctan2(run.measured["v"], run.measured["u"])
    at_rest = np.abs(speed * (rng.standard_normal(n) + 1j * rng.standard_normal(n)))
    channels = {
        "speed": np.concatenate([at_rest, s]),
        "course": np.concatenate([np.full(n, 1.0), run.pose[:, 2] + drift]),
    }
    pose = np.concatenate([run.pose[0] + NOISE * rng.standard_normal((n, 3)), run.pose])
    time = H * np.arange(len(pose))
    tau = np.concatenate([np.zeros((n, 3)), run.tau_cmd])
    return replace(run, time=time, pose=pose, tau_cmd=tau, measured=channels)


def test_a_ship_at_rest_says_nothing_of_the_clock():
    """A receiver at rest states a speed above zero; a clock that stands still would explain it."""
    assert not {f.kind for f in examine(idle(made(), 2e-3), REFERENCE).findings} & {"clock_rate"}
    slow = idle(made(), 2e-3)
    late = np.where(slow.time < 140.0, slow.time, 140.0 + 1.1 * (slow.time - 140.0))
    found = [f for f in examine(replace(slow, time=late), REFERENCE).findings if f.kind == "clock_rate"]
    assert min(f.value for f in found) == pytest.approx(1.0 / 1.1, abs=0.02)


@pytest.mark.parametrize(("first", "last"), [(40.0, 70.0), (75.0, 95.0), (100.0, 150.0)])
def test_a_time_that_was_not_logged_says_nothing_of_the_clock(first, last):
    run = made(turning=2.0)
    cut = run.rows((run.time <= first) | (run.time >= last))
    assert examine(cut, REFERENCE).findings == ()


@pytest.mark.parametrize("factor", [1.0, 1.05])
@pytest.mark.parametrize(("first", "last"), [(60.0, 80.0), (0.0, 30.0), (100.0, 161.0)])
def test_where_a_yaw_rate_is_missing_it_contradicts_no_heading(first, last, factor):
    run = made()
    missing = (run.time >= first) & (run.time <= last)
    found = stated(beside(run, r=np.where(missing, np.nan, factor * run.measured["r"])))
    assert [*found] == [("r", "scale")] * (factor != 1.0)
    if found:
        assert found["r", "scale"].value == pytest.approx(factor, rel=0.02)


def test_seconds_that_a_log_has_too_many_are_told():
    """The ship is where it was: its clock was set ahead."""
    run = made()
    found = stated(replace(run, time=np.where(run.time < 80.0, run.time, run.time + 20.0)))
    assert found["time", "clock_gap"].value == pytest.approx(-20.0, abs=0.3)


def test_rows_between_telegrams_do_not_count():
    rng = np.random.default_rng(0)
    at = np.arange(0.0, 200.0, 2.0)
    position = np.cumsum(rng.normal(size=(at.size, 2)), axis=0)
    t = np.arange(0.0, at[-1], 0.5)
    line = np.column_stack([np.interp(t, at, column) for column in position.T]).round(3)
    kept = t[~filled(t, line, 1e-3)]
    assert 0.9 * at.size < kept.size < 1.1 * at.size
    assert np.abs(kept[:, None] - at).min(axis=1).max() <= 0.5
    assert not filled(t, line + 0.01 * rng.normal(size=line.shape)).any()


def second(run, ahead=0.0, aside=0.0, late=0.0, turned=0.0):
    """The run with a second antenna, and a second heading."""
    x, y, psi = run.pose.T
    c, s = np.cos(psi), np.sin(psi)
    x, y = x + ahead * c - aside * s, y + ahead * s + aside * c
    x, y = (np.interp(run.time - late, run.time, column) for column in (x, y))
    return beside(run, x_2=x, y_2=y, psi_2=psi + turned)


@pytest.mark.parametrize("late", [0.0, 0.4])
@pytest.mark.parametrize("turned", [0.0, 0.03, -0.03])
@pytest.mark.parametrize(("ahead", "aside"), [(0.0, 0.0), (0.5, -0.2), (0.0, 0.7)])
def test_a_second_antenna_has_its_place_and_delay_and_a_second_heading_its_offset(
    ahead, aside, turned, late
):
    run = made()
    found = receivers(second(run, ahead, aside, late, turned), REFERENCE)
    true = {
        ("x_2", "place", "m"): (ahead, 0.02),
        ("y_2", "place", "m"): (aside, 0.02),
        ("x_2", "delay", "s"): (late, 0.05),
        ("psi_2", "offset", "rad"): (turned, 1e-3),
    }
    stated = {(f.channel, f.kind, f.unit): f for f in found.findings}
    assert stated.keys() == {key for key, (value, _) in true.items() if value}
    for key, f in stated.items():
        assert f.value == pytest.approx(true[key][0], abs=true[key][1])
        assert f.value - f.ci95[0] == pytest.approx(f.ci95[1] - f.value)
        assert (f.start, f.end) == (0.0, SECONDS)
        assert f"{np.degrees(f.value) if f.unit == 'rad' else f.value:.3g}" in f.sentence
    right = second(run)
    for name, off in (("x_2", 0.02), ("y_2", 0.02), ("psi_2", 1e-3)):
        np.testing.assert_allclose(
            found.run.measured[name][10:-10], right.measured[name][10:-10], atol=off
        )
    few = second(run, 0.5, -0.2, turned=0.03).rows(run.time < 1.8)
    assert not receivers(few, REFERENCE).findings


def test_stretches_of_a_clock_are_off_in_one_sense_and_have_the_mean_of_their_time(monkeypatch):
    mean, std = np.array([1.0, 1.1, 1.2, 1.0, 0.9, 1.1]), np.full(6, 0.001)
    first, last = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 8.0]), np.array([1.0, 2.0, 6.0, 7.0, 8.0, 9.0])
    monkeypatch.setattr(motion, "_blocks", lambda path: motion._Blocks(mean, std, first, last))
    fast, slow, again = motion._stretches(None)
    assert fast == pytest.approx((1.0, 6.0, 1.18, 0.001 / np.sqrt(2.0)))
    assert slow == pytest.approx((7.0, 8.0, 0.9, 0.001))
    assert again[:3] == pytest.approx((8.0, 9.0, 1.1))


def test_rates_count_where_all_that_agree_are_there(monkeypatch):
    run = made()
    run.measured["r"][40] = np.nan
    monkeypatch.setattr(smoother, "basis", lambda grid, t, derivative: t)
    rows, psi = np.arange(0, run.time.size, 2), run.pose[:, 2]
    track = SimpleNamespace(run=run)
    at, rates = smoother.measured_rates(track, rows, psi, {"r": 0.5}, None)
    assert at.tolist() == [row for row in rows if row != 40]
    assert rates.z[:, 2] == pytest.approx(run.measured["r"][at])
    assert rates.sigma.tolist() == [np.inf, np.inf, 0.5]
    assert smoother.measured_rates(track, rows, psi, {}, None) is None
    assert smoother.measured_rates(track, np.array([40]), psi, {"r": 0.5}, None) is None


def test_a_rate_that_is_held_is_no_further_sample(monkeypatch):
    """A receiver of 5 Hz in rows of 10 Hz: each value counts once, with the noise that it has."""
    run = made()
    noisy = run.measured["r"] + 0.01 * np.random.default_rng(5).standard_normal(run.time.size)
    held = replace(run, measured={"r": noisy[np.arange(run.time.size) // 2 * 2]})
    monkeypatch.setattr(smoother, "basis", lambda grid, t, derivative: t)
    rows, psi = np.arange(run.time.size), run.pose[:, 2]
    at, rates = smoother.measured_rates(SimpleNamespace(run=held), rows, psi, {"r": 1e-6}, None)
    assert at.tolist() == rows[::2].tolist()
    assert (rates.share == [0.0, 0.0, 1.0]).all()
    assert rates.sigma[2] == pytest.approx(0.01, rel=0.15)


def test_a_held_speed_does_not_make_the_motion_surer_than_it_is():
    """Rough positions at 1 Hz, speed and course at 5 Hz, held in rows of 10 Hz by their receiver."""
    run, rng = made(), np.random.default_rng(6)
    row = np.arange(run.time.size)
    ahead, aside = run.measured["u"], run.measured["v"]
    north, east = rotate_to_earth(run.pose[:, 2], ahead, aside)
    speed = np.hypot(north, east) + 0.02 * rng.standard_normal(row.size)
    course = np.unwrap(np.arctan2(east, north)) + 0.05 * rng.standard_normal(row.size)
    pose = run.pose.copy()
    pose[:, :2] = (pose[:, :2] + 0.3 * rng.standard_normal((row.size, 2)))[row // 10 * 10]
    measured = {"speed": speed[row // 2 * 2], "course": course[row // 2 * 2]}
    s = prepare(replace(run, pose=pose, measured=measured)).smoothed
    assert "speed" in s.sensors.agreeing
    off = (s.nu[50:-50, :2] - np.column_stack([ahead, aside])[50:-50]) / s.nu_std[50:-50, :2]
    assert np.sqrt((off**2).mean()) < 1.6, "the motion is as sure as it says"


@pytest.mark.parametrize("every", [2, 3, 5])
def test_a_velocity_in_a_few_of_the_rows_is_one(every):
    """A receiver whose cells are empty in the rows between two of its telegrams."""
    run = made()
    sparse = {
        n: np.where(np.arange(run.time.size) % every, np.nan, 0.95 * run.measured[n]) for n in "uv"
    }
    found = examine(beside(run, **sparse), REFERENCE)
    (fault,) = found.findings
    assert (fault.channel, fault.kind, fault.value) == ("u", "scale", pytest.approx(0.95, abs=0.01))
    assert {"u", "v", "r"} == set(found.agreeing)


def test_a_velocity_of_a_third_of_the_run_is_not_that_of_the_run():
    run = made()
    first = {n: np.where(run.time < SECONDS / 3, run.measured[n], np.nan) for n in "uv"}
    assert set(examine(beside(run, **first), REFERENCE).agreeing) == {"r"}


def test_the_smoother_is_sharper_with_channels_that_agree():
    run = made()
    rough = replace(run, pose=run.pose + 0.02 * np.random.default_rng(3).standard_normal(run.pose.shape))
    agreeing = examine(rough, REFERENCE).agreeing
    alone = diagnosis.smooth(diagnosis.clean(rough))
    both = diagnosis.smooth(diagnosis.clean(rough), agreeing=agreeing)
    assert (np.nanmean(both.nu_std, axis=0) < 0.5 * np.nanmean(alone.nu_std, axis=0)).all()
    assert np.nanstd(both.nu[:, 2] - run.measured["r"]) < np.nanstd(alone.nu[:, 2] - run.measured["r"])


def test_the_command_writes_a_measurement_without_the_fault(tmp_path, capsys):
    run = made()
    pose = dict(zip(("x", "y", "psi"), run.pose.T, strict=True))
    tau = dict(zip(("tau_X", "tau_Y", "tau_N"), run.tau_cmd.T, strict=True))
    late = dict(run.measured) | {"r": 1.05 * run.measured["r"]}
    pd.DataFrame({"time": run.time, **pose, **tau, **late}).to_csv(tmp_path / "a.csv", index=False)
    told_beside = {"columns": {"r": {"name": "r", "noise": 0.002}}}
    (tmp_path / "a.csv.json").write_text(json.dumps(told_beside))
    assert command.main([str(tmp_path / "a.csv"), "--out", str(tmp_path / "b.csv")]) == 0
    assert "r is 5.0 % too large" in capsys.readouterr().out
    again = diagnosis.read(tmp_path / "b.csv")
    assert not stated(again)
    assert again.noise == {"r": 0.002}
    assert command.main([str(tmp_path / "a.csv"), "--out", str(tmp_path / "b.csv")]) == 2


def accelerated(run, ahead=0.0, starboard=0.0, turned=0.0, scale=1.0, a_x=0.0, a_y=0.0):
    """The run with the acceleration of another place, of axes turned to port, and with offsets."""
    t = run.time
    u, v = 0.25 + 0.08 * np.sin(0.21 * t), 0.03 * np.sin(0.37 * t + 1.0)
    r = 0.12 * np.sin(0.29 * t) + 0.05 * np.sin(0.11 * t)
    r_dot = 0.12 * 0.29 * np.cos(0.29 * t) + 0.05 * 0.11 * np.cos(0.11 * t)
    x = 0.08 * 0.21 * np.cos(0.21 * t) - v * r - ahead * r**2 - starboard * r_dot
    y = 0.03 * 0.37 * np.cos(0.37 * t + 1.0) + u * r + ahead * r_dot - starboard * r**2
    x, y = np.array([x, y]) + 2e-3 * np.random.default_rng(5).standard_normal((2, t.size))
    c, s = scale * np.cos(turned), scale * np.sin(turned)
    return beside(run, a_x=c * x - s * y + a_x, a_y=s * x + c * y + a_y)


@pytest.mark.parametrize(
    ("fault", "key", "unit"),
    [
        ({}, None, None),
        ({"scale": 1.1}, ("a_x", "scale"), "1"),
        ({"a_x": 0.02}, ("a_x", "offset"), "m/s2"),
        ({"a_y": -0.03}, ("a_y", "offset"), "m/s2"),
        ({"turned": 0.15}, ("a_y", "offset"), "rad"),
        ({"turned": -0.15}, ("a_y", "offset"), "rad"),
        ({"ahead": 1.0}, ("a_x", "place"), "m"),
        ({"starboard": -1.0}, ("a_y", "place"), "m"),
    ],
)
def test_the_acceleration_is_held_against_the_velocity(fault, key, unit):
    run, right = accelerated(made(), **fault), accelerated(made())
    found = accelerations(run, REFERENCE)
    assert [(f.channel, f.kind) for f in found.findings] == ([key] if fault else [])
    assert not accelerations(made(), REFERENCE).findings, "without one, nothing is held"
    if fault:
        (finding,), ((_, value),) = found.findings, fault.items()
        assert finding.unit == unit
        assert finding.value == pytest.approx(value, rel=0.2)
        assert finding.ci95[0] < value < finding.ci95[1]
        assert (finding.start, finding.end) == (0.0, SECONDS)
        assert f"{finding.value:.3g}" in finding.sentence or key == ("a_x", "scale")
        if key[1] != "place":
            for name in ("a_x", "a_y"):
                np.testing.assert_allclose(found.run.measured[name], right.measured[name], atol=5e-3)
        short = run.rows(run.time < 50.0)
        assert not accelerations(short, REFERENCE).findings, "of fewer windows nothing is told"
        assert not accelerations(run, Scale(9.0)).findings, "which are longer on a larger ship"


def test_the_speed_through_water_is_held_against_that_over_ground():
    run = made()
    psi = run.pose[:, 2]
    u, v = run.measured["u"], run.measured["v"]
    north, east = 0.05, -0.03
    water = {
        "u_water": u - north * np.cos(psi) - east * np.sin(psi),
        "v_water": v + north * np.sin(psi) - east * np.cos(psi),
    }
    right = examine(beside(run, **water), REFERENCE)
    assert not right.findings
    assert "0.05 m/s to north and -0.03 m/s to east" in " ".join(right.notes)
    for names in (["u_water"], ["u_water", "v_water"]):
        wrong = examine(beside(run, **{n: 1.08 * water[n] for n in names}), REFERENCE)
        assert [(f.channel, f.kind) for f in wrong.findings] == [("u_water", "scale")]
        assert wrong.findings[0].value == pytest.approx(1.08, rel=0.01)
        np.testing.assert_allclose(wrong.run.measured["u_water"], water["u_water"], atol=5e-3)


def test_of_a_pose_alone_nothing_can_be_said(tmp_path, capsys):
    run = made()
    columns = dict(
        zip(("x", "y", "psi", "tau_X", "tau_Y", "tau_N"), [*run.pose.T, *run.tau_cmd.T], strict=True)
    )
    pd.DataFrame({"time": run.time, **columns}).to_csv(tmp_path / "a.csv", index=False)
    assert command.main([str(tmp_path / "a.csv"), "--out", str(tmp_path / "b.csv")]) == 0
    assert "no redundant channel for a comparison" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("trial", ["trial_1"])
def test_the_sea_trial_closes_once_its_clock_is_repaired(trial):
    path = DATA / "gunnerus" / f"{trial}.csv"
    if not path.is_file():
        pytest.skip("no measured runs: CYBERSHIP_DATA names no folder that has the sea trial")
    d = pd.read_csv(path)
    zero = np.zeros((len(d), 3))
    measured = {"u": d.u.to_numpy(), "v": d.v.to_numpy(), "r": np.radians(d.r.to_numpy())}
    pose = np.column_stack([d.N, d.E, np.radians(d.psi)])
    rounded = np.full_like(pose, 1e-3)
    run = Run(trial, d.tvec.to_numpy(), pose, zero, measured=measured, resolution=rounded)
    found = examine(run, Scale(33.9 / 1.105))
    after = closure(found.run, 60.0, 20.0)
    assert closure(run, 60.0, 20.0).position > 8.0
    assert (np.diff(found.run.time) > 0.0).all()
    assert after.position < 2.0
    assert np.degrees(after.heading) < 1.0
    scale = next(f for f in found.findings if f.kind == "scale")
    assert scale.value == pytest.approx(0.98, abs=0.005)


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.6, 1.97, 3.5])
def test_a_delay_whose_estimate_goes_too_far_is_found_nevertheless(gain):
    """Whole steps would go to and fro about it: with a gain of 1.97 for two hundred rounds."""
    delay, taken, last, share = 1.0, 0.0, 0.0, 1.0
    for _ in range(8):
        last, share = motion._step(gain * (delay - taken), last, share)
        taken += last
    assert taken == pytest.approx(delay, abs=0.03)


def test_the_interval_of_a_scale_is_as_wide_relative_to_it_at_any_scale():
    widths = []
    for scale in (0.5, 1.5, 4.0):
        (finding,) = accelerations(accelerated(made(), scale=scale), REFERENCE).findings
        low, high = finding.ci95
        widths.append((high - low) / finding.value)
    assert widths == pytest.approx([widths[0]] * 3, rel=0.02)
