"""A scenario checked against its FMUs: wiring, order of stepping, units, start values."""

from .instance_pool import InstancePool
from .preparation import prepare
from .system import System

__all__ = ["InstancePool", "System", "prepare"]
