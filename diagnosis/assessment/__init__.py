"""How wrong a model is, and where.

Prediction errors over windows of some seconds, regions in which the model error is larger than
elsewhere, and whether a learned model is stable.
"""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
