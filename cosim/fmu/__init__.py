"""One FMU: its archive and description, and running it, in this process or in one of its own."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
