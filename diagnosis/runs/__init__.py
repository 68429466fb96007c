"""Measured runs: read from files of any form, checked, cleaned, smoothed; no model of a ship is used."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
