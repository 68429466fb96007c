"""The project as its tests see it."""

from pathlib import Path

from fmus.declare import discover
from fmus.ship import ship

ROOT = Path(__file__).parents[2]
COMPONENTS = {component.name: component for _, component in discover(ship())}
