"""The user's input: scenario files, and their checks that need no FMU."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
