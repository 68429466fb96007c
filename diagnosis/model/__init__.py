"""A model of ship and thrusters on measured runs: parameters, forces, predictions, model error."""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
