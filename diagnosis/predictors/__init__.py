"""What a model says of a measured run: its forces, its model error, its predictions."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
