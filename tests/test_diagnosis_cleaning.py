"""Judging samples: what was put in is found and counted, and what cannot be used is refused."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.measured import NOISE, changed, sail

from diagnosis import InputError, clean
from diagnosis.runs import prepare
from diagnosis.runs.cleaning import noise, unwrap
from diagnosis.runs.row_order import continued, in_bursts, in_order, ordered

N = 1200


@cache
def base():
    """The run that is varied."""
    return sail(24.0)[0]


def test_a_sound_run_is_used_as_it_is():
    track = clean(base())
    assert tuple(track.counts()) == (N, 0, 0, 0, N)
    assert track.notes == ()
    assert track.period == pytest.approx(0.02)
    np.testing.assert_array_equal(track.pose[:, :2], base().pose[:, :2])
    turns = (track.pose[:, 2] - base().pose[:, 2]) / (2.0 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert np.abs(np.diff(track.pose[:, 2])).max() < 0.1
    assert np.abs(turns).max() >= 1.0, "the heading has wrapped"


def test_every_fault_is_counted_exactly():
    run = changed(base(), slice(100, 120), base().pose[99])
    run = changed(run, slice(300, 307), np.nan)
    run = changed(run, slice(400, 403), 0.0)
    run = changed(run, 500, (np.inf, 1.0, 1.0))
    run = changed(run, slice(600, 605), (1.0, 2.0, np.nan))
    track = clean(run)
    assert tuple(track.counts()) == (N, 24, 11, 0, N - 35)  # a position without a heading is one
    assert np.flatnonzero(track.frozen).tolist() == [*range(100, 120), *range(601, 605)]
    assert not track.fresh[300:307].any()
    assert np.array_equal(np.isfinite(track.pose), track.fresh)
    assert np.flatnonzero(track.valid & ~track.fresh[:, 2]).tolist() == [600]


def test_freeze_with_a_dropout_in_it_is_one_freeze():
    run = changed(base(), slice(100, 120), base().pose[99])
    run = changed(run, 110, np.nan)
    assert tuple(clean(run).counts())[:3] == (N, 19, 1)


def test_one_channel_that_repeats_is_no_freeze():
    pose = base().pose[200].copy()
    pose[:2] = base().pose[199, :2]
    assert clean(changed(base(), 200, pose)).counts().frozen == 0


def test_time_stamps_that_repeat_or_go_backwards_are_left_out():
    time = base().time.copy()
    time[300] = time[299]
    time[500] = 3.0
    time[700] = np.nan
    time[900] = 1e9
    track = clean(replace(base(), time=time))
    assert tuple(track.counts()) == (N, 0, 4, 0, N - 4)
    assert (np.diff(track.run.time) > 0.0).all()
    assert "4 rows left out" in track.notes[0]


def moving():
    t = base().time
    return replace(base(), pose=np.column_stack([0.1 * t, 0.02 * t, 0.01 * t]))


@pytest.mark.parametrize("seconds", [0.5, 1.0, 7.0])
def test_a_clock_that_was_set_back_goes_on(seconds):
    run, later = moving(), np.arange(N) >= 700
    mended = continued(replace(run, time=run.time - seconds * later))
    np.testing.assert_allclose(mended.time, run.time, atol=1e-9)
    assert f"set back by {seconds:.4g} s" in mended.notes[-1]


@pytest.mark.parametrize("began", [100.0, 4.3e6])
@pytest.mark.parametrize("anew", [0.0, 1.0])
def test_a_clock_that_began_anew_goes_on(began, anew):
    """After a restart, or a counter's last number, no time was there before."""
    run, later = moving(), np.arange(N) >= 700
    stamps = np.where(later, run.time - run.time[700] + anew, run.time + began)
    mended = ordered(replace(run, time=stamps))
    assert mended.left_out == 0
    np.testing.assert_allclose(mended.time - began, run.time, atol=1e-6)
    elsewhere = replace(run, time=stamps, pose=run.pose + later[:, None] * [5.0, 0.0, 0.0])
    gap = np.diff(ordered(elsewhere).time)[699]
    assert gap > 8.0, "nothing is predicted across"


def test_rows_that_come_late_are_no_clock_and_are_sorted():
    """A packet that came late has times of its own, which tell its place."""
    run = moving()
    order = np.r_[0:500, 520:540, 500:520, 540:N]
    late = run.rows(order)
    assert continued(late) is late
    mended = ordered(late)
    np.testing.assert_array_equal(mended.time, run.time)
    np.testing.assert_array_equal(mended.pose, run.pose)
    assert "sorted by their stamps" in mended.notes[-1]


def test_rows_of_a_shuffled_file_are_all_used():
    run = base().rows(np.random.default_rng(0).permutation(N))
    mended = ordered(run)
    np.testing.assert_array_equal(mended.pose, base().pose)
    np.testing.assert_array_equal(mended.tau_cmd, base().tau_cmd)
    assert prepare(run).smoothed.counts.samples == N, "no row is lost on the way to the smoother"


def test_a_file_with_the_newest_row_first_is_read():
    mended = ordered(base().rows(np.arange(N)[::-1]))
    np.testing.assert_array_equal(mended.time, base().time)
    np.testing.assert_array_equal(mended.pose, base().pose)


def test_rows_that_are_all_there_twice_are_left_out_once():
    mended = ordered(base().rows(np.repeat(np.arange(N), 2)))
    np.testing.assert_array_equal(mended.pose, base().pose)
    assert mended.left_out == N


def test_a_wrong_stamp_does_not_move_its_row():
    """Where the ship would jump to its place in time and back, the stamp is at fault."""
    time = base().time.copy()
    time[500] = 3.001
    mended = ordered(replace(base(), time=time))
    assert mended.left_out == 1
    np.testing.assert_array_equal(mended.time, np.delete(base().time, 500))


def test_a_second_run_in_the_file_follows_after_a_gap():
    run = moving()
    again = replace(run, time=np.r_[run.time[:700], run.time[: N - 700]])
    elsewhere = replace(again, pose=run.pose + (np.arange(N) >= 700)[:, None] * [5.0, 0.0, 0.0])
    mended = continued(elsewhere)
    np.testing.assert_array_equal(mended.time[:700], run.time[:700])
    np.testing.assert_allclose(np.diff(mended.time[700:]), np.diff(run.time[: N - 700]), atol=1e-9)
    assert mended.time[700] - mended.time[699] > 8.0, "nothing is predicted across"
    assert "a second run begins in row 701" in mended.notes[-1]
    assert ordered(elsewhere).left_out == 0


def test_samples_of_a_clock_that_is_coarser_than_the_rows_are_all_used():
    coarse = replace(base(), time=np.floor(base().time / 0.04 + 1e-6) * 0.04)
    mended = ordered(coarse)
    np.testing.assert_allclose(mended.time, base().time, atol=1e-9)
    assert mended.left_out == 0
    assert prepare(coarse).smoothed.counts.samples == N
    assert "2 samples each" in mended.notes[-1]


def test_messages_of_one_instant_are_one_row():
    """Position and heading in rows of their own, as logs of messages have them."""
    run = base()
    place, heading = run.pose.copy(), run.pose.copy()
    place[:, 2], heading[:, :2] = np.nan, np.nan
    both = np.stack([place, heading], axis=1).reshape(-1, 3)
    messages = replace(run.rows(np.repeat(np.arange(N), 2)), pose=both)
    mended = ordered(messages)
    np.testing.assert_array_equal(mended.pose, run.pose)
    np.testing.assert_array_equal(mended.time, run.time)
    assert mended.left_out == 0


def test_rows_that_are_lost_are_counted_and_too_many_are_refused():
    """Whatever checks come before the cleaning, it states how many rows it did without."""
    twice = base().rows(np.repeat(np.arange(N), np.where(np.arange(N) % 20 == 0, 2, 1)))
    assert prepare(twice).smoothed.counts.dropped == N // 20
    time = base().time.copy()
    time[::5] = 0.0
    with pytest.raises(InputError, match="time does not increase"):
        prepare(replace(base(), time=time))


def test_empty_rows_at_the_end_are_no_reason_to_refuse():
    """A spreadsheet may end in as many as it likes."""
    run = base()
    empty = np.full((N, 3), np.nan)
    longer = run.rows(np.tile(np.arange(N), 2))
    time, pose = np.append(run.time, np.full(N, np.nan)), np.vstack([run.pose, empty])
    nothing = {name: np.append(x, np.full(N, np.nan)) for name, x in run.measured.items()}
    found = ordered(replace(longer, time=time, pose=pose, measured=nothing))
    np.testing.assert_array_equal(found.time, run.time)
    np.testing.assert_array_equal(found.pose, run.pose)
    assert found.left_out == N


@pytest.mark.parametrize("every", [2, 3, 4])
def test_rows_that_straight_lines_have_filled_are_no_measurements(every):
    """The heading is measured in every row, the position in some of them alone."""
    run, rows = base(), np.arange(0, N, every)
    rows = np.append(rows, N - 1)
    pose = run.pose.copy()
    pose[:, :2] = np.column_stack([np.interp(run.time, run.time[rows], x[rows]) for x in run.pose.T[:2]])
    track = clean(replace(run, pose=pose))
    assert np.flatnonzero(track.valid).tolist() == rows.tolist()
    assert (track.between == ~track.valid).all()
    assert tuple(track.counts()) == (rows.size, 0, 0, 0, rows.size)
    assert track.period == pytest.approx(every * 0.02)
    assert "linearly interpolated" in track.notes[0]
    assert np.isnan(track.pose[track.between, :2]).all()
    assert track.fresh[:, 2].all()


def test_gap_is_told():
    keep = np.r_[0:400, 500:N]
    track = clean(base().rows(keep))
    assert track.counts().samples == keep.size
    assert track.notes == ("a gap of 2.02 s, 7.98 s from the start",)


def test_rows_between_two_measurements_are_no_freeze():
    slow = base().pose[np.arange(N) // 5 * 5]
    slow[500:600] = slow[499]
    track = clean(replace(base(), pose=slow))
    assert track.period == pytest.approx(0.1)
    fresh = int(track.valid.sum())
    assert fresh == N // 5 - 20
    assert "a measurement every 0.1 s, a row every 0.02 s" in track.notes
    assert track.counts().used == fresh
    assert 90 <= track.counts().frozen <= 100


@pytest.mark.parametrize("empty", [False, True])
@pytest.mark.parametrize("rows", [2, 5])
def test_a_held_value_after_a_missing_row_is_no_new_sample(rows, empty):
    """It may have been new in the missing row: taken as new, it is as late as that, and a spike."""
    kept = np.random.default_rng(rows).random(N) > 0.2
    kept[0] = True
    pose = base().pose.copy()
    pose[:, :2] = pose[np.arange(N) // rows * rows, :2]
    pose[~kept, :2] = np.nan if empty else pose[~kept, :2]
    run = replace(base(), pose=pose)
    track = clean(run if empty else run.rows(kept))
    there = np.arange(N) if empty else np.flatnonzero(kept)
    sure = [k for k in range(0, N, rows) if kept[k] and (k == 0 or kept[k - 1])]
    assert there[track.valid].tolist() == sure
    late = sum(kept[k : k + rows].any() for k in range(0, N, rows)) - len(sure)
    assert track.notes[0].startswith(f"{late} positions are not used")
    assert track.fresh[:, 2].all()
    assert track.counts().used == len(sure)


def test_heading_about_south_is_taken_for_radians():
    psi = np.angle(np.exp(1j * (np.pi + 0.01 * np.random.default_rng(0).standard_normal(N))))
    track = clean(replace(base(), pose=np.column_stack([base().pose[:, :2], psi])))
    assert np.ptp(track.pose[:, 2]) < 0.1


@pytest.mark.parametrize("rate", [-1.7, -0.4, 0.9, 1.7])
def test_heading_is_unwrapped_over_a_gap_by_its_rate(rate):
    t = np.r_[0.0:10.0:0.05, 13.0:20.0:0.05]
    true = 0.3 + rate * t
    found = unwrap(t, np.angle(np.exp(1j * true)), 0.5)
    np.testing.assert_allclose(found, true, atol=1e-9)


@given(st.lists(st.integers(0, 8), min_size=1, max_size=9))
def test_longest_part_in_order_is_found(values):
    time = np.array(values, float)
    rows = in_order(time)
    assert (np.diff(rows) > 0).all()
    assert (np.diff(time[rows]) > 0.0).all()
    more = [time[list(c)] for c in combinations(range(time.size), rows.size + 1)]
    assert not any((np.diff(part) > 0.0).all() for part in more)


def test_noise_is_found_in_spite_of_motion_and_spikes():
    pose = clean(base()).pose.copy()
    np.testing.assert_allclose(noise(pose), NOISE, rtol=0.1)
    pose[::50] += 1.0
    np.testing.assert_allclose(noise(pose), NOISE, rtol=0.25)


def shuffled(run):
    return replace(run, time=np.random.default_rng(0).permutation(run.time))


def twice(run):
    """Stamps of another log: one stretch of it again and again, while the ship goes on."""
    return replace(run, time=np.tile(run.time[:4], N // 4))


@pytest.mark.parametrize(
    ("edit", "message"),
    [
        (lambda r: r.rows(np.arange(399)), "run 'made' is too short: 7.98 s, at least 8 s"),
        (lambda r: r.rows(np.arange(0)), "too short"),
        (shuffled, "time does not increase"),
        (twice, "time does not increase in 1196 of 1200 rows"),
        (lambda r: replace(r, time=1e3 * r.time), "a sample each 20 s is too rare; is the time in another unit?"),
        (lambda r: changed(r, slice(0, N), (5.0, 2.0, 1.0)), "does not move: its pose is frozen"),
        (lambda r: changed(r, slice(0, N), np.nan), "does not move: its pose is frozen or missing"),
        (lambda r: replace(r, pose=np.random.default_rng(0).normal(1.0, 1e-3, (N, 3))), "noise about a fixed position"),
        (lambda r: replace(r, pose=1e3 * r.pose * [1, 1, 1e-3]), "is its position in mm or cm or in?"),
        (lambda r: replace(r, pose=r.pose * [1, 1, np.degrees(1.0)]), "is its heading in deg?"),
    ],
)  # fmt: skip
def test_run_that_cannot_be_used_is_refused_with_one_line(edit, message):
    with pytest.raises(InputError) as error:
        clean(edit(base()))
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_shortest_run_is_taken():
    assert clean(base().rows(np.arange(400))).counts().used == 400


@pytest.mark.parametrize("period", [86400.0, 43200.0, 3600.0, 60.0])
def test_a_time_of_day_that_begins_anew_goes_on(period):
    run, start = base(), period - 14.0
    anew = ordered(replace(run, time=(run.time + start) % period))
    np.testing.assert_allclose(np.diff(anew.time), np.diff(run.time), atol=1e-9)
    assert anew.time[0] == pytest.approx(start)
    assert any(f"begins anew after {period:.5g} s, 1 times" in note for note in anew.notes)


def test_a_clock_that_jumps_back_by_another_time_is_no_period():
    run = base()
    back = np.where(run.time > 14.0, run.time - 5000.0, run.time)
    notes = ordered(replace(run, time=back)).notes
    assert not any("begins anew" in note for note in notes)
    assert any("set back by 5000 s" in note for note in notes)


@pytest.mark.parametrize(
    ("rows", "gap", "even"), [(1.0, 0.0, True), (9.0, 0.0, False), (1.0, 3.0, False)]
)
def test_stamps_that_jitter_by_more_than_a_row_are_taken_as_even(rows, gap, even):
    """Not where a row may be anywhere, or rows are missing."""
    run = base()
    true = run.time + gap * (run.time > 12.0)
    run = replace(run, time=true + 0.02 * rows * np.random.default_rng(0).standard_normal(N))
    if not even:
        with pytest.raises(
            InputError, match=r"time does not increase in \d+ of 1200 rows, and they are not"
        ):
            ordered(run)
        return
    found = ordered(run)
    assert found.time - true == pytest.approx(0.0, abs=0.004)
    assert "its stamps jitter by 0.02 s" in found.notes[-1]
    np.testing.assert_array_equal(found.pose, run.pose)


@pytest.mark.parametrize("flushed", [True, False])
def test_rows_that_were_stamped_in_batches_are_spread_and_bursts_of_samples_are_not(flushed):
    """Eight rows 0.5 ms apart every 0.16 s: written at once, or samples of 4 ms with a pause."""
    run = base()
    k = np.arange(N)
    stamps = 0.16 * (k // 8) + 0.0005 * (k % 8)
    taken = run.time if flushed else 40.0 * np.floor(stamps / 0.16)
    pose = np.column_stack([np.interp(taken, run.time, p) for p in run.pose.T])
    found = ordered(replace(run, time=stamps, pose=pose))
    if flushed:
        assert np.diff(found.time) == pytest.approx(0.02)
        assert "stamps are 0.16 s apart, with 8 samples each" in found.notes[-1]
    else:
        np.testing.assert_array_equal(found.time, stamps)


def test_messages_of_other_channels_a_few_milliseconds_later_are_no_burst():
    """A position each 0.2 s, a heading 3 ms and commands 6 ms after it, each in a row of its own."""
    run = base()
    each = run.rows(np.repeat(np.arange(0, N, 10), 3))
    pose, kind = np.array(each.pose), np.arange(each.time.size) % 3
    pose[kind > 0, :2] = pose[kind != 1, 2] = np.nan
    rows = replace(each, time=each.time + 0.003 * kind, pose=pose)
    assert not in_bursts(rows)
    np.testing.assert_array_equal(ordered(rows).time, rows.time)
    assert in_bursts(replace(rows, pose=each.pose)), "three positions at once"


def test_minutes_that_begin_anew_each_hour_go_on_all_day():
    rare = base().rows(np.arange(0, N, 60))
    hours = replace(rare, time=(rare.time / 0.02 * 10.0 + 3000.0) % 3600.0)
    assert np.diff(ordered(hours).time) == pytest.approx(600.0)


@pytest.mark.parametrize("repeats", [False, True])
def test_commands_that_are_written_when_they_change_hold(repeats):
    """A ramp writes each of its rows; a log in which commands are lost repeats some of the others."""
    t = base().time
    ramps = np.clip(np.abs((t % 6.0) - 3.0) - 1.5, 0.0, 1.0)
    given = np.column_stack([ramps, 0.0 * t, 0.0 * t])
    held = np.repeat(np.append(False, np.diff(ramps) == 0.0)[:, None], 3, axis=1)
    if repeats:
        held = np.repeat(((t % 6.0) > 2.5)[:, None], 3, axis=1)
    assert 2 * held[:, 0].sum() > t.size
    track = clean(replace(base(), tau_cmd=given, held=np.where([True, False, False], held, False)))
    assert (track.silences % 2 == 1).any() == repeats


@given(
    st.lists(st.tuples(st.integers(5, 40), st.integers(5, 40)), min_size=1, max_size=4),
    st.integers(0, 99),
)
def test_a_heading_that_is_the_other_way_round_for_a_while_makes_no_turn(flips, seed):
    """As of a marker that is taken for its opposite: noise decides by which way it seems to jump."""
    away = np.concatenate([np.repeat([0, 1], pair) for pair in flips] + [np.zeros(10, int)])
    t, rng = 0.04 * np.arange(away.size), np.random.default_rng(seed)
    true = 1.0 + 0.5 * t
    measured = np.angle(np.exp(1j * (true + np.pi * away + rng.normal(0.0, 0.01, t.size))))
    found = unwrap(t, measured, 0.5)
    np.testing.assert_allclose(np.abs(found - true), np.pi * away, atol=0.1)
