"""Runs in several processes, here or on other computers, on FMUs that stay loaded."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
