"""Manoeuvring trials: their measures by the definitions of IMO and ISO, table and picture."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
