"""A turning circle of exact arcs: every measure by geometry."""

import math

import numpy as np
import pytest

from cosim.trials.ship_passage import passage
from cosim.trials.turning_circle import turning_circle

BEGIN = 10.0


def circle(side=1.0, speed=2.0, rate=0.1, until=100.0, course=0.7, out=None, decay=None, h=0.01):
    """Straight ahead for BEGIN s, then an arc; released at ``out``, after which the rate falls to a value."""
    time = np.arange(0.0, until + 0.5 * h, h)
    r = np.where(time < BEGIN, 0.0, side * rate)
    order = np.where(time < BEGIN, 0.0, 1.0)
    if out is not None:
        r = np.where(time >= out, side * decay, r)
        order = np.where(time >= out, 0.0, order)
    psi = course + np.concatenate([[0.0], np.cumsum(r[:-1] * h)])
    middle = psi[:-1] + 0.5 * h * r[:-1]
    steps = speed * h * np.column_stack([np.cos(middle), np.sin(middle)])
    x, y = np.cumsum(np.vstack([[3.0, -4.0], steps]), axis=0).T
    return passage(time, x, y, psi, order)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("course", "h"), [(0.0, 0.01), (0.7, 1.0), (3.0, 1.0)])
def test_measures_are_those_of_an_arc(side, course, h):
    """Radius 20 m: ahead at 90 degrees and aside, twice as far aside at 180."""
    speed, rate = 2.0, 0.1
    R = speed / rate
    found = turning_circle(circle(side, speed, rate, course=course, h=h), 5.0)
    assert found == pytest.approx(
        {
            "approach_speed": speed,
            "advance": R,
            "transfer": R,
            "tactical_diameter": 2.0 * R,
            "time_90": 0.5 * math.pi / rate,
            "time_180": math.pi / rate,
            "circle_speed": speed,
            "circle_rate": rate,
            "circle_diameter": 2.0 * R,
        },
        rel=2e-3,
    )


@pytest.mark.parametrize(
    ("turned", "missing"),
    [
        (1.4, {"advance", "transfer", "time_90", "tactical_diameter", "time_180", "circle_speed"}),
        (3.0, {"tactical_diameter", "time_180", "circle_speed", "circle_rate", "circle_diameter"}),
        (6.2, {"circle_speed", "circle_rate", "circle_diameter"}),
        (6.4, set()),
    ],
)
def test_a_turn_has_only_what_it_goes_far_enough_for(turned, missing):
    found = turning_circle(circle(until=BEGIN + turned / 0.1), 5.0)
    assert not missing & found.keys()
    assert "residual_rate" not in found
    assert ("circle_rate" in found) == (turned > 2.0 * math.pi)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_pull_out_ends_the_turn_and_leaves_its_last_rate(side):
    """The rest of the turn is to the side of the order, or back."""
    out = BEGIN + 70.0
    for decay, h in ((0.02, 0.01), (-0.01, 1.0)):
        found = turning_circle(circle(side, out=out, decay=decay, until=out + 30.0, h=h), 5.0)
        assert found["residual_rate"] == pytest.approx(decay)
        assert found["circle_rate"] == pytest.approx(0.1, rel=2e-3), "what follows is no part of it"


def test_the_last_rate_of_a_pull_out_is_that_of_its_last_fifth():
    out, late = 80.0, 104.0
    p = circle(out=out, decay=0.05, until=110.0)
    psi = p.psi.copy()
    psi[p.time >= late] = np.interp(late, p.time, psi) + 0.01 * (p.time[p.time >= late] - late)
    found = turning_circle(p._replace(psi=psi), 5.0)
    assert found["residual_rate"] == pytest.approx(0.01, rel=1e-2)


def test_a_steady_turn_is_its_last_half():
    """A ship that turns more slowly at the end of its turn has the speed and rate of that part."""
    p = circle(until=BEGIN + 2.5 * math.pi / 0.1)
    begun = BEGIN + 1.5 * math.pi / 0.1
    time = np.where(p.time > begun, begun + 2.0 * (p.time - begun), p.time)
    found = turning_circle(p._replace(time=time), 5.0)
    assert found["circle_rate"] == pytest.approx(0.05, rel=2e-3)
    assert found["circle_speed"] == pytest.approx(1.0, rel=2e-3)
    assert found["circle_diameter"] == pytest.approx(40.0, rel=2e-3)
