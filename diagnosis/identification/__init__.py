"""Finds which effects a model lacks: candidates, regressions, refinement, forward selection.

Every method stands behind the interface :class:`.methods.Method`.
"""

from typing import TYPE_CHECKING

from cosim.lazy import lazy_names

from .methods import DEFAULT, METHODS, Method, method

if TYPE_CHECKING:
    from .findings import Finding, Findings, Ranked, Suspect
    from .prior import Prior, shares

__all__ = [
    "DEFAULT",
    "METHODS",
    "Finding",
    "Findings",
    "Method",
    "Prior",
    "Ranked",
    "Suspect",
    "method",
    "shares",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Finding": "findings",
        "Findings": "findings",
        "Ranked": "findings",
        "Suspect": "findings",
        "Prior": "prior",
        "shares": "prior",
    },
)
