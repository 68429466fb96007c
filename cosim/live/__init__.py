"""A page in which a scenario runs: one HTML file, without a server."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
