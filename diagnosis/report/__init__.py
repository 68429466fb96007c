"""One page that shows where a model fails, what was learned, and how the error falls."""

from .curves import Curve
from .page import write_report

__all__ = ["Curve", "write_report"]
