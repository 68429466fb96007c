"""Measured runs: read from files of any form, their samples judged."""

from .beside import line_beside
from .cleaning import Counts, Track, clean, in_order, lost, repeated
from .other_columns import other_columns
from .proposal import propose
from .reading import Run, read, read_frame
from .run_table_file import layout_beside, table_of
from .ship_of_logs import ship_of_logs
from .thinning import thinned

__all__ = [
    "Counts",
    "Run",
    "Track",
    "clean",
    "in_order",
    "layout_beside",
    "line_beside",
    "lost",
    "other_columns",
    "propose",
    "read",
    "read_frame",
    "repeated",
    "ship_of_logs",
    "table_of",
    "thinned",
]
