"""Functions of a hull that add energy: what a warning says depends on the motion in which they do."""

from types import SimpleNamespace

import pytest

from fmus.ships import ship_doubts
from fmus.ships.ship_doubts import _functions

AXES = ("surge", "sway", "yaw")


def doubts(monkeypatch, law):
    monkeypatch.setitem(ship_doubts.FUNCTIONS, "own", law)
    ship = SimpleNamespace(functions=[SimpleNamespace(law="own", values=())], length=2.0)
    return [d.text if hasattr(d, "text") else d[-1] for d in _functions(ship)]


@pytest.mark.parametrize("ahead", [1.0, -1.0])
@pytest.mark.parametrize("axis", [1, 2])
def test_sideways_and_turning_motions_are_those_of_a_ship_ahead(monkeypatch, axis, ahead):
    """A force that drives the ship along on one heading of its way alone: ahead it is named."""

    def law(u, v, r):
        speed = (u, v, r)[axis]
        force = [0.0, 0.0, 0.0]
        force[axis] = speed if ahead * u > 0.0 else -speed
        return tuple(force)

    found = doubts(monkeypatch, law)
    assert [AXES[axis] in text for text in found] == ([True] if ahead > 0.0 else [])


def test_damping_has_no_warning(monkeypatch):
    assert doubts(monkeypatch, lambda u, v, r: (-u * abs(u), -v, -(r**3))) == []
