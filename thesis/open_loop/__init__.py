"""Measured runs fed to observer and controller FMUs open loop, by the master: 7.1."""

from .playback import OpenLoop, Played, loop_of, play, watch_loop
from .run_source import Source, gather_source

__all__ = ["OpenLoop", "Played", "Source", "gather_source", "loop_of", "play", "watch_loop"]
