"""Models that this project did not make: FMUs for co-simulation, held against measured runs."""

from .fmu_windows import (
    Use,
    at_samples,
    by_fmu,
    evaluate_fmu,
    predicted_windows,
    use_of,
    window_residuals,
)
from .foreign_fmu import SUFFIXES, Fmu, UnmatchedError
from .inverse import as_model
from .wrapper import write_wrapper

__all__ = [
    "SUFFIXES",
    "Fmu",
    "UnmatchedError",
    "Use",
    "as_model",
    "at_samples",
    "by_fmu",
    "evaluate_fmu",
    "predicted_windows",
    "use_of",
    "window_residuals",
    "write_wrapper",
]
