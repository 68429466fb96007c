"""How work is done: in two processes, with progress, with files that appear together."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
