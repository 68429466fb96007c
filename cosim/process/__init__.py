"""The process of a run: its state where another process reads it, scratch folders, more processes."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
