"""What a fault of a sensor does to the path, and its repair: both against the definition of the fault."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis import Run
from diagnosis.runs import closure
from diagnosis.runs.sensors import further_channels
from diagnosis.runs.sensors.constants import DEVIATIONS, columns, deviations, least_place
from diagnosis.runs.sensors.evidence import (
    FEWEST,
    Evidence,
    blocked_fit,
    evidence,
    integral,
    large,
    spread_of,
    straight,
)
from diagnosis.runs.sensors.gaps import _arc, _elsewhere, gaps
from diagnosis.runs.sensors.repairing import Correction, corrected
from diagnosis.runs.sensors.unit_faults import units
from fmus.scale import REFERENCE, Scale

STEP = 0.1
T = np.arange(0.0, 240.0, STEP)
PAIRS = [("u", "v"), ("x_dot", "y_dot"), ("speed", "course")]
FAULTS = {  # channels of the velocity -> faults that its columns name, those of the yaw rate left out
    ("u", "v"): [
        "u scale",
        "psi offset",
        "x place",
        "y place",
        "u delay",
        *(f"psi {k}" for k in DEVIATIONS),
    ],
    ("x_dot", "y_dot"): ["x_dot scale", "y_dot offset", "x place", "y place", "x_dot delay"],
    ("speed", "course"): ["speed scale", "course offset", "x place", "y place", "speed delay"],
}
CASES = [(by, *f.split()) for by in PAIRS for f in (*FAULTS[by], "r scale", "r offset", "r delay")]


def motion(t):
    """Body-fixed velocity and heading of a ship that winds."""
    u, v = 0.5 + 0.1 * np.sin(0.3 * t), 0.05 * np.sin(0.5 * t)
    return u, v, 0.1 + 0.3 * np.sin(0.2 * t) + 0.02 * t


def rate(t):
    return 0.06 * np.cos(0.2 * t) + 0.02


def turned(angle, x, y):
    return np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y


def given_as(by, psi, u, v):
    """A velocity in the channels by which it is measured."""
    north, east = turned(psi, u, v)
    speed = np.hypot(u, v), np.unwrap(np.arctan2(east, north))
    return {("u", "v"): (u, v), ("x_dot", "y_dot"): (north, east), ("speed", "course"): speed}[by]


def fine(function, n=20):
    """The integral of a function of time at T, much finer than its samples."""
    t = np.linspace(0.0, T[-1], (T.size - 1) * n + 1)
    values = np.array(function(t))
    steps = 0.5 * (values[..., 1:] + values[..., :-1]) * (t[1] - t[0])
    return np.concatenate([np.zeros_like(values[..., :1]), steps.cumsum(axis=-1)], axis=-1)[..., ::n]


def run_with(by, channel="", kind="", size=0.0):
    """A run whose channels have one fault, by the definition of :class:`SensorFinding`."""
    late = size if kind == "delay" and channel in by else 0.0
    u, v, _ = motion(T - late)
    psi = motion(T if by == ("u", "v") else T - late)[2]  # what is late is what the channel says
    first, second = given_as(by, psi, u, v)
    if channel in by and kind == "scale":
        first, second = first * (1.0 + size), second * (1.0 if by[0] == "speed" else 1.0 + size)
    if kind == "offset" and channel == "course":
        second = second + size
    if kind == "offset" and channel == "y_dot":  # axes turned by the value
        first, second = turned(-size, first, second)
    r = rate(T - (size if (channel, kind) == ("r", "delay") else 0.0))
    r = r * (1.0 + size) if (channel, kind) == ("r", "scale") else r
    r = r + size if (channel, kind) == ("r", "offset") else r
    psi = motion(T)[2]
    x, y = fine(lambda t: turned(motion(t)[2], *motion(t)[:2]))
    if kind == "place":
        dx, dy = turned(psi, *((size, 0.0) if channel == "x" else (0.0, size)))
        x, y = x + dx, y + dy
    if channel == "psi":
        psi = psi + size * (DEVIATIONS[kind](psi) if kind in DEVIATIONS else 1.0)
    pose = np.column_stack([x, y, psi])
    return Run("made", T, pose, np.zeros_like(pose), measured={by[0]: first, by[1]: second, "r": r})


def contradiction(run):
    """Path that the pose says, less that of the channels, from its first point on."""
    e = evidence(run)
    off = np.column_stack([run.pose[:, :2] - e.gone, e.psi - e.turned])
    return off - off[0]


@pytest.mark.parametrize(("by", "channel", "kind"), CASES)
def test_a_column_is_what_one_unit_of_its_fault_adds_to_the_path(by, channel, kind):
    size = 1e-3
    e = evidence(run_with(by))
    assert e.by == by
    (column,) = [
        c
        for c in (*columns(e, REFERENCE), *deviations(e, e.psi))
        if (c.channel, c.kind) == (channel, kind)
    ]
    added = (contradiction(run_with(by, channel, kind, size)) - contradiction(run_with(by))) / size
    expected = column.path - column.path[0]
    if kind == "offset" and channel == "psi":  # the heading's own offset is a constant
        assert added[:, 2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(added, expected, atol=0.01 * np.abs(expected).max())


@pytest.mark.parametrize("by", PAIRS)
def test_a_fault_in_a_part_of_the_run_adds_what_it_adds_there(by):
    e = evidence(run_with(by))
    part = np.repeat([0, 1, 2], [500, 1000, T.size - 1501])
    for column in columns(e, REFERENCE):
        each = np.array([column.during(part == k).path for k in range(3)])
        np.testing.assert_allclose(each.sum(axis=0), column.path - column.path[0], atol=1e-9)
        for own, first, last in zip(each, (0, 500, 1500), (500, 1500, T.size - 1), strict=True):
            assert not own[: first + 1].any()
            assert np.ptp(own[last:], axis=0) == pytest.approx(0.0)
            gone = column.path[last] - column.path[first]
            assert own[last] == pytest.approx(gone, abs=1e-9)


def test_a_yaw_rate_that_is_not_measured_has_no_fault_there():
    run = run_with(("u", "v"))
    missing = (T >= 100.0) & (T <= 140.0)
    rate = np.where(missing, np.nan, run.measured["r"])
    e = evidence(replace(run, measured={**run.measured, "r": rate}))
    for column in columns(e, REFERENCE):
        moved = np.abs(np.diff(column.path[missing], axis=0)).sum()
        assert (moved == 0.0) == (column.channel == "r"), column


@pytest.mark.parametrize(("by", "channel", "kind"), CASES)
def test_a_repair_undoes_a_fault(by, channel, kind):
    size, true = 0.1, run_with(by)
    faulty = run_with(by, channel, kind, size)
    value = 1.0 + size if kind == "scale" else size
    e = replace(evidence(faulty), psi=faulty.pose[:, 2])
    repaired = corrected(e, Correction({(channel, kind): value}))
    inner = slice(10, -10)  # a delay takes values from beyond the ends
    if kind == "place":  # velocity and yaw rate are then those of the place of the position
        u, v, psi = motion(T)
        r = true.measured["r"]
        moved = (u, v + size * r) if channel == "x" else (u - size * r, v)
        true = replace(true, pose=faulty.pose)
        true.measured.update(zip(by, given_as(by, psi, *moved), strict=True))
    for name in (*by, "r"):
        np.testing.assert_allclose(repaired.measured[name][inner], true.measured[name][inner], atol=2e-4)
    close = 0.02 if kind in DEVIATIONS else 1e-9  # to first order: the law is one of the faulty heading
    np.testing.assert_allclose(repaired.pose, true.pose, atol=close)


def test_a_clock_is_repaired_by_its_line_and_its_jumps():
    run = run_with(PAIRS[0])
    log = np.array([0.0, 40.0, 79.0])
    e = evidence(run)
    (gap,) = gaps(evidence(without(20.0, 5.0)))
    repaired = corrected(e, Correction({}, (log, np.array([1.0, 45.0, 84.0])), [gap]))
    kept = (gap.start >= T) | (gap.end <= T)
    expected = np.where(T < 40.0, 1.0 + 1.1 * T, 45.0 + (T - 40.0))  # beyond the line its slope is 1
    np.testing.assert_allclose(repaired.time, (expected + gap.value * (gap.end <= T))[kept])
    np.testing.assert_array_equal(repaired.pose, run.pose[kept])


def without(start, seconds):
    """A run on a straight course, whose log lacks some seconds (negative: has them twice)."""
    t = np.arange(0.0, 100.0, 0.1)
    true = np.where(t < start, t, t + seconds)
    rng = np.random.default_rng(1)
    pose = np.column_stack([0.5 * true, 0.1 * np.sin(0.2 * true), 0.0 * true])
    u, v = 0.5 + 0.0 * true, 0.02 * np.cos(0.2 * true)
    white = 1e-3 * rng.normal(size=(2, t.size))
    measured = {"u": u + white[0], "v": v + white[1], "r": 1e-4 * rng.normal(size=t.size)}
    return Run(
        "made", t, pose + 1e-4 * rng.normal(size=pose.shape), np.zeros_like(pose), measured=measured
    )


@pytest.mark.parametrize(
    ("elsewhere", "both"),
    [((10.05, 6.0, 12.0), False), ((14.0, 9.0, 19.0), False), ((14.0, 13.0, 15.0), True)],
)
def test_two_estimates_of_a_jump_that_contradict_each_other_are_both_in_its_interval(
    monkeypatch, elsewhere, both
):
    """By its speed ten seconds are missing; by how the ship goes elsewhere it may be more."""
    (alone,) = gaps(evidence(without(50.0, 10.0)))
    monkeypatch.setattr("diagnosis.runs.sensors.gaps._elsewhere", lambda *_: elsewhere)
    (gap,) = gaps(evidence(without(50.0, 10.0)))
    assert gap.value == alone.value
    assert gap.ci95 == ((alone.ci95[0], elsewhere[2]) if both else alone.ci95)


@pytest.mark.parametrize("seconds", [0.8, 3.0, 10.0])
def test_seconds_without_rows_are_found_where_they_are(seconds):
    (gap,) = gaps(evidence(without(50.0, seconds)))
    assert gap.value == pytest.approx(seconds, abs=0.1)
    assert gap.ci95[0] <= seconds <= gap.ci95[1]
    assert gap.start <= 50.0 <= gap.end
    assert gap.end - gap.start < 1.0
    assert "missing in the log near 5" in gap.sentence


def test_a_position_that_returns_a_clean_log_and_one_without_velocity_have_no_gap():
    clean = without(50.0, 0.0)
    assert gaps(evidence(clean)) == []
    spike = clean.pose.copy()
    spike[400:403, 0] += 3.0
    assert gaps(evidence(replace(clean, pose=spike))) == []
    alone = replace(without(50.0, 5.0), measured={"r": clean.measured["r"]})
    assert gaps(evidence(alone)) == []


def test_a_log_whose_clock_runs_ahead_has_seconds_that_never_were():
    clean = without(50.0, 0.0)
    ahead = replace(clean, time=np.where(clean.time < 50.0, clean.time, clean.time + 5.0))
    (gap,) = gaps(evidence(ahead))
    assert gap.value == pytest.approx(-5.0, abs=0.1)
    assert "were never in the log" in gap.sentence


@given(st.floats(-3.1, 3.1), st.floats(0.1, 10.0), st.floats(-3.0, 3.0))
def test_an_arc_is_as_long_as_its_chord_bends(turn, length, course):
    """The chord of an arc that turns by an angle a is sin(a / 2) / (a / 2) of it."""
    chord = length * (2.0 * np.sin(0.5 * turn) / turn if abs(turn) > 1e-6 else 1.0)
    assert _arc(chord * np.array([np.cos(course), np.sin(course)]), np.asarray(turn)) == pytest.approx(
        length
    )
    assert _arc(np.array([3.0, 4.0]), np.asarray(4.0)) == 5.0, "more than a half turn is no bend"


@pytest.mark.parametrize("seconds", [-6.0, 6.0])
def test_the_interval_of_a_jump_has_the_noise_and_the_change_of_the_speed(seconds):
    """u is the mean of the speeds at both ends, and half of what they differ by is in doubt."""
    half = []
    for faster in (1.0, 1.3):
        run = without(50.0, seconds) if seconds > 0.0 else without(50.0, 0.0)
        if seconds < 0.0:
            run = replace(run, time=np.where(run.time < 50.0, run.time, run.time - seconds))
        late = run.time > (50.0 if seconds > 0.0 else 52.0)
        pose, u = run.pose.copy(), run.measured["u"] * np.where(late, faster, 1.0)
        first = int(np.argmax(late))
        pose[late, 0] = pose[first, 0] + (pose[late, 0] - pose[first, 0]) * faster
        (gap,) = gaps(evidence(replace(run, pose=pose, measured=dict(run.measured) | {"u": u})))
        assert gap.ci95[0] < gap.value < gap.ci95[1]
        half.append(gap.ci95[1] - gap.value)
    assert half[1] > half[0]
    if seconds < 0.0:
        assert half[0] < 0.2 * abs(seconds)


def cruising(speeds, turns=0.0):
    """Evidence of a ship whose speed (n,) is known, every second, and that turns evenly."""
    psi = turns * np.arange(speeds.size)
    step = speeds * np.exp(1j * (psi + 0.5 * turns))
    place = np.concatenate([[0.0], np.cumsum(step[:-1])])
    pose = np.column_stack([place.real, place.imag, psi])
    time = np.arange(float(speeds.size))
    return SimpleNamespace(
        rows=np.arange(speeds.size), time=time, psi=psi, run=SimpleNamespace(pose=pose)
    )


@pytest.mark.parametrize("turns", [0.0, 0.02])
@pytest.mark.parametrize("missing", [9.0, 30.0])
def test_a_time_is_possible_if_windows_of_that_length_look_like_the_jump(turns, missing):
    """The speed is nearly even; the jump is one second of the log."""
    speeds = 2.0 + 0.2 * np.sin(0.1 * np.arange(400))
    e = cruising(speeds, turns)
    a, b = 200, 201
    e.psi = e.psi + turns * (missing - 1.0) * (np.arange(400) > a)
    found = _elsewhere(e, speeds, (a, b), missing)
    assert found is not None
    likeliest, shortest, longest = found
    assert shortest <= likeliest <= longest
    assert shortest <= missing <= longest
    assert likeliest == pytest.approx(missing, abs=1.0 + 0.06 * missing)
    assert longest - shortest < 4.0 + 0.4 * missing


def test_nothing_is_known_elsewhere_if_the_ship_is_never_as_fast_or_turns_as_much():
    speeds = np.full(400, 2.0)
    speeds[190:212] = 3.0
    assert _elsewhere(cruising(speeds), speeds, (200, 201), 9.0) is None
    turning = cruising(np.full(400, 2.0))
    turning.psi = turning.psi + 1.0 * (np.arange(400) > 200)
    assert _elsewhere(turning, np.full(400, 2.0), (200, 201), 9.0) is None


@pytest.mark.parametrize("jump", [0.0, 30.0])
def test_a_path_closes_by_what_speed_and_rate_are_off_over_a_window_but_not_over_a_gap(jump):
    speed, off, bias = 0.5, 0.03, 0.002
    t = np.concatenate([np.arange(0.0, 50.0, 0.1), np.arange(60.0, 110.0, 0.1)])
    psi = 0.1 * t
    x, y = speed / 0.1 * np.sin(psi), -speed / 0.1 * np.cos(psi)
    pose = np.column_stack([x + jump * (t > 55.0), y, psi])
    measured = {
        "u": (1.0 + off) * speed + 1e-9 * np.sin(t),
        "v": 1e-9 * np.sin(t),
        "r": 0.1 + bias + 1e-9 * np.sin(t),
    }
    found = closure(Run("made", t, pose, np.zeros_like(pose), measured=measured), 4.0, 8.0)
    assert found.heading == pytest.approx(8.0 * bias, rel=0.02)
    chord = 2.0 * speed / 0.1 * np.sin(0.1 * 4.0 / 2.0)
    assert found.position == pytest.approx(off * chord, rel=0.03)


@pytest.mark.parametrize("by", PAIRS)
def test_speed_in_a_wrong_unit_or_sign_is_named_and_converted(by):
    true = run_with(by)
    knots = replace(
        true,
        measured=dict(true.measured) | {n: true.measured[n] / 0.514444 for n in by if n != "course"},
    )
    found = units(knots, REFERENCE)
    (finding,) = found.findings
    assert finding.value == pytest.approx(1.0 / 0.514444, rel=0.01)
    assert "kn in place of m/s" in finding.sentence
    for name in by:
        np.testing.assert_allclose(found.run.measured[name], true.measured[name], rtol=1e-3)
    degrees = replace(true, measured=dict(true.measured) | {"r": -np.rad2deg(true.measured["r"])})
    found = units(degrees, REFERENCE)
    assert [f.channel for f in found.findings] == ["r"]
    np.testing.assert_allclose(found.run.measured["r"], true.measured["r"], rtol=1e-3)
    assert not units(true, REFERENCE).findings


def test_channels_that_disagree_about_the_motion_are_not_used():
    true = run_with(PAIRS[1])
    other = np.random.default_rng(0).normal(size=(2, T.size))
    found = units(
        replace(true, measured=dict(true.measured) | dict(zip(PAIRS[1], other, strict=True))), REFERENCE
    )
    assert set(found.run.measured) == {"r"}
    assert found.notes == (
        "x_dot and y_dot and the pose disagree about the motion: x_dot and y_dot is not used",
    )


def test_channels_count_from_half_of_the_time_on_and_the_best_pair_goes_first():
    run = run_with(PAIRS[0])
    every = {name: x for by in PAIRS for name, x in run_with(by).measured.items()}
    fewer = np.where(np.arange(T.size) % 4 == 1, every["u"], np.nan)
    more = np.where(np.arange(T.size) % 4, every["u"], np.nan)
    ends, long = (np.where(T[0] + part * np.ptp(T) > T, every["u"], np.nan) for part in (0.4, 0.6))
    for u, by in ((every["u"], 0), (more, 0), (fewer, 0), (long, 0), (ends, 1), (0.0 * T, 1)):
        assert evidence(replace(run, measured=every | {"u": u})).by == PAIRS[by]
    kept = evidence(replace(run, measured=every | {"u": more}))
    np.testing.assert_allclose(kept.velocity[1:], evidence(run).velocity[1:], atol=1e-3)
    assert evidence(replace(run, measured={})) is None
    assert evidence(run.rows(np.arange(T.size) < FEWEST - 1)) is None
    assert evidence(run.rows(np.arange(T.size) < FEWEST)) is not None


@settings(max_examples=20)
@given(st.lists(st.floats(-10.0, 10.0), min_size=3, max_size=3), st.integers(0, 99))
def test_trapezia_are_exact_for_lines(line, seed):
    t = np.sort(np.random.default_rng(seed).uniform(0.0, 9.0, 15))
    a, b, c = line
    found = integral(t, np.column_stack([a + b * t, c + 0.0 * t]))
    np.testing.assert_allclose(
        found, np.column_stack([a * (t - t[0]) + b / 2 * (t**2 - t[0] ** 2), c * (t - t[0])]), atol=1e-9
    )


@settings(max_examples=20)
@given(st.floats(0.1, 10.0), st.floats(-5.0, 5.0))
def test_a_spread_is_that_of_normal_values_wherever_they_are(a, b):
    x = np.random.default_rng(0).normal(size=4001)
    assert spread_of(a * x + b) == pytest.approx(a, rel=0.05)
    legs = np.concatenate([np.full(80, 0.24), np.full(20, 1.0)])
    assert straight(a * legs).tolist() == (legs < 0.25).tolist()
    assert large(-a * legs).tolist() == (legs > 0.5).tolist()


def test_deviations_of_a_fit_are_of_the_jackknife_over_parts_of_the_run():
    rng = np.random.default_rng(3)
    t = np.arange(60.0)
    A = rng.normal(size=(120, 2))
    y = A @ [2.0, -1.0] + 9.0 * rng.normal(size=120)
    value, std = blocked_fit(A, y, t)
    np.testing.assert_allclose(value, np.linalg.pinv(A) @ y)
    part = np.tile(np.arange(60) // 3, 2)
    each = np.array([np.linalg.pinv(A[part != k]) @ y[part != k] for k in range(20)])
    np.testing.assert_allclose(std, np.sqrt(19.0 * each.var(axis=0)))
    few = np.where(np.arange(120) < 3, 1e3, 1.0)[:, None] * A  # which parts of the run tell hardly shows
    np.testing.assert_array_less(0.0, blocked_fit(few, few @ [2.0, -1.0] + 0.01 * y, t)[1])


@settings(max_examples=20)
@given(st.floats(1e-3, 1e3), st.floats(-1e3, 1e3), st.integers(0, 99))
def test_a_deviation_is_in_the_unit_of_its_unknown_and_of_what_is_left(unit, known, seed):
    """Neither the unit of another unknown nor the size of what is explained changes it."""
    rng = np.random.default_rng(seed)
    t, A, e = np.arange(60.0), rng.normal(size=(120, 2)), rng.normal(size=120)
    _, std = blocked_fit(A, e, t)
    value, scaled = blocked_fit(A * [unit, 1.0], A @ [known, 1.0] + e, t)
    np.testing.assert_allclose(scaled, std / [unit, 1.0], rtol=1e-6)
    assert abs(value[0] * unit - known) < 6.0 * std[0] + 1e-9 * abs(known)
    white = np.sqrt(np.diag(np.linalg.inv(A.T @ A)))
    assert (std > 0.6 * white).all(), "of white noise it is that of least squares at the least"


@pytest.mark.parametrize("length", [1.0, 30.0])
def test_faults_matter_from_half_a_percent_on(length):
    e, scale = evidence(run_with(PAIRS[0])), Scale(length)
    least = {f"{c.channel} {c.kind}": c.least for c in columns(e, scale)}
    assert least_place(scale) == pytest.approx(0.005 * 1.105 * length)
    assert least["x place"] == least["y place"] == least_place(scale)
    assert least["u scale"] == least["psi offset"] == least["r scale"] == 0.005
    assert least["r offset"] == pytest.approx(0.005 / (8.0 * length**0.5))
    assert least["u delay"] == least["r delay"] == pytest.approx(STEP / 2.0)
    assert isinstance(e, Evidence)


@pytest.mark.parametrize("given", [(0, 1), (0,), (1,)])
@pytest.mark.parametrize(
    ("size", "current"), [(1.25, (0.03, -0.05)), (1.0, (0.03, -0.05)), (0.8, (0.0, 0.0))]
)
def test_the_speed_through_water_has_one_scale_and_leaves_the_current(given, size, current):
    """u, v over ground are those through the water and the current in the ship's axes."""
    run = run_with(PAIRS[0])
    u, v, psi = motion(T)
    ahead, aside = turned(-psi, *current)
    through = np.stack([u - ahead, v - aside])
    noise = np.random.default_rng(4).normal(size=through.shape)
    names = [further_channels.WATER[k] for k in given]
    water = {name: size * through[k] + 1e-4 * noise[k] for k, name in zip(given, names, strict=True)}
    found = further_channels.through_water(replace(run, measured={**run.measured, **water}), REFERENCE)
    assert [(f.channel, f.kind) for f in found.findings] == [(names[0], "scale")] * (size != 1.0)
    for f in found.findings:
        assert f.value == pytest.approx(size, abs=0.01)
        assert f.ci95[0] < size < f.ci95[1]
    for k, name in zip(given, names, strict=True):
        assert found.run.measured[name] == pytest.approx(through[k], abs=0.01)
    if any(current):
        (note,) = found.notes
        north, east = map(float, re.findall(r"(-?[\d.]+) m/s", note))
        assert (north, east) == pytest.approx(current, abs=2e-3)
    else:
        assert found.notes == ()


def test_without_a_speed_through_water_or_enough_of_it_a_run_is_as_it_was():
    run = run_with(PAIRS[0])
    assert further_channels.through_water(run, REFERENCE).run is run
    few = replace(run, measured={**run.measured, "u_water": np.where(T < 0.25, 0.1, np.nan)})
    assert further_channels.through_water(few, REFERENCE).run is few
