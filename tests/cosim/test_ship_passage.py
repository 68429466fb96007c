"""The contract of a passage: ways along a track, instants of an order, and the speed of the approach."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim.errors import InputError
from cosim.trials.ship_passage import (
    approach_speed,
    executes,
    first_crossing,
    passage,
    released,
)

TIME = np.arange(0.0, 100.0)
STILL = np.zeros_like(TIME)


def straight(speed=1.0, course=0.3, order=None, time=TIME):
    """Straight ahead at a speed."""
    way = speed * time
    return passage(
        time,
        way * np.cos(course),
        way * np.sin(course),
        0.0 * time,
        0.0 * time if order is None else order,
    )


def steps(*parts):
    """An order: (value, from which row on) ..."""
    order = np.zeros_like(TIME)
    for value, row in parts:
        order[row:] = value
    return order


@given(st.lists(st.tuples(*[st.floats(-10.0, 10.0)] * 2), min_size=2, max_size=6), st.floats(0.0, 1.0))
def test_the_way_is_the_length_of_the_track(points, share):
    x, y = np.array(points).T
    time = np.linspace(5.0, 9.0, len(points))
    p = passage(time, x, y, 0.0 * x, 0.0 * x)
    lengths = [abs(complex(b[0] - a[0], b[1] - a[1])) for a, b in pairwise(points)]
    assert p.way == pytest.approx(np.cumsum([0.0, *lengths]))
    middle = 5.0 + 4.0 * share
    assert p.along(5.0, middle) + p.along(middle, 9.0) == pytest.approx(sum(lengths), abs=1e-9)
    assert p.along(middle, 5.0) == pytest.approx(-p.along(5.0, middle))


def test_a_place_between_two_samples_is_on_the_line_between_them():
    p = passage([0.0, 2.0], [1.0, 5.0], [2.0, -2.0], [3.0, -3.0], [0.0, 1.0])
    assert p.at(0.5) == pytest.approx((2.0, 1.0, 3.0 + 0.25 * (2.0 * np.pi - 6.0))), "over the wrap"
    assert repr(p) == "<passage of 2 samples in 2 s>"


@pytest.mark.parametrize("column", range(5))
def test_rows_that_are_not_finite_are_left_out(column):
    table = np.array([TIME, *[TIME**2] * 4])
    table[column, 7] = np.nan
    p = passage(*table)
    assert p.time.tolist() == np.delete(TIME, 7).tolist()
    assert p.x.tolist() == np.delete(TIME**2, 7).tolist()


def test_too_few_rows_and_a_time_that_stands_still_are_refused():
    assert passage(TIME[:2], *[STILL[:2]] * 4).time.size == 2
    with pytest.raises(InputError, match="at least two samples"):
        passage(TIME[:1], *[STILL[:1]] * 4)
    with pytest.raises(InputError, match="do not increase"):
        passage(np.minimum(TIME, 50.0), *[STILL] * 4)


# Executes


@pytest.mark.parametrize("unit", [1.0, -1.0, 35.0])
@pytest.mark.parametrize("zero", [0.0, 2.0])
def test_an_order_that_jumps_is_put_over_at_its_jumps(unit, zero):
    order = zero + unit * steps((1.0, 10), (-1.0, 30), (1.0, 60))
    assert executes(straight(order=order)) == [10.0, 30.0, 60.0]


def test_what_returns_to_its_value_and_goes_to_the_same_side_is_one_execute():
    order = steps((1.0, 10), (0.0, 20), (1.0, 30), (-1.0, 40))
    assert executes(straight(order=order)) == [10.0, 40.0]


@pytest.mark.parametrize(("size", "found"), [(0.49, [40.0]), (0.51, [10.0, 40.0])])
def test_an_order_counts_beyond_half_of_the_largest(size, found):
    assert executes(straight(order=steps((-size, 10), (1.0, 40)))) == found


@pytest.mark.parametrize("unit", [0.1, 35.0])
@pytest.mark.parametrize("rate", [0.2, 0.05])
def test_an_order_that_takes_its_time_is_put_over_when_it_leaves_its_value(rate, unit):
    """To a tenth of the largest order it has not left it."""
    order = np.clip(rate * (TIME - 10.0), 0.0, 1.0)
    first = int(np.flatnonzero(order > 0.1)[0])
    back = np.clip(1.0 - rate * (TIME - 60.0), -1.0, 1.0)
    order = np.where(TIME > 59.0, back, order)
    second = int(np.flatnonzero((TIME > 59.0) & (order < 0.9))[0])
    assert executes(straight(order=unit * order)) == [float(first), float(second)]


def test_an_order_that_wobbles_about_its_first_value_is_measured_from_its_usual_one():
    order = steps((1.0, 20))
    order[0] = 0.3
    assert executes(straight(order=order)) == [20.0]


def test_an_order_that_never_stands_still_is_put_over_where_it_is_beyond_half():
    order = np.sin(2.0 * np.pi * TIME / 40.0)
    found = executes(straight(order=order))
    assert len(found) == 5
    assert np.diff(found[1:]) == pytest.approx([20.0] * 3, abs=1.0)
    with pytest.raises(InputError, match="the order under trial is constant"):
        executes(straight(order=np.ones_like(TIME)))


@pytest.mark.parametrize("side", [1.0, -35.0])
@pytest.mark.parametrize("row", [1, 20])
@pytest.mark.parametrize(("left", "when"), [(0.09, 70.0), (-0.09, 70.0), (0.11, None), (1.0, None)])
def test_an_order_is_released_where_it_ends_within_a_tenth_of_its_first_value(side, row, left, when):
    order = 3.0 + side * steps((1.0, row), (left, 70))
    assert released(straight(order=order)) == when


def test_an_order_that_is_taken_back_slowly_is_released_at_half():
    order = steps((1.0, 20))
    order = np.where(TIME >= 60.0, np.clip(1.0 - 0.08 * (TIME - 60.0), 0.0, 1.0), order)
    assert released(straight(order=order)) == 67.0
    assert released(straight(order=35.0 * order)) == 67.0
    assert released(straight(order=steps((1.0, 20), (0.0, 99)))) == 99.0, "in its last row"


# The approach


@pytest.mark.parametrize("speed", [0.5, 3.0])
def test_the_approach_has_the_speed_of_the_last_length(speed):
    p = straight(speed)
    assert approach_speed(p, 50.0, 10.0) == pytest.approx(speed)
    faster = passage(
        TIME, np.where(TIME < 40.0, 20.0 * TIME, 800.0 + speed * (TIME - 40.0)), *[STILL] * 3
    )
    assert approach_speed(faster, 50.0, 5.0 * speed) == pytest.approx(speed)
    longer = approach_speed(faster, 50.0, 200.0 + 10.0 * speed)
    assert longer == pytest.approx((200.0 + 10.0 * speed) / 20.0)
    assert approach_speed(p, 3.0, 1e6) == pytest.approx(speed), "what there is of it"
    assert approach_speed(p, 0.0, 10.0) == pytest.approx(speed), "the first step"


def test_what_comes_after_the_execute_is_no_approach():
    x = np.where(TIME <= 50.0, TIME, 50.0 + 9.0 * (TIME - 50.0))
    p = passage(TIME, x, STILL, STILL, STILL)
    assert approach_speed(p, 50.0, 10.0) == pytest.approx(1.0)
    one = passage(TIME, np.where(TIME > 0.0, TIME + 4.0, 0.0), STILL, STILL, STILL)
    assert approach_speed(one, 0.0, 10.0) == pytest.approx(5.0), "the first step alone"
    bent = passage(TIME, TIME, np.where(TIME % 2, 1.0, 0.0), STILL, STILL)
    assert approach_speed(bent, 50.0, 20.0) < np.hypot(1.0, 1.0), "over ground, from end to end"


@given(st.floats(-3.0, 3.0), st.floats(0.1, 5.0))
def test_a_level_is_reached_on_the_line_between_two_values(level, slope):
    values = slope * (TIME - 50.0)
    exact = 50.0 + level / slope
    assert first_crossing(TIME, values, level) == pytest.approx(exact)
    assert first_crossing(3.0 * TIME, values, level) == pytest.approx(3.0 * exact)
    assert first_crossing(TIME, -np.abs(values) - 0.01, 0.0) is None
    assert first_crossing(TIME + 4.0, values + 1e3, level) == 4.0


def test_the_first_of_several_crossings_counts_and_a_level_that_is_touched_is_reached():
    assert first_crossing([0.0, 1.0, 2.0, 3.0], np.array([0.0, 2.0, 0.0, 9.0]), 1.0) == 0.5
    assert first_crossing([0.0, 1.0, 2.0], np.array([0.0, 1.0, 0.0]), 1.0) == 1.0
