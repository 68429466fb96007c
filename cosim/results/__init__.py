"""Results of a run: log, metrics, pictures."""

from typing import TYPE_CHECKING

from ..lazy import lazy_names

if TYPE_CHECKING:
    from .canvas import thin
    from .drawing import draw
    from .log import Log, read_log
    from .performance import MetricsError, compute, over_time, tracking

__all__ = ["Log", "MetricsError", "compute", "draw", "over_time", "read_log", "thin", "tracking"]

__getattr__ = lazy_names(
    __name__,
    {
        "Log": "log",
        "MetricsError": "performance",
        "compute": "performance",
        "draw": "drawing",
        "over_time": "performance",
        "read_log": "log",
        "thin": "canvas",
        "tracking": "performance",
    },
)
