"""A part that was cut out of a log is a gap, though the stamps go on; false samples are none."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.measured import changed, sail

from diagnosis.runs import prepare
from diagnosis.runs.position_jumps import parted

CUT = 20.0  # s, that are left out


def ahead(t):
    """tau [N, N, N m] of a ship that winds ahead."""
    return np.column_stack([1.0 + 0.0 * t, 0.1 * np.sin(0.3 * t), 0.04 * np.sin(0.2 * t)])


@cache
def whole():
    """A run of 70 s of which nothing is cut out."""
    return sail(70.0, given=ahead)[0]


def without(run, begin, length):
    """A run without some seconds of it, whose stamps go on."""
    run = run.rows((run.time < begin) | (run.time >= begin + length))
    return replace(run, time=np.where(run.time < begin, run.time, run.time - length))


def test_a_part_that_was_cut_out_is_a_gap_and_no_sample_is_a_spike():
    cut = without(whole(), 30.0, CUT)
    track = prepare(cut).track
    behind = cut.time >= 30.0
    gaps = track.run.time - cut.time
    assert np.all(gaps[~behind] == 0.0)
    assert np.ptp(gaps[behind]) < 1e-9
    assert gaps[-1] == pytest.approx(CUT, rel=0.5), "what the highest speed needs"
    assert any("jumps" in note and "30 s" in note for note in track.notes)
    assert prepare(cut).smoothed.counts.spikes == 0


def test_the_motion_beside_the_gap_is_that_of_the_whole_run():
    both = prepare(whole()).smoothed, prepare(without(whole(), 30.0, CUT)).smoothed
    before = [smoothed.nu[smoothed.time < 28.0] for smoothed in both]
    np.testing.assert_allclose(before[0][50:], before[1][50:], atol=5e-3)


@given(st.floats(0.0, 6.28), st.integers(-500, 500), st.sampled_from([1, 3, 5]))
def test_it_depends_neither_on_the_place_nor_on_the_rate(turned, away, every):
    run = without(whole(), 30.0, CUT)
    c, s = np.cos(turned), np.sin(turned)
    pose = np.column_stack(
        [
            run.pose[:, 0] * c - run.pose[:, 1] * s + away,
            run.pose[:, 0] * s + run.pose[:, 1] * c,
            run.pose[:, 2],
        ]
    )
    few = np.arange(run.time.size) % every == 0
    moved = replace(run, pose=pose).rows(few)
    gaps = [parted(each).time[-1] - each.time[-1] for each in (run, moved)]
    assert gaps[0] > 0.0
    assert gaps[1] == pytest.approx(gaps[0], rel=0.05)


@given(st.integers(1, 400), st.floats(1.0, 100.0))
def test_samples_that_are_somewhere_else_for_a_while_make_no_gap(many, metres):
    there = slice(1000, 1000 + many)
    run = changed(whole(), there, whole().pose[there] + np.array([metres, 0.0, 0.0]))
    assert np.array_equal(parted(run).time, run.time)


@given(st.integers(50, 300), st.floats(2.0, 20.0), st.floats(0.0, 0.2))
def test_a_tracker_that_lost_the_ship_for_a_while_makes_no_gap(many, metres, wandered):
    """What it sees meanwhile wanders: the step back is smaller, and may be none of a jump's size."""
    there, run = slice(1000, 1000 + many), whole()
    off = metres * np.linspace(1.0, 1.0 - wandered, many)[:, None] * [1.0, 0.0, 0.0]
    assert np.array_equal(parted(changed(run, there, run.pose[there] + off)).time, run.time)


def test_a_run_without_a_jump_stays():
    assert np.array_equal(parted(whole()).time, whole().time)
    assert parted(whole()).notes == whole().notes


def test_a_receiver_that_begins_anew_parts_the_run_too():
    later = whole().time >= 40.0
    run = replace(whole(), pose=whole().pose + np.outer(later, [50.0, -50.0, 0.0]))
    found = parted(run)
    assert np.ptp(np.diff(found.time)[np.flatnonzero(later)[0] :]) < 1e-9
    assert "jumps by 70.7 m" in found.notes[-1]


def test_a_coordinate_that_was_stuck_is_no_jump():
    pose = whole().pose.copy()
    pose[1000:1500, 0] = pose[999, 0]
    assert np.array_equal(parted(replace(whole(), pose=pose)).time, whole().time)
