"""A scenario checked against its FMUs: wiring, order of stepping, units, start values."""

from .preparation import prepare
from .system import System

__all__ = ["System", "prepare"]
