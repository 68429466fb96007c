"""Finds which effects a model lacks: candidates, regressions, refinement, forward selection.

Every method stands behind the interface :class:`.methods.Method`.
"""

from cosim.lazy import lazy_names

__all__, __getattr__, __dir__ = lazy_names(__name__, __file__)
