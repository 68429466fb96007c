"""The most that a ship's actuators do, as a limit of what a misread log may need."""

from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis import Model
from diagnosis.assessment import reading_odds
from diagnosis.assessment.reading_odds import most_thrust
from diagnosis.predictors import ship_with


@pytest.mark.parametrize(
    ("full", "commanded", "force", "moment"),
    [
        ([300.0, 100.0, 9000.0], [10.0, 10.0, 10.0], 300.0, 9000.0),
        ([100.0, 300.0, 50.0], [10.0, 10.0, 10.0], 300.0, 50.0),
        ([100.0, np.nan, 50.0], [400.0, 10.0, 10.0], 400.0, 50.0),
        ([200.0, 0.0, 0.0], [0.0, 0.0, 0.0], 200.0, None),
    ],
)
def test_a_force_is_the_larger_of_both_and_without_a_moment_it_acts_at_half_of_the_length(
    monkeypatch, full, commanded, force, moment
):
    monkeypatch.setattr(reading_odds, "full_thrust", lambda _: np.array(full))
    w = SimpleNamespace(run=SimpleNamespace(tau_cmd=np.array([commanded, np.negative(commanded)])))
    model = Model(ship=ship_with((), "otter"))
    expected = 0.5 * force * model.ship.description.length if moment is None else moment
    assert most_thrust(w, model).tolist() == [force, force, expected]
