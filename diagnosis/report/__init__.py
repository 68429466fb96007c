"""One page that shows where a model fails, what was learned, and how the error falls."""

from .page import write_report
from .shape import Curve, curves

__all__ = ["Curve", "curves", "write_report"]
