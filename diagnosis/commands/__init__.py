"""What the commands of the diagnosis share: options, mistakes, the model that is named."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
