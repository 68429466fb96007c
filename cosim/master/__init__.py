"""The master: algorithm, stepping, real time, recording, and the run itself."""

from .algorithm import Master
from .ending import Result
from .simulation import simulate

__all__ = ["Master", "Result", "simulate"]
