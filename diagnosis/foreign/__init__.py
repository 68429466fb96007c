"""Models that this project did not make: FMUs for co-simulation, held against measured runs."""

from .fmu_windows import Use, by_fmu, evaluate_fmu, use_of
from .foreign_fmu import SUFFIXES, Fmu, UnmatchedError
from .inverse import as_model
from .wrapper import write_wrapper

__all__ = [
    "SUFFIXES",
    "Fmu",
    "UnmatchedError",
    "Use",
    "as_model",
    "by_fmu",
    "evaluate_fmu",
    "use_of",
    "write_wrapper",
]
