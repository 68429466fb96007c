"""Export of systems to other tools: SSP archives, OSP directories, container FMUs."""

from ..lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
