"""The master: algorithm, stepping, real time, recording, and the run itself."""

from .algorithm import Master
from .instance_pool import InstancePool
from .simulation import Result, simulate

__all__ = ["InstancePool", "Master", "Result", "simulate"]
