"""Results of the diagnosis for people and programs: JSON content, terminal output, one HTML page."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
