"""Measured runs: read from files of any form, their samples judged."""

from .beside import line_beside
from .cleaning import Counts, Track, clean, lost, repeated
from .reading import Run, read

__all__ = ["Counts", "Run", "Track", "clean", "line_beside", "lost", "read", "repeated"]
