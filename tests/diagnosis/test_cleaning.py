"""The parts of the judgement of samples (diagnosis/runs/cleaning.py), each by its definition."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import InputError
from diagnosis import Run
from diagnosis.runs.cleaning import (
    HEADING,
    PLACE,
    Track,
    long_gap,
    near,
    perhaps_late,
    refuse_short,
    unwrap,
    updates,
)
from diagnosis.runs.run_constants import EVERY, HORIZON, LONG, NEGLIGIBLE
from fmus.actuators.actuation import command_names
from fmus.scale import REFERENCE, Scale
from fmus.ships.ship_file import read_ship

H, N = 0.1, 400
RATE = 0.5236  # rad/s, of an azimuth of the research vessel
TIME = H * np.arange(N)
NOTHING = np.zeros(N, bool)


def run(pose=None, time=TIME, **more):
    pose = np.column_stack([time, 0.5 * time, 0.01 * time]) if pose is None else pose
    return Run("made", time, pose, np.zeros((time.size, 3)), **more)


def track(time=TIME, scale=REFERENCE, fresh=None, **of_run):
    n = time.size
    fresh = np.ones((n, 3), bool) if fresh is None else fresh
    given = {"resolution": None, "held": None, "ship": None, "commands": None} | of_run
    r = SimpleNamespace(time=time, **given)
    r.given = np.zeros((n, 3)) if given["held"] is None else np.zeros(given["held"].shape)
    r.coarse = np.zeros((n, 3)) if given["resolution"] is None else given["resolution"]
    empty = np.zeros(n, bool)
    return Track(r, np.zeros((n, 3)), fresh, empty, empty.copy(), empty.copy(), H, 0, (), scale)


@pytest.mark.parametrize("size", [1.0, 16.0])
def test_a_gap_is_half_a_second_of_the_reference_or_five_periods(size):
    scale = Scale(size * REFERENCE.length)
    time = np.sqrt(size)
    assert long_gap(0.01, scale) == pytest.approx(EVERY * time)
    assert long_gap(3.0, scale) == LONG * 3.0


@pytest.mark.parametrize("size", [1.0, 16.0])
def test_a_run_is_as_long_as_a_prediction_at_least(size):
    """Its last row lasts as long as the others."""
    scale = Scale(size * REFERENCE.length)
    shortest = HORIZON * np.sqrt(size)
    rows = round(shortest / H)
    assert refuse_short(run(time=TIME[:rows]), scale) == pytest.approx((H, shortest))
    with pytest.raises(
        InputError, match=rf"'made' is too short: {shortest - H:.3g} s, at least {shortest:.3g} s"
    ):
        refuse_short(run(time=TIME[: rows - 1]), scale)
    with pytest.raises(InputError, match=r"too short: 0 s"):
        refuse_short(run(time=TIME[:1]), scale)


@given(st.lists(st.booleans(), min_size=1, max_size=12), st.integers(0, 4))
def test_a_time_is_near_to_one_that_is_there(there, apart):
    there = np.array(there)
    time = np.arange(float(there.size))
    known = time[there]
    expected = [bool(known.size) and bool(np.abs(known - t).min() <= apart) for t in time]
    assert near(time, there, float(apart)).tolist() == expected


# Headings


@given(st.integers(0, 1000), st.floats(-0.5, 0.5), st.floats(-20.0, 20.0))
def test_a_heading_goes_on_over_turns_and_over_a_gap_by_its_rate(seed, rate, start):
    rng = np.random.default_rng(seed)
    time = np.delete(TIME, range(100, 100 + int(rng.integers(1, 250))))
    psi = start + rate * time
    wrapped = np.angle(np.exp(1j * psi))
    found = unwrap(time, wrapped, 1.0)
    assert found[0] == wrapped[0]
    assert found - found[0] == pytest.approx(psi - psi[0], abs=1e-6)


def test_over_a_gap_the_rate_near_it_counts_and_where_none_is_known_the_shorter_way():
    """The ship turns slowly elsewhere and fast by the gap, before as after it."""
    rate = np.where(np.abs(TIME - 20.0) < 8.0, 0.5, 0.01)
    psi = np.cumsum(rate) * H
    kept = np.abs(TIME - 20.0) > 5.0
    found = unwrap(TIME[kept], np.angle(np.exp(1j * psi[kept])), 2.0)
    assert np.ptp(found) == pytest.approx(np.ptp(psi), abs=1e-6)
    assert unwrap(np.array([0.0, 9.0]), np.array([3.0, -3.0]), 1.0) == pytest.approx(
        [3.0, 2.0 * np.pi - 3.0]
    )


# New, held and late values


@pytest.mark.parametrize("channels", [PLACE, HEADING])
def test_a_value_that_repeats_is_held(channels):
    r = run()
    pose = r.pose.copy()
    pose[50:60, channels] = pose[50, channels]
    new, repeats, lined = updates(replace(r, pose=pose), channels, NOTHING)
    assert np.flatnonzero(repeats).tolist() == [*range(51, 60)]
    assert new.tolist() == (~repeats & ~lined).tolist()


def noisy(seed=0):
    rng = np.random.default_rng(seed)
    return np.column_stack([TIME, 0.5 * TIME, 0.01 * TIME]) + 1e-3 * rng.standard_normal((N, 3))


def test_rows_without_a_pose_are_neither_new_nor_held():
    pose, gone = noisy(), NOTHING.copy()
    pose[10, 0] = np.nan
    gone[20] = True
    new, repeats, lined = updates(run(pose), PLACE, gone)
    assert np.flatnonzero(~new).tolist() == [10, 20]
    assert not (repeats | lined).any()
    assert updates(run(pose), HEADING, gone)[0][10], "of another receiver"


def test_a_slow_value_that_is_rounded_repeats_and_is_measured():
    """Steps between values are those of the rounding, and not several of them."""
    coarse = np.full((N, 3), 0.01)
    slow = np.round(np.column_stack([0.02 * TIME, 0.0 * TIME, 0.0 * TIME]), 2)
    new, repeats, _ = updates(run(slow, resolution=coarse), PLACE, NOTHING)
    assert new[1:].all()
    assert not repeats.any()
    held = np.round(np.column_stack([TIME // 2.0, 0.0 * TIME, 0.0 * TIME]), 2)
    new, repeats, _ = updates(run(held, resolution=coarse), PLACE, NOTHING)
    assert np.flatnonzero(new).tolist() == [*range(0, N, 20)]
    assert repeats.sum() == N - N // 20


def test_a_heading_that_goes_round_and_repeats_is_held_whatever_its_sign():
    psi = np.angle(np.exp(1j * (3.0 + 0.05 * (np.arange(N) // 4))))
    pose = noisy()
    pose[:, 2] = psi
    new, repeats, _ = updates(run(pose), HEADING, NOTHING)
    assert repeats.sum() == N - N // 4
    assert new.sum() <= N // 4


def values(every=4, missing=(), empty=()):
    """Rows of values that are held; some rows are missing, and some are empty."""
    rows = np.delete(np.arange(N), missing)
    new = rows % every == 0
    there = ~np.isin(rows, empty)
    return H * rows, new & there, ~new & there


def test_a_held_value_after_a_missing_or_empty_row_may_be_late():
    for lost in ({"missing": [39]}, {"empty": [39]}):
        time, new, repeats = values(**lost)
        late, (line,) = perhaps_late(time, new, repeats, H, "positions")
        assert time[late] == pytest.approx([4.0])
        assert (
            line == "1 positions are not used: each is held for some rows, and the one before is missing"
        )
    time, new, repeats = values(missing=[38], empty=[46])
    assert not perhaps_late(time, new, repeats, H, "x")[0].any(), "the row before is there"
    assert perhaps_late(time, new, repeats, H, "x")[1] == []


def test_values_that_are_new_in_each_row_are_of_that_row():
    time, new, repeats = values(every=1, missing=[39])
    assert not perhaps_late(time, new, repeats, H, "x")[0].any()
    time, new, repeats = values(every=1, empty=[*range(1, N, 2)])
    assert not perhaps_late(time, new, repeats, H, "x")[0].any()


# What is known of a track


def test_counts_are_of_all_samples_each_once():
    t = track()
    t.frozen[3:7], t.dropped[10:12], t.between[100:150] = True, True, True
    c = replace(t, out=5).counts(9)
    assert (c.samples, c.frozen, c.dropped, c.spikes) == (N - 50 + 5, 4, 2 + 5, 9)
    assert c.used == c.samples - c.frozen - c.dropped - c.spikes


def test_periods_and_rounding_are_those_of_each_channel():
    fresh = np.column_stack([np.arange(N) % k == 0 for k in (1, 2, 5)])
    coarse = np.outer(np.where(np.arange(N) % 10, 1.0, 7.0), [0.1, 0.2, 0.0])
    t = track(fresh=fresh, resolution=coarse)
    assert t.periods == pytest.approx([H, 2.0 * H, 5.0 * H])
    assert t.rounding == pytest.approx(np.where(fresh, coarse, 0.0) / np.sqrt(12.0))
    assert t.usual_rounding == pytest.approx(np.array([0.1, 0.2, 0.0]) / np.sqrt(12.0))
    assert t.valid.tolist() == fresh[:, 0].tolist()


def test_commands_before_the_run_are_forgotten_after_the_longest_lag():
    t = track(time=TIME + 7.0, ship=read_ship("otter"))
    assert t.lag == 1.0
    assert np.exp(-(t.responded - 7.0)) == pytest.approx(NEGLIGIBLE)
    assert (track().lag, track().responded) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("angle", "speed", "seconds"), [(0.6, 0.0, 0.6 / RATE), (0.1, 2.0, 4.0), (9.0, 0.0, np.pi / RATE)]
)
def test_commands_before_the_run_are_forgotten_once_limited_rates_have_gone_all_their_way(
    angle, speed, seconds
):
    """From zero or the other end to any command; an azimuth that goes round takes half a turn at most."""
    of = read_ship(
        "gunnerus"
    )  # its azimuths turn at RATE, and their shafts change by 0.5 1/s in a second
    commands = np.zeros((N, len(command_names(of))))
    commands[: N // 2, 0], commands[:, 1] = angle, speed
    t = track(ship=of, commands=commands)
    assert t.slewing == pytest.approx(seconds)
    assert t.responded == pytest.approx(seconds - np.log(NEGLIGIBLE) * t.lag)
    assert track(ship=of).slewing == 0.0


def silent(held):
    return track(held=held[:, None]).silences


def test_times_without_commands_are_odd_parts_of_the_run():
    """From behind the last command to the next one."""
    held = NOTHING.copy()
    held[100:150] = True
    part = silent(held)
    assert np.flatnonzero(part % 2 == 1).tolist() == [*range(100, 150)]
    assert (part[:100] == 0).all()
    assert (part[150:] == 2).all()
    held[300:320] = True
    assert silent(held)[-1] == 4
    short = NOTHING.copy()
    short[100 : 100 + int(LONG) - 1] = True
    assert (silent(short) == 0).all(), "no longer than a gap"
    assert (track().silences == 0).all()


def test_nothing_is_known_before_the_first_command_and_behind_the_last():
    held = NOTHING.copy()
    held[:30] = True
    held[350:] = True
    part = silent(held)
    assert (part[:30] == 1).all()
    assert (part[30:350] == 2).all()
    assert (part[350:] == 3).all()


def test_where_one_command_of_several_is_lost_they_are_not_known():
    """Parts that overlap are one; each alone may be shorter."""
    one, other = NOTHING.copy(), NOTHING.copy()
    one[100:150], other[140:200], other[300:310] = True, True, True
    both = track(held=np.column_stack([one, other])).silences
    np.testing.assert_array_equal(both % 2 == 1, one | other)
    assert both[-1] == 4
    np.testing.assert_array_equal(both, track(held=np.column_stack([other, one])).silences)


def test_commands_in_rows_of_their_own_are_written_when_they_are_there():
    row = np.arange(NOTHING.size)
    held = np.column_stack([row % 3 != k for k in range(3)])
    assert (track(held=held).silences == 0).all()


def test_commands_that_are_written_when_they_change_are_held_between():
    held = ~NOTHING
    held[::40] = False
    assert (silent(held) == 0).all()
    held[:] = True
    held[:100] = False
    assert (silent(held)[100:] % 2 == 1).all(), "those of the first rows alone are not"
