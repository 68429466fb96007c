"""Long gaps: what lies before and after knows nothing of each other, however long they are."""

from dataclasses import replace

import numpy as np
import pytest
from measured import sail

from diagnosis import Model, clean, smooth
from diagnosis.weak import WIDTH, integrals, omega, places

RUN, _ = sail(60.0)
HALF = RUN.time.size // 2


@pytest.mark.parametrize("gap", [10.0, 100.0])
def test_no_window_spans_a_long_gap(gap):
    time = RUN.time + np.where(np.arange(RUN.time.size) < HALF, 0.0, gap)
    windows = integrals(smooth(clean(replace(RUN, time=time))))
    before, after = time[HALF - 1], time[HALF]
    assert windows.middle.size > 0.9 * integrals(smooth(clean(RUN))).middle.size - 6
    assert (
        (windows.middle + WIDTH / 2 <= before + 0.5) | (windows.middle - WIDTH / 2 >= after - 0.5)
    ).all()
    assert np.abs(omega(windows, Model())).max() < 0.2


def test_places_are_all_of_a_run_without_gaps():
    time = np.arange(0.0, 30.0, 0.02)
    np.testing.assert_array_equal(places(time), np.arange(0, 54))
