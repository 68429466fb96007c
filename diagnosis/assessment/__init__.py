"""How wrong a model is, and where.

Prediction errors over windows of some seconds, regions in which the model error is larger than
elsewhere, and whether a learned model is stable.
"""

from ..model.uncertainty import omega_std
from .bands import LEVELS, Bands
from .evaluation import Evaluation, PredictionError, evaluate_run
from .regions import ErrorRegions, Profile, Region, find_regions
from .remainder import AxisRemainder, Remainder
from .stability import OperatingRegion, Stability, check_stability, least_dissipation
from .windows import WindowErrors, Windows, free_runs

__all__ = [
    "LEVELS",
    "AxisRemainder",
    "Bands",
    "ErrorRegions",
    "Evaluation",
    "OperatingRegion",
    "PredictionError",
    "Profile",
    "Region",
    "Remainder",
    "Stability",
    "WindowErrors",
    "Windows",
    "check_stability",
    "evaluate_run",
    "find_regions",
    "free_runs",
    "least_dissipation",
    "omega_std",
]
