"""Results of the diagnosis for people and programs: JSON content, terminal output, one HTML page."""

from .content import comparison_content, diagnosis_content, write_coefficients
from .page import write_report
from .result_keys import ComparisonContent, DiagnosisContent
from .shape import Curve, curves
from .terminal import show_comparison, show_diagnosis

__all__ = [
    "ComparisonContent",
    "Curve",
    "DiagnosisContent",
    "comparison_content",
    "curves",
    "diagnosis_content",
    "show_comparison",
    "show_diagnosis",
    "write_coefficients",
    "write_report",
]
