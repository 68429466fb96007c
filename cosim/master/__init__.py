"""The master: algorithm, stepping, real time, recording, and the run itself."""

from .algorithm import Master
from .loops.chosen_loop import choose_loop
from .recorder import Recorder

__all__ = ["Master", "Recorder", "choose_loop"]
