"""The master: algorithm, stepping, real time, recording, and the run itself."""

from .algorithm import Master
from .ending import Result
from .loops.chosen_loop import choose_loop
from .recorder import Recorder
from .simulation import simulate

__all__ = ["Master", "Recorder", "Result", "choose_loop", "simulate"]
