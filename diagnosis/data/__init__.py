"""Measured runs: read from files of any form, their samples judged."""

from .cleaning import Counts, Track, clean, lost, repeated
from .reading import Run, read

__all__ = ["Counts", "Run", "Track", "clean", "lost", "read", "repeated"]
