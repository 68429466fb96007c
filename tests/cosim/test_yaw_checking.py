"""A zig-zag whose heading is known in closed form: overshoots, times, reach and period."""

import numpy as np
import pytest

from cosim.trials.ship_passage import passage
from cosim.trials.yaw_checking import MOST_OVERSHOOTS, zigzag_measures

H, SPEED = 0.01, 1.5
AMPLITUDE, PERIOD, FIRST = 0.3, 40.0, 10.0
CHECK = 0.2


def zigzag(side=1.0, until=200.0, check=CHECK, course=0.4):
    """A heading that swings as a sine from FIRST on; the order changes where it passes the check angle."""
    time = np.arange(0.0, until + 0.5 * H, H)
    phase = 2.0 * np.pi * np.maximum(time - FIRST, 0.0) / PERIOD
    off = AMPLITUDE * np.sin(phase)
    order = np.where(time < FIRST, 0.0, 1.0)
    for row in range(1, time.size):
        if time[row] > FIRST:
            order[row] = order[row - 1]
            if order[row] * off[row] >= check:
                order[row] = -order[row]
    psi = course + side * off
    return passage(time, SPEED * time, 0.0 * time, psi, side * order)


def crossing(check=CHECK):
    """Time from the first order to the check angle [s]."""
    return PERIOD * np.arcsin(check / AMPLITUDE) / (2.0 * np.pi)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_measures_are_those_of_a_sine(side):
    found = zigzag_measures(zigzag(side), 5.0)
    top = PERIOD / 4.0 - crossing()
    overshoots = range(1, MOST_OVERSHOOTS + 1)
    expected = {
        "approach_speed": SPEED,
        "check_angle": CHECK,
        "initial_turning": SPEED * crossing(),
        "initial_turning_time": crossing(),
        "reach": PERIOD / 2.0,
        "period": PERIOD,
        **{f"overshoot_{k}": AMPLITUDE - CHECK for k in overshoots},
        **{f"overshoot_time_{k}": top for k in overshoots},
    }
    assert found.keys() == expected.keys()
    for name, value in expected.items():
        assert found[name] == pytest.approx(value, abs=2.0 * H, rel=0.0), name


def after(turn, more=0.0):
    """Time of the whole trial that ends some time after the order was put over for the nth time."""
    return FIRST + crossing() + (turn - 2) * PERIOD / 2.0 + more


@pytest.mark.parametrize(
    ("until", "overshoots", "more"),
    [
        (after(2, -1.0), 0, set()),
        (after(2, 1.0), 0, {"check_angle"}),
        (after(2, 8.0), 1, {"check_angle"}),
        (after(2, 14.0), 1, {"check_angle"}),
        (after(2, 16.0), 1, {"check_angle", "reach"}),
        (after(3, 1.0), 1, {"check_angle", "reach"}),
        (after(3, 8.0), 2, {"check_angle", "reach"}),
        (after(4, 1.0), 2, {"check_angle", "reach", "period"}),
        (after(5, 8.0), 4, {"check_angle", "reach", "period"}),
        (after(6, 8.0), 4, {"check_angle", "reach", "period"}),
    ],
)
def test_a_zigzag_has_what_it_goes_far_enough_for(until, overshoots, more):
    """An overshoot is over once the heading comes back."""
    found = zigzag_measures(zigzag(until=until), 5.0)
    assert {n for n in found if n in ("check_angle", "reach", "period")} == more
    assert sum(n.startswith("overshoot_time") for n in found) == overshoots


def test_a_heading_that_comes_back_at_once_has_no_overshoot():
    p = zigzag(until=after(3, 8.0))
    turns = [k for k in range(1, p.time.size) if p.order[k] != p.order[k - 1]]
    second = turns[1]
    psi = p.psi.copy()
    psi[second:] = psi[second] - 0.02 * (p.time[second:] - p.time[second])
    found = zigzag_measures(p._replace(psi=psi), 5.0)
    assert found["overshoot_1"] == 0.0
    assert found["overshoot_time_1"] == 0.0
