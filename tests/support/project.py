"""The project as its tests see it."""

from pathlib import Path

from fmus.declare import discover, flatten, packer, variables
from fmus.ship import ship

ROOT = Path(__file__).parents[2]
COMPONENTS = {component.name: component for _, component in discover(ship())}


def with_values(component, **values):
    """Parameters of a component, some of them with other values."""
    names = [v.name for v in variables(component.params)]
    start = dict(zip(names, flatten(component.params()), strict=True))
    assert values.keys() <= start.keys()
    return packer(component.params)(list((start | values).values()))
