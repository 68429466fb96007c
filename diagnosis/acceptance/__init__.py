"""Judges a model by criteria that were written down before, and keeps a record that can be checked."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
