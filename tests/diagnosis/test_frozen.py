"""Channels that are frozen: which values repeat by noise, by rounding, or because nothing was measured."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis import Run
from diagnosis.runs.frozen import goes_straight, repeated, stuck, without_frozen
from diagnosis.runs.run_constants import IN_A_ROW, LONG

TIME = np.arange(0.0, 100.0, 0.25)
N = TIME.size


def wandering(**changes):
    """A run that moves on both axes, with noise."""
    rng = np.random.default_rng(1)
    pose = np.column_stack([0.3 * TIME, 0.2 * TIME, 0.01 * TIME]) + 1e-3 * rng.standard_normal((N, 3))
    return replace(Run("made", TIME, pose, np.zeros((N, 3))), **changes)


def frozen(run, k, first, last):
    pose = run.pose.copy()
    pose[first : last + 1, k] = pose[first, k]
    return replace(run, pose=pose)


EVERY = np.ones(N, bool)


@given(st.lists(st.tuples(st.integers(0, 2), st.integers(0, 1), st.booleans()), min_size=1))
def test_a_pose_repeats_if_all_its_channels_are_the_last_ones_that_were_there(rows):
    pose, there = np.array([row[:2] for row in rows], float), np.array([row[2] for row in rows])
    found, last = repeated(pose, there), None
    for k, (*values, known) in enumerate(rows):
        assert found[k] == (known and values == last)
        last = values if known else last


@pytest.mark.parametrize("k", [0, 1])
@pytest.mark.parametrize("first", [0, 100])
def test_one_coordinate_that_stands_still_and_jumps_is_frozen_after_its_first_row(k, first):
    found, (line,) = stuck(frozen(wandering(), k, first, first + 40), EVERY)
    assert np.flatnonzero(found).tolist() == [*range(first + 1, first + 41)]
    assert line.startswith(f"{'xy'[k]} is frozen for 10 s, {TIME[first]:.3g} s from the start")


def test_time_counts_from_the_start_of_the_run_and_rows_that_were_not_seen_are_left_out():
    run = frozen(wandering(time=TIME + 50.0), 1, 100, 140)
    seen = np.arange(N) % 2 == 0
    found, (line,) = stuck(run, seen)
    assert np.flatnonzero(found).tolist() == [*range(102, 141, 2)]
    assert line.startswith("y is frozen for 10 s, 25 s from the start")


@pytest.mark.parametrize(("rows", "stated"), [(IN_A_ROW, True), (IN_A_ROW - 1, False)])
def test_noise_does_not_repeat_so_often(rows, stated):
    assert stuck(frozen(wandering(), 0, 100, 100 + rows), EVERY)[0].any() == stated


def test_a_ship_that_goes_on_from_where_it_stood_was_not_frozen():
    """The jump at the end is no larger than steps elsewhere."""
    run = frozen(wandering(), 0, 100, 140)
    pose = run.pose.copy()
    pose[141:, 0] -= pose[141, 0] - pose[140, 0] - 1e-3
    assert not stuck(replace(run, pose=pose), EVERY)[0].any()
    pose[141:, 0] += 5.0
    assert stuck(replace(run, pose=pose), EVERY)[0].any()


def test_at_the_end_it_is_frozen_where_it_moved_before_and_is_not_rounded():
    run = frozen(wandering(), 0, 350, N - 1)
    found, _ = stuck(run, EVERY)
    assert np.flatnonzero(found).tolist() == [*range(351, N)]
    assert not stuck(replace(run, resolution=np.full((N, 3), 1e-3)), EVERY)[0].any()
    always = frozen(wandering(), 0, 0, N - 1)
    assert not stuck(always, EVERY)[0].any(), "it never moved"


@pytest.mark.parametrize(("share", "stated"), [(1.4, False), (1.6, True)])
def test_a_jump_by_rounding_is_no_measurement_after_a_freeze(share, stated):
    """A number that is rounded jumps by one step or, with noise, by one and a half."""
    run = frozen(wandering(), 0, 100, 140)
    pose = run.pose.copy()
    pose[141:, 0] += pose[140, 0] + 1.0 - pose[141, 0]
    coarse = np.zeros((N, 3))
    coarse[140, 0] = 1.0 / share
    coarse[141] = 1.0 / share
    assert stuck(replace(run, pose=pose, resolution=coarse), EVERY)[0].any() == stated


def test_a_coordinate_that_is_always_updated_so_rarely_is_not_frozen():
    run = wandering(resolution=np.full((N, 3), 1e-6))
    pose = run.pose.copy()
    pose[:, 0] = np.arange(N) // 150
    assert not stuck(replace(run, pose=pose), EVERY)[0].any()


def test_a_heading_that_stands_still_is_no_matter_of_the_place():
    found, lines = stuck(frozen(wandering(), 2, 100, 140), EVERY)
    assert not found.any()
    assert not lines


# Channels in addition to the pose


def with_speed(first=100, count=None, pose=None):
    """A run whose speed is constant to the bit over some rows."""
    rng = np.random.default_rng(2)
    u = 0.3 + 0.1 * rng.standard_normal(N)
    count = round(LONG * IN_A_ROW) + 1 if count is None else count
    u[first : first + count] = u[first]
    return wandering(measured={"u": u}, **({} if pose is None else {"pose": pose})), count


def test_a_constant_channel_counts_in_its_first_row_alone():
    run, count = with_speed()
    found = without_frozen(run)
    missing = ~np.isfinite(found.measured["u"])
    assert np.flatnonzero(missing).tolist() == [*range(101, 100 + count)]
    (note,) = found.notes
    assert note.startswith(f"u is constant for {0.25 * (count - 1):.3g} s, 25 s from the start")
    assert np.isfinite(run.measured["u"]).all(), "the run itself is as it was"
    later = without_frozen(replace(run, time=TIME + 7.0))
    assert later.notes == found.notes


def test_a_channel_of_the_usual_length_is_as_it_was():
    run, _ = with_speed(count=round(LONG * IN_A_ROW))
    assert without_frozen(run) is run
    held = replace(run, measured={"u": np.repeat(np.arange(N // 50 + 1.0), 50)[-N - 1 :]})
    assert without_frozen(held) is held, "it is as slow as that everywhere"


def test_of_two_values_the_one_that_stays_is_frozen():
    u = np.full(N, 0.3)
    u[0] = 0.2
    (note,) = without_frozen(wandering(measured={"u": u})).notes
    assert note.startswith("u is constant for 99.5 s, 0.25 s from the start")


def test_a_ship_at_rest_may_have_a_constant_speed():
    rng = np.random.default_rng(3)
    still = 1e-3 * rng.standard_normal((N, 3))
    run, _ = with_speed(pose=still)
    assert without_frozen(run) is run
    wrapped = still.copy()
    wrapped[:, 2] = np.where(np.arange(N) % 3, np.pi, -np.pi) + still[:, 2]
    assert not without_frozen(replace(run, pose=wrapped)).notes, (
        "a heading that goes round does not move"
    )


def test_rows_without_a_value_do_not_end_a_stretch():
    run, count = with_speed(count=round(1.2 * LONG * IN_A_ROW))
    u = np.array(run.measured["u"])
    u[102 : 100 + count : 10] = np.nan
    assert len(without_frozen(replace(run, measured={"u": u})).notes) == 1
    nothing = replace(run, measured={"u": np.full(N, np.nan)})
    assert without_frozen(nothing) is nothing


def test_a_channel_of_which_little_pose_is_known_is_as_it_was():
    run, count = with_speed()
    pose = run.pose.copy()
    pose[100 : 100 + count] = np.nan
    pose[100 : 100 + IN_A_ROW] = run.pose[100 : 100 + IN_A_ROW] * [30.0, 1.0, 1.0]
    unknown = replace(run, pose=pose)
    assert without_frozen(unknown) is unknown


@pytest.mark.parametrize(
    ("noise", "decimals", "seconds", "straight"),
    [
        (0.0, 12, 50.0, True),
        (0.0, 3, 50.0, True),
        (1e-3, 12, 50.0, False),
        (5e-3, 3, 50.0, False),
        (0.0, 12, 2.0, False),
    ],
)
@pytest.mark.parametrize("course", [0.0, 0.7])
def test_a_heading_that_repeats_on_a_straight_way_without_noise_is_measured(
    noise, decimals, seconds, straight, course
):
    """With noise, of positions that are not on a line to their last digit, it may be one that is held."""
    run = wandering()
    way = 0.3 * TIME[:, None] * [np.cos(course), np.sin(course)]
    place = way + noise * np.random.default_rng(2).standard_normal((N, 2))
    pose = np.column_stack([np.round(place, decimals), run.pose[:, 2]])
    held = np.abs(TIME - 20.0 - 0.5 * seconds) < 0.5 * seconds
    pose[held, 2] = pose[np.argmax(held), 2]
    rounded = np.full((N, 3), 10.0**-decimals if decimals < 12 else 0.0)
    found = goes_straight(replace(run, pose=pose, resolution=rounded), EVERY, held, 3.0)
    assert np.array_equal(found, held & straight)


def test_a_heading_is_held_where_the_ship_turns_or_rests():
    held = TIME > 20.0
    turning = np.column_stack([10.0 * np.sin(0.02 * TIME), 10.0 * np.cos(0.02 * TIME), 0.0 * TIME])
    for pose in (turning, np.ones((N, 3))):
        assert not goes_straight(wandering(pose=pose), EVERY, held, 3.0).any()
