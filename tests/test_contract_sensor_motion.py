"""Clock and constant faults of channels in parts: what a fault adds to a path, and what is said of it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from diagnosis.runs.sensors import motion
from diagnosis.runs.sensors.clock_path import DRIFT, HEADING, TURN, integral_of
from diagnosis.runs.sensors.constants import DEVIATIONS, LEAST, columns, deviations
from diagnosis.runs.sensors.evidence import SURE, Evidence
from diagnosis.runs.sensors.motion import MotionFaults
from diagnosis.runs.sensors.sensor_finding import SensorFinding
from fmus.scale import REFERENCE

TIME = np.linspace(0.0, 20.0, 1001)
PSI = 0.5 * np.sin(0.4 * TIME) + 0.1 * TIME
U, V = 1.0 + 0.3 * np.sin(0.7 * TIME), 0.1 * np.cos(0.9 * TIME)
Z95 = 1.959964


def turned(angle, ahead, aside):
    """(n, 2): a velocity to north and east."""
    at = (ahead + 1j * aside) * np.exp(1j * angle)
    return np.column_stack([at.real, at.imag])


def seen(psi=PSI, velocity=None, rate=None, by=("u", "v"), rows=None, measured=None, time=TIME):
    """The evidence of channels, all with the times of the log."""
    velocity = turned(psi, U, V) if velocity is None else velocity
    rate = np.gradient(psi, time) if rate is None else rate
    run = SimpleNamespace(
        time=time, measured={"r": rate, **(measured or {})}, pose=np.zeros((time.size, 3))
    )
    return Evidence(run, np.arange(time.size) if rows is None else rows, psi, velocity, rate, by, None)


def column(e, channel, kind):
    return next(c for c in columns(e, REFERENCE) if (c.channel, c.kind) == (channel, kind))


def adds(e, faulty, size):
    """(n, 2): what a fault adds to the way, by the ways of the right and of the wrong channels."""
    return (e.gone - faulty.gone) / size


# What one unit of a fault adds to the path


def test_a_scale_makes_the_way_too_long():
    e = seen()
    faulty = seen(velocity=1.001 * e.velocity)
    assert column(e, "u", "scale").path[:, :2] == pytest.approx(adds(e, faulty, 0.001), abs=1e-9)
    faulty = seen(rate=1.001 * e.rate)
    found = column(e, "r", "scale").path
    assert found[:, 2] == pytest.approx((e.turned - faulty.turned) / 0.001, abs=1e-9)
    assert not found[:, :2].any()


@pytest.mark.parametrize(
    ("by", "channel", "sign"),
    [
        (("u", "v"), "psi", 1.0),
        (("x_dot", "y_dot"), "y_dot", -1.0),
        (("speed", "course"), "course", 1.0),
    ],
)
def test_turned_axes_turn_the_way(by, channel, sign):
    """Velocity to north and east that is turned clockwise is one whose axes are turned to port."""
    e, size = seen(by=by), 1e-4
    faulty = seen(by=by, velocity=turned(sign * size, *e.velocity.T))
    found = column(e, channel, "offset").path
    assert found[:, :2] == pytest.approx(adds(e, faulty, size), abs=1e-3)
    assert not found[:, 2].any()


def test_another_place_of_the_position_is_ahead_or_to_starboard():
    e = seen()
    for channel, ahead, aside in (("x", 1.0, 0.0), ("y", 0.0, 1.0)):
        found = column(e, channel, "place")
        assert found.path[:, :2] == pytest.approx(turned(PSI, ahead, aside))
        assert found.clocked is False


def test_a_late_velocity_is_that_of_earlier():
    """In the ship's own axes it is turned by the heading of now."""
    for by in (("u", "v"), ("x_dot", "y_dot")):
        e, late = seen(by=by), 1e-3
        earlier = [np.interp(TIME - late, TIME, x) for x in (U, V)]
        velocity = turned(PSI, *earlier)
        if by != ("u", "v"):
            velocity = np.column_stack([np.interp(TIME - late, TIME, x) for x in e.velocity.T])
        found = column(e, by[0], "delay").path[:, :2]
        # Up to a constant, as the path is.
        wanted = adds(e, seen(by=by, velocity=velocity), late)
        assert found - found[0] == pytest.approx(wanted, abs=5e-3)


def test_faults_of_the_rate_turn_the_heading():
    e = seen()
    offset = (e.turned - seen(rate=e.rate + 0.001).turned) / 0.001
    assert column(e, "r", "offset").path[:, 2] == pytest.approx(offset, abs=1e-9)
    late = np.interp(TIME - 1e-3, TIME, e.rate)
    delay = column(e, "r", "delay").path[:, 2]
    assert delay - delay[0] == pytest.approx((e.turned - seen(rate=late).turned) / 1e-3, abs=1e-3)
    still = seen(by=None)
    none = Evidence(still.run, still.rows, PSI, None, None, None, None)
    assert columns(none, REFERENCE) == deviations(none, PSI) == []


@pytest.mark.parametrize("kind", DEVIATIONS)
def test_a_deviation_of_the_compass_turns_heading_and_way(kind):
    law = {
        "deviation_sin": np.sin(PSI),
        "deviation_cos": np.cos(PSI),
        "deviation_sin_2": 2.0 * np.sin(PSI) * np.cos(PSI),
        "deviation_cos_2": 1.0 - 2.0 * np.sin(PSI) ** 2,
    }[kind]
    size, e = 1e-5, seen()
    measured = turned(PSI + size * law, U, V)
    (found,) = (c for c in deviations(e, e.psi) if c.kind == kind)
    assert found.path[:, 2] == pytest.approx(law)
    assert found.path[:, :2] == pytest.approx(adds(e, seen(velocity=measured), size), abs=1e-3)
    (aside,) = (c for c in deviations(seen(by=("speed", "course")), PSI) if c.kind == kind)
    assert not aside.path[:, :2].any(), "it has a compass of its own"


def test_a_fault_matters_by_what_it_is():
    e = seen(rows=np.arange(0, TIME.size, 10))  # every 0.2 s
    least = {(c.channel, c.kind): c.least for c in columns(e, SimpleNamespace(length=2.0, time=3.0))}
    assert least["u", "scale"] == least["r", "scale"] == least["psi", "offset"] == 0.005
    assert least["u", "delay"] == least["r", "delay"] == pytest.approx(0.1)
    assert least["x", "place"] == least["y", "place"] == pytest.approx(0.005 * 2.0 * 1.105)
    assert least["r", "offset"] == pytest.approx(0.005 / (8.0 * 3.0))


# A clock


def path_of(clock, columns=(), constants=(), deviation=(), seconds=10.0, cut=(), **more):
    """A path with so many steps of so many seconds, whose clock is known to a thousandth."""
    edges = seconds * np.arange(len(clock) + 1)
    at = np.zeros(len(clock), bool)
    at[[*cut]] = True
    problem = SimpleNamespace(edges=edges, cut=at, **more)
    return SimpleNamespace(
        problem=problem, clock=np.array(clock, float), columns=columns, std=np.full(8, 0.01),
        constants=np.array(constants, float), deviation=np.array(deviation, float),
        mean_clock=lambda weights: np.full(len(weights), 0.001),
    )  # fmt: skip


def test_the_clock_is_averaged_over_stretches_of_twenty_seconds():
    found = motion._blocks(path_of([1.0, 1.2, 0.8, 1.0, 1.4]))
    assert found.mean == pytest.approx([1.1, 0.9]), "what is left is no half of a stretch"
    assert found.first.tolist() == [0.0, 20.0]
    assert found.last.tolist() == [20.0, 40.0]
    assert found.std.tolist() == [0.001, 0.001]
    # 50 s in three: what is cut counts nothing.
    found = motion._blocks(path_of([1.0, 1.3, 9.0, 1.0, 1.2, 1.4], cut=[2], seconds=10.0))
    assert found.mean == pytest.approx([1.15, 1.3])
    assert found.first.tolist() == [0.0, 40.0]
    long = motion._blocks(path_of(np.linspace(0.9, 1.1, 640), seconds=10.0))
    assert len(long.mean) == 64, "no more than so many"
    assert long.last - long.first == pytest.approx(100.0)


def test_a_clock_is_uneven_where_it_is_off_its_own_mean():
    assert not motion._uneven(path_of([1.3] * 6))
    assert not motion._uneven(path_of([1.0] * 4 + [1.007] * 2)), "by less than matters"
    assert motion._uneven(path_of([1.0] * 4 + [1.02] * 2))
    noisy = path_of([1.0] * 4 + [1.02] * 2)
    noisy.mean_clock = lambda weights: np.full(len(weights), 0.02 / SURE)
    assert not motion._uneven(noisy), "it may be noise"


def test_stretches_have_the_time_in_which_a_clock_is_off():
    found = motion._stretches(path_of([1.0, 1.0, 1.1, 1.1, 1.1, 1.1, 1.0, 1.0, 0.9, 0.9]))
    assert [f[:3] for f in found] == [
        pytest.approx((20.0, 60.0, 1.1)),
        pytest.approx((80.0, 100.0, 0.9)),
    ]
    assert found[0][3] == pytest.approx(0.001 / np.sqrt(2.0))
    assert motion._stretches(path_of([1.004] * 6)) == []


def fault(channel="u", kind="scale", unit="1", needs="velocity", least=LEAST):
    return motion.FaultColumn(channel, kind, unit, needs, np.zeros((2, 3)), least)


def both(one, other, *deviation):
    """Faults of scale of speed and turn, with a clock that runs evenly."""
    scales = (fault(), fault("r", needs="rate"))
    return MotionFaults(path_of([1.0] * 4, scales, (one, other), deviation), False)


def test_where_speed_and_turn_have_one_scale_the_clock_has_it():
    """Weighted by their variances; a clock that is slow makes all rates too large."""
    assert motion._even(both(0.02, 0.021, 0.001, 0.002)) == pytest.approx(
        (1.0 - (0.02 * 4.0 + 0.021) / 5.0, 0.001 / np.sqrt(1.25))
    )
    assert motion._even(both(0.02, 0.04, 0.001, 0.002)) is None
    assert motion._even(both(0.02, 0.0249, 1e-6, 1e-6)) is not None, "less than matters"
    wide = SURE * np.hypot(0.01, 0.01)
    assert motion._even(both(0.0, 0.999 * wide, 0.01, 0.01)) is not None
    assert motion._even(both(0.0, 1.001 * wide, 0.01, 0.01)) is None
    assert motion._even(both(0.02, 0.021, 0.001, 0.002)._replace(wanders=True)) is None
    alone = MotionFaults(path_of([1.0] * 4, (fault(),), (0.02,), (0.001,)), False)
    assert motion._even(alone) is None


def test_only_what_is_sure_and_matters_is_kept():
    every = (fault("u"), fault("r", least=0.1), fault("x"), fault("y"), fault("psi"))
    path = path_of(
        [1.0] * 4, every, (-0.02, 0.09, 0.0399, 0.0401, 0.02), (0.001, 0.001, 0.01, 0.01, 0.0)
    )
    found = MotionFaults(path, False)
    assert [c.channel for c in motion._sure(found)] == ["u", "y"]
    scattered = found._replace(scatter=np.array([0.0, 0.0, 0.0, 0.001, 0.0]))  # 0.01005 in all
    assert [c.channel for c in motion._sure(scattered)] == ["u"]


def test_an_even_clock_is_one_finding_and_no_scale():
    found = both(0.02, 0.02, 0.001, 0.001)
    (clock,) = motion._clock(found, seen())
    assert (clock.channel, clock.kind, clock.unit, clock.repaired) == ("time", "clock_rate", "1", True)
    assert clock.value == pytest.approx(0.98)
    half = Z95 * 0.001 / np.sqrt(2.0)
    assert clock.ci95 == pytest.approx((0.98 - half, 0.98 + half), rel=1e-4)
    assert (clock.start, clock.end) == (0.0, 40.0)
    assert "0.98 s pass in one second" in clock.sentence
    assert motion._constants(found, seen()) == []
    assert motion._clock(both(0.02, 0.04, 0.001, 0.002), seen()) == []


@pytest.mark.parametrize(
    ("flags", "alike", "aside", "end"),
    [
        ({}, (), (), "in one second of it"),
        ({"either": True}, tuple(DEVIATIONS), (), "an offset of the compass has the same effect"),
        ({"by_way": True}, ("u", "v"), ("u", "v"), "late or wrong by direction has the same effect"),
    ],
)
def test_a_clock_that_wanders_is_a_finding_for_each_stretch(flags, alike, aside, end):
    path = path_of([1.0, 1.0, 1.1, 1.1, 1.0, 1.0, 0.9, 0.9])
    slow, fast = motion._clock(MotionFaults(path, True, **flags), seen())
    assert (slow.start, slow.end, fast.start, fast.end) == (20.0, 40.0, 60.0, 80.0)
    assert "is slow: 1.1 s" in slow.sentence
    assert "is fast: 0.9 s" in fast.sentence
    assert slow.sentence.endswith(end)
    assert (slow.alike, slow.repaired, slow.aside) == (alike, not alike, aside)
    assert slow.ci95 == pytest.approx((1.1 - Z95 * 0.001, 1.1 + Z95 * 0.001), rel=1e-5)


# Constants


def constants_of(e, *values, wanders=False, std=1e-5):
    path = path_of([1.0] * 4, [c for c, _ in values], [x for _, x in values], [0.001] * len(values))
    path.std[:] = std
    return motion._constants(MotionFaults(path, wanders), e)


def test_a_scale_is_that_of_the_measurement():
    """Measured = value times true, where the path by the true speed is (1 - x) times the measured one."""
    (found,) = constants_of(seen(), (fault(), 0.2))
    assert found.value == pytest.approx(1.25)
    assert found.ci95[1] - found.value == pytest.approx(Z95 * 0.001 / 0.8**2, rel=1e-5)
    assert found.sentence == "u and v are 25.0 % too large"
    assert (found.repaired, found.alike, found.aside) == (True, (), ())
    (small,) = constants_of(seen(), (fault(), -0.25))
    assert small.sentence == "u and v are 20.0 % too small"


def test_without_turns_a_scale_may_be_the_clock():
    """Turns tell of the clock where they are far larger than the walk and the noise of the heading."""
    large = SURE * LEAST * np.ptp(PSI)
    for std, sure in ((0.5 * large, True), (2.0 * large, False)):
        path = path_of([1.0] * 4, [fault()], [0.2], [0.001])
        path.std[TURN], path.std[HEADING] = 0.0, std
        (found,) = motion._constants(MotionFaults(path, False), seen())
        assert found.repaired == sure
        path.std[HEADING], path.std[TURN] = 0.0, std / np.sqrt(20.0)
        (found,) = motion._constants(MotionFaults(path, False), seen())
        assert found.repaired == sure
    assert (found.alike, found.aside) == (("clock_rate",), ("u", "v"))
    assert found.sentence.endswith("a clock at this rate has the same effect")
    (wandering,) = motion._constants(MotionFaults(path, True), seen())
    assert wandering.repaired
    no_rate = replace(seen(), rate=None)
    (found,) = constants_of(no_rate, (fault(), 0.2))
    assert (found.repaired, found.aside) == (False, ("u", "v"))


def test_without_a_speed_a_scale_of_the_rate_may_be_the_clock():
    alone = replace(seen(), velocity=None, by=None)
    (found,) = constants_of(alone, (fault("r", needs="rate"), 0.2))
    assert (found.repaired, found.alike, found.aside) == (False, ("clock_rate",), ("r",))
    assert "no speed is measured" in found.sentence
    (found,) = constants_of(alone, (fault("r", needs="rate"), 0.004))
    assert found.repaired, "nearer to one it does no harm"


@pytest.mark.parametrize(
    ("kind", "channel", "unit", "value", "sentence"),
    [
        ("delay", "u", "s", 0.5, "u and v are 0.5 s later than the pose"),
        (
            "delay",
            "r",
            "s",
            -0.25,
            "r is 0.25 s earlier than the heading, so that the heading is probably late",
        ),
        ("place", "x", "m", 2.0, "the position is measured 2 m ahead of the place of the velocity"),
        ("place", "x", "m", -2.0, "the position is measured 2 m aft of the place of the velocity"),
        ("place", "y", "m", 1.5, "the position is measured 1.5 m to starboard of the place of"),
        ("place", "y", "m", -1.5, "the position is measured 1.5 m to port of the place of"),
        ("offset", "psi", "rad", 0.1, "psi and the axes of the velocity differ by 5.73°"),
        ("offset", "r", "rad/s", 0.01, "r is 0.573°/s too large"),
        ("deviation_sin", "psi", "rad", 0.1, "psi is 5.73° times sin ψ too large"),
        ("deviation_cos_2", "psi", "rad", 0.1, "psi is 5.73° times cos 2 ψ too large"),
    ],
)
def test_a_fault_is_said_with_its_size(kind, channel, unit, value, sentence):
    (found,) = constants_of(seen(), (fault(channel, kind, unit), value))
    assert found.sentence.startswith(sentence)
    assert (found.value, found.unit, found.repaired) == (value, unit, True)


def test_speed_and_course_are_channels_of_their_own():
    e = seen(by=("speed", "course"))
    assert motion._late("speed", 0.5, e) == "speed is 0.5 s later than the pose"
    assert motion._channels("x_dot", seen(by=("x_dot", "y_dot"))) == ("x_dot and y_dot", "are")
    assert motion._channels("y_dot", seen(by=("x_dot", "y_dot"))) == ("y_dot", "is")


# Delays that are taken off in steps


@given(st.floats(0.01, 1.0), st.sampled_from([-1.0, 1.0]), st.floats(0.1, 1.0))
def test_a_step_is_halved_where_the_last_one_went_too_far(size, side, share):
    delay, same, back = side * size, 0.3 * side, -0.3 * side
    assert motion._step(delay, same, share) == (share * delay, share)
    assert motion._step(delay, 0.0, share) == (share * delay, share)
    assert motion._step(delay, back, share) == (0.5 * share * delay, 0.5 * share)


def finding(channel, kind, value, half=0.1, start=0.0, end=1.0):
    ends = (value - half, value + half)
    return SensorFinding(channel, kind, value, "s", ends, start, end, f"{channel} {kind}")


def test_a_delay_is_what_was_taken_off_and_what_is_left():
    moved = motion._moved(finding("u", "delay", 0.5), 0.3)
    assert (moved.value, moved.ci95) == (0.3, pytest.approx((0.2, 0.4)))
    late = [finding("u", "delay", 0.5), finding("r", "delay", 0.3)]
    rest = [finding("u", "delay", 0.25), finding("r", "delay", -0.25), finding("r", "scale", 1.1)]
    scale, found = motion._added(late, rest, seen())
    assert scale is rest[2]
    assert (found.channel, found.value, found.ci95) == ("u", 0.75, pytest.approx((0.65, 0.85)))
    assert found.sentence == "u and v are 0.75 s later than the pose"
    # That of r, 0.05 s and between -0.05 and 0.15 s, is none.
    assert [f.value for f in motion._added(late[:1], [], seen())] == [0.5]


# What is repaired


def test_a_repair_has_the_constants_and_an_even_clock():
    path = path_of([1.3, 1.3, 0.7, 0.7])
    fixes = [finding("time", "clock_rate", 0.98), finding("u", "scale", 1.1)]
    found = motion._correction(MotionFaults(path, False), [], fixes)
    assert found.values == {("u", "scale"): 1.1}
    log, true = found.clock
    assert log.tolist() == [0.0, 10.0, 20.0, 30.0, 40.0]
    assert true == pytest.approx(0.98 * log)
    none = motion._correction(MotionFaults(path, False), [], fixes[1:])
    assert none.clock == ()


@pytest.mark.parametrize("aside", [{}, {"either": True}, {"by_way": True}])
def test_a_clock_that_wanders_is_repaired_where_nothing_else_looks_like_it(aside):
    path = path_of([1.3, 1.3, 0.7, 0.7], cut=[1])
    path.problem.edges = path.problem.edges + 5.0
    found = motion._correction(MotionFaults(path, True, **aside), [], [])
    if aside:
        assert found.clock == ()
        return
    assert found.clock[1] == pytest.approx([5.0, 18.0, 28.0, 35.0, 42.0]), (
        "a step that is cut is as it was"
    )
    jump = finding("time", "clock_gap", 7.0)
    even = motion._correction(MotionFaults(path, False), [jump], [])
    assert even.clock[1] == pytest.approx(even.clock[0])
    assert even.gaps == [jump]


@settings(max_examples=20)
@given(st.lists(st.floats(-0.5, 1.5), min_size=3, max_size=8))
def test_true_time_adds_up_and_never_falls(clock):
    edges = np.cumsum([2.0, *np.linspace(0.5, 1.5, len(clock))])
    true = integral_of(edges, np.array(clock))
    assert true[0] == 0.0
    assert (np.diff(true) > 0.0).all()
    whole = np.concatenate([[0.0], np.cumsum(np.array(clock) * np.diff(edges))])
    assert true == pytest.approx(np.maximum.accumulate(whole), abs=1e-4)


# Notes


def legs(angle, noise=0.0, rate=0.2):
    """A ship on straight legs with turns between, that drifts."""
    rng, n = np.random.default_rng(4), TIME.size
    turning = np.where(np.arange(n) % 100 < 25, rate, 0.0)
    v = np.tan(angle + noise * rng.standard_normal(n))
    return seen(rate=turning, measured={"u": np.ones(n), "v": v})


def test_drift_on_straight_legs_is_a_note():
    (note,) = motion._leeway(legs(0.1))
    assert note.startswith("on straight legs the ship drifts 5.7° to one side")
    assert motion._leeway(legs(0.004)) == (), "it matters nowhere"
    assert motion._leeway(legs(-0.006)) != ()
    assert motion._leeway(legs(0.1, noise=0.2)) == ()
    assert motion._leeway(replace(legs(0.1), by=("speed", "course"))) == ()
    assert motion._leeway(replace(legs(0.1), rate=None)) == ()
    few = replace(legs(0.1), rows=np.arange(0, TIME.size, 100))
    assert motion._leeway(few) == ()


def test_channels_that_agree_have_the_noise_of_a_sampling_period():
    path = path_of([1.0] * 4)
    path.std[DRIFT], path.std[TURN] = 0.03, 0.05
    e = seen(rows=np.arange(0, TIME.size, 25))  # every 0.5 s
    found = motion._agreeing(MotionFaults(path, False), e)
    assert found == pytest.approx({"u": 0.03 / 0.5**0.5, "v": 0.03 / 0.5**0.5, "r": 0.05 / 0.5**0.5})
    by_course = motion._agreeing(
        MotionFaults(path, False), replace(e, by=("speed", "course"), rate=None)
    )
    assert by_course == pytest.approx({"speed": 0.03 / 0.5**0.5})


@pytest.mark.parametrize("held", [1, 4])
def test_speeds_up_to_which_channels_are_noise_are_three_of_its_deviations(held):
    """Of both velocities together, whatever the motion and however often a value repeats; else 0."""
    rng, n = np.random.default_rng(3), 4000
    time = 0.02 * np.arange(n)
    white = rng.normal(size=(n, 3)).repeat(held, axis=0)[:n] * [0.03, 0.04, 0.002]
    e = seen(0.0 * time, white[:, :2], white[:, 2], time=time)
    assert e.still == pytest.approx((3.0 * 0.05, 3.0 * 0.002), rel=0.1)
    assert replace(e, velocity=None).still == (0.0, e.still[1])
    assert replace(e, rate=None).still == (e.still[0], 0.0)
    assert replace(e, rate=white[: 19 * held, 2]).still[1] == 0.0, "too few to tell"
    assert replace(e, rate=white[: 20 * held, 2]).still[1] > 0.0


@pytest.mark.parametrize(("more", "torn"), [(0.99, False), (1.01, True)])
def test_two_clocks_differ_by_more_than_noise_and_half_of_what_a_clock_changes(monkeypatch, more, torn):
    """Each is that of channels with faults of their own; a scale of the speed is the mean of the way's clock."""
    rng, asked = np.random.default_rng(11), []
    way_std, turn_std = rng.uniform(0.01, 0.03, (2, 12))
    weight = 1.0 / (way_std**2 + turn_std**2)
    apart, changes = rng.normal(0.0, 0.1, (2, 12))
    apart, changes = (x - (weight * x).sum() / weight.sum() for x in (apart, changes))
    needed = 12.0 + 0.5 * (weight * changes**2).sum()
    apart *= np.sqrt(more * needed / (weight * apart**2).sum())
    means = iter([1.3 + 1.5 * apart, 0.9 + 0.5 * apart, 1.1 + changes])
    stds = iter([way_std, turn_std, way_std])

    class Problem:
        def __init__(self, e, *rest):
            self.e, self.rest = e, rest

        def solve(self, own):
            asked.append((self.e, self.rest, own))

    monkeypatch.setattr(motion, "PathProblem", Problem)
    monkeypatch.setattr(
        motion, "_blocks", lambda path: SimpleNamespace(mean=next(means), std=next(stds))
    )
    e = seen()
    problem = SimpleNamespace(evidence=e, noise=(0.1, 0.2), gaps=[(3.0, 4.0)], without=frozenset({7}))
    path = SimpleNamespace(problem=problem, columns=[*columns(e, REFERENCE), *deviations(e, e.psi)])
    assert motion._two_clocks(path) is torn
    (way, *given), (turn, *other) = asked
    assert (way.rate, turn.velocity, turn.by) == (None, None, None)
    assert way.velocity is e.velocity
    assert turn.rate is e.rate
    assert given[0] == other[0] == ((0.1, 0.2), [(3.0, 4.0)], frozenset({7}))
    of_way, of_turn = ({(c.needs, c.kind) for c in own} for own in (given[1], other[1]))
    assert {needs for needs, _ in of_way} == {"velocity"}
    assert "scale" not in {kind for _, kind in of_way}
    assert {needs for needs, _ in of_turn} == {"rate"}
    assert "scale" in {kind for _, kind in of_turn}
    for part in ("rate", "velocity"):
        alone = SimpleNamespace(problem=SimpleNamespace(evidence=replace(e, **{part: None})), columns=[])
        assert motion._two_clocks(alone) is False, "one alone contradicts nothing"


@pytest.mark.parametrize(
    ("found", "taken"),
    [
        ([0.3], [0.3]),
        ([-0.3], [-0.3]),
        ([0.4, 0.02], [0.4, 0.02]),
        ([0.4, -0.1, 0.02], [0.4, -0.05, 0.005]),
        ([-0.4, 0.1], [-0.4, 0.05]),
    ],
)
def test_of_a_delay_all_is_taken_at_first_and_half_after_each_step_back(monkeypatch, found, taken):
    """What is found after each step is the rest; it ends when nothing is left."""
    left, corrections = iter([*found, 0.0]), []

    def constants(_, e):
        delay = next(left)
        return [finding("u", "delay", delay, 1e-3)] if delay else []

    nothing = {"evidence": seen, "gaps": [], "columns": [], "_clock": [], "_leeway": [], "_agreeing": {}}
    for name, value in nothing.items():
        monkeypatch.setattr(motion, name, lambda *_, v=value: v() if callable(v) else v)
    monkeypatch.setattr(motion, "_estimated", lambda *_: SimpleNamespace(torn=False))
    monkeypatch.setattr(motion, "_constants", constants)
    monkeypatch.setattr(motion, "corrected", lambda e, c: corrections.append(c.values) or "repaired")
    examined = motion.motion("run", REFERENCE)
    assert [values["u", "delay"] for values in corrections] == pytest.approx(taken)
    assert examined.run == "repaired"
    (whole,) = examined.findings
    assert whole.value == pytest.approx(sum(taken))
