"""Files of the SSP and OSP standards: parameter sets, variable groups, systems as scenarios."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
