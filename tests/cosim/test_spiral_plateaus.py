"""Plateaus of a spiral, whatever is between them."""

import numpy as np
import pytest

from cosim.trials.ship_passage import Passage
from cosim.trials.yaw_stability import plateaus

HELD, H = 400, 0.1


def spiral(between):
    """Two plateaus at the orders 1 and -1 with the rates 0.02 and -0.03 rad/s, and orders between them."""
    order = np.concatenate([np.full(HELD, 1.0), between, np.full(HELD, -1.0)])
    rate = np.concatenate([np.full(HELD, 0.02), np.zeros(len(between)), np.full(HELD, -0.03)])
    time = H * np.arange(order.size)
    return Passage(time, 0.0 * time, 0.0 * time, H * np.cumsum(rate), order)


@pytest.mark.parametrize(
    "between", [[], np.linspace(0.9, -0.9, 19), [0.9, 0.7, 0.5, 0.5, 0.2, -0.3, -0.6]]
)
def test_orders_on_the_way_from_one_to_the_next_are_no_plateaus(between):
    first, last = plateaus(spiral(between))
    assert (first.order, last.order) == (1.0, -1.0)
    assert first.rate == pytest.approx(0.02)
    assert last.rate == pytest.approx(-0.03)
