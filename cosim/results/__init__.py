"""Results of a run: log, metrics, pictures."""

from typing import TYPE_CHECKING

from ..lazy import lazy_names

if TYPE_CHECKING:
    from .canvas import thin
    from .drawing import draw
    from .log import Log, read_log
    from .log_frame import log_frame
    from .performance import MetricsError, compute, over_time, tracking
    from .picture_files import Drawn
    from .run_options import read_options
    from .track import hulls

__all__ = [
    "Drawn",
    "Log",
    "MetricsError",
    "compute",
    "draw",
    "hulls",
    "log_frame",
    "over_time",
    "read_log",
    "read_options",
    "thin",
    "tracking",
]

__getattr__ = lazy_names(
    __name__,
    {
        "Drawn": "picture_files",
        "Log": "log",
        "MetricsError": "performance",
        "compute": "performance",
        "draw": "drawing",
        "hulls": "track",
        "log_frame": "log_frame",
        "over_time": "performance",
        "read_log": "log",
        "read_options": "run_options",
        "thin": "canvas",
        "tracking": "performance",
    },
)
