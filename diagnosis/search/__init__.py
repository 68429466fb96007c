"""Evidence for missing effects: candidates, fits, scores, calibration.

Every method stands behind the interface :class:`.methods.Method`. This room concludes nothing.
"""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
