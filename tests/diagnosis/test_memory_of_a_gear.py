"""How long a rate limit remembers commands: until the angle has come from anywhere, and not twice as long."""

from math import pi

import pytest

from fmus.effects.steering_gear import rate_limited
from fmus.ship import ship
from fmus.ships.ship_file import read_ship


@pytest.mark.parametrize(
    ("name", "effect", "turns"), [("kvlcc2", "rate_rudder", False), ("gunnerus", "rate_azimuth", True)]
)
@pytest.mark.parametrize("rate", [0.01, 0.2])
def test_it_is_the_time_from_the_farthest_angle(name, effect, turns, rate):
    lasts = ship(description=read_ship(name)).effects[effect].memory.lasts(rate)
    h = lasts / 1000.0
    angle, steps = 0.0, 0
    while angle < pi - 1e-3 and steps < 5000:
        angle, _ = rate_limited(angle, pi - 1e-3, rate, h, turns)
        steps += 1
    assert 0.5 * lasts <= steps * h <= lasts + h
