"""Froude's law: units compose, and the physics of a ship of another size is the same in its own units."""

import pytest

from fmus.declare import variables
from fmus.scale import REFERENCE_LENGTH, Scale
from fmus.ship import ship

LENGTHS = [7.0 / REFERENCE_LENGTH, 320.0 / REFERENCE_LENGTH, 0.3]


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize(
    ("unit", "same"),
    [("N", "kg.m/s2"), ("N.m.s/rad", "kg.m2/(s.rad)"), ("N.s2/m2", "kg/m"), ("1", "rad")],
)
def test_factors_of_equal_units_are_equal(length: float, unit: str, same: str) -> None:
    scale = Scale(length)
    assert scale.factor(unit) == scale.factor(same)


@pytest.mark.parametrize("length", LENGTHS)
def test_factors_multiply_as_units_do(length: float) -> None:
    scale = Scale(length)
    assert scale.factor("m") == length
    assert scale.speed == pytest.approx(scale.length / scale.time, rel=1e-12)
    assert scale.rate == pytest.approx(1 / scale.time, rel=1e-12)
    assert scale.moment == pytest.approx(scale.force * scale.length, rel=1e-12)
    assert scale.force == pytest.approx(scale.factor("kg") * scale.length / scale.time**2, rel=1e-12)
    assert scale.factor("m/s2") == 1.0  # gravity is the same for all


def test_the_reference_ship_is_scaled_by_one_exactly() -> None:
    for part in (ship().vessel, ship().thrusters):
        for v in variables(part.params):
            assert ship().scale.factor(v.unit) == 1.0
