"""Finds which effects a model lacks: candidates, regressions, refinement, forward selection.

Every method stands behind the interface :class:`.methods.Method`.
"""

from typing import TYPE_CHECKING

from cosim.lazy import lazy_names

from .methods import DEFAULT, METHODS, Method, method

if TYPE_CHECKING:
    from .findings import Finding, Findings, Ranked, Suspect
    from .prior import MEASURED

__all__ = [
    "DEFAULT",
    "MEASURED",
    "METHODS",
    "Finding",
    "Findings",
    "Method",
    "Ranked",
    "Suspect",
    "method",
]

__getattr__ = lazy_names(
    __name__,
    {
        "MEASURED": "prior",
        "Finding": "findings",
        "Findings": "findings",
        "Ranked": "findings",
        "Suspect": "findings",
    },
)
