"""Long gaps: what lies before and after knows nothing of each other, however long they are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from support.measured import sail, smoothed

from diagnosis import Model
from diagnosis.predictors import omega, weak_windows
from diagnosis.predictors.weak_form import WIDTH, places
from fmus.scale import Scale

HALF = 1500


@cache
def base():
    """The run that is varied."""
    return sail(60.0)[0]


@pytest.mark.parametrize("gap", [10.0, 100.0])
def test_no_window_spans_a_long_gap(gap):
    time = base().time + np.where(np.arange(base().time.size) < HALF, 0.0, gap)
    windows = weak_windows(smoothed(replace(base(), time=time)))
    before, after = time[HALF - 1], time[HALF]
    assert windows.middle.size > 0.9 * weak_windows(smoothed(base())).middle.size - 6
    assert (
        (windows.middle + WIDTH / 2 <= before + 0.5) | (windows.middle - WIDTH / 2 >= after - 0.5)
    ).all()
    assert np.abs(omega(windows, Model())).max() < 0.2


def test_places_are_all_of_a_run_without_gaps():
    time = np.arange(0.0, 30.0, 0.02)
    np.testing.assert_array_equal(places(time), np.arange(0, 54))


@pytest.mark.parametrize("length", [0.2, 4.0, 30.0])
def test_places_are_the_same_for_a_ship_of_any_size_in_its_own_seconds(length):
    scale = Scale(length)
    time = np.concatenate([np.arange(0.0, 30.0, 0.02), np.arange(90.0, 120.0, 0.02)])
    np.testing.assert_array_equal(places(scale.time * time, scale), places(time))
