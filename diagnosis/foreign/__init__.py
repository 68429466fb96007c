"""Models that this project did not make: FMUs for co-simulation, held against measured runs."""

from .fmu_windows import Use, evaluate_fmu, use_of
from .foreign_fmu import SUFFIX, Fmu, UnmatchedError

__all__ = ["SUFFIX", "Fmu", "UnmatchedError", "Use", "evaluate_fmu", "use_of"]
