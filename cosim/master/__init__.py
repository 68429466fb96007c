"""The master: algorithm, stepping, real time, recording, and the run itself."""

from .algorithm import Master
from .simulation import Result, simulate

__all__ = ["Master", "Result", "simulate"]
