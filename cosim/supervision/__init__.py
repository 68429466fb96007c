"""The supervisor of a command: however that ends, the command says so."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
