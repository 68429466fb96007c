"""Commands that the thrusters cannot give: the axis that is named, and how often, by a count of the cells."""

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from diagnosis import Model, Run
from diagnosis.assessment.command_check import beyond_thrusters, idle, lasting
from diagnosis.assessment.settings import SETTINGS
from diagnosis.predictors import ship_with
from diagnosis.predictors.thrust import full_thrust
from diagnosis.runs.run_constants import NEGLIGIBLE

MODEL = Model()
FULL = full_thrust(MODEL).tolist()
ROWS = 40


def run_of(ratios):
    """A run whose forces are some times (n, 3) what the thrusters give."""
    tau = np.array(ratios) * FULL
    return Run("made", 0.1 * np.arange(len(tau)), np.zeros_like(tau), tau)


def expected(ratios):
    """Axis and number of rows that are told, from cell to cell; None: nothing is."""
    stated = []
    for k, full in enumerate(FULL):
        cells = [abs(row[k]) * full for row in ratios]
        false = [c for c in cells if c > SETTINGS.most_gain * full]
        if false and sum(false) > NEGLIGIBLE * sum(cells):
            stated.append((max(cells) / full, k, len(false)))
    return max(stated)[1:] if stated else None


ratio = st.one_of(
    st.floats(-1.0, 1.0),
    st.sampled_from([0.0, 2.4, -2.4, 2.6, -2.6, 5.0, -7.0, 40.0]),
)


@given(st.lists(st.tuples(ratio, ratio, ratio), min_size=1, max_size=ROWS))
def test_the_axis_farthest_beyond_its_thrust_is_named_with_its_rows(ratios):
    text = beyond_thrusters(run_of(ratios), MODEL)
    clear = expected(ratios)
    if clear is None:
        assert text is None
        return
    axis, rows = clear
    ties = {max(abs(r[k]) for r in ratios) for k in range(3)}
    if len(ties) == 3:
        assert text.split(maxsplit=1)[0].endswith("XYN"[axis])
        assert f"in {rows} of {len(ratios)} rows" in text
        assert f"the {FULL[axis]:.4g} {'N.m' if axis == 2 else 'N'} that" in text
    assert ("--ship" in text) == (2 * rows > len(ratios)) or len(ties) < 3


@pytest.mark.filterwarnings("error")
@given(
    st.lists(st.booleans(), min_size=1, max_size=ROWS),
    st.lists(st.booleans(), min_size=ROWS, max_size=ROWS),
)
def test_rows_are_idle_where_all_commands_are_zero_for_long_whatever_times_are_missing(zero, missing):
    run = run_of([(0.0, 0.0, 0.0) if z else (0.0, 0.5, 0.0) for z in zero])
    time = np.where(missing[: len(zero)], np.nan, run.time)
    expected, start = [], 0
    for z, rows in groupby(zero):
        stamps = time[start : start + len([*rows])]
        known = stamps[np.isfinite(stamps)]
        expected += [z and known.size > 0 and known[-1] - known[0] >= 0.45] * stamps.size
        start += stamps.size
    assert idle(replace(run, time=time), 0.45).tolist() == expected


@pytest.mark.filterwarnings("error")
def test_an_axis_without_thrust_or_command_is_not_the_one_named():
    """A log of another ship: the force ahead of one whose actuators are weaker, and none sideways."""
    tanker = Model(ship=ship_with((), "kvlcc2"))
    assert full_thrust(tanker)[1] == 0.0
    tau = np.tile([1e6 * full_thrust(tanker)[0], 0.0, 0.0], (ROWS, 1))
    text = beyond_thrusters(Run("made", 0.1 * np.arange(ROWS), np.zeros_like(tau), tau), tanker)
    assert text.startswith("tau_X reaches ")
    assert "--ship" in text


@pytest.mark.parametrize("axis", range(3))
def test_a_cell_that_is_larger_but_does_not_matter_is_not_the_one_named(axis):
    """One cell far beyond, among many that are large, is less than the negligible share of an axis."""
    other = (axis + 1) % 3
    ratios = np.zeros((400, 3))
    ratios[:, axis] = 2.4  # allowed
    ratios[7, axis] = 30.0  # 30 of 990: 3 %
    ratios[:, other] = 0.1
    ratios[:20, other] = 2.7
    text = beyond_thrusters(run_of(ratios), MODEL)
    assert text.split(maxsplit=1)[0].endswith("XYN"[other])
    assert "in 20 of 400 rows" in text


def test_a_force_that_lasts_is_counted_and_one_that_averages_out_is_not():
    block = np.repeat(np.arange(6), 40)
    gusts = np.random.default_rng(1).standard_normal((block.size, 3))
    assert (lasting(gusts, block) < 2.0 * np.sqrt(1.0 / 40.0)).all(), "of a standard deviation of 1"
    assert lasting(gusts + np.array([2.0, -1.0, 0.0]), block)[:2] == pytest.approx([2.0, 1.0], rel=0.1)
