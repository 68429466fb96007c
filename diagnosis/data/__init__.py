"""Measured runs: read from files of any form, their samples judged."""

from .beside import line_beside
from .cleaning import Counts, Track, clean, in_order, lost, repeated
from .columns import OF_UNIT, QUANTITY, Column, to_si
from .other_columns import other_columns
from .proposal import meaning, propose
from .reading import Run, read, read_frame
from .run_table_file import layout_beside, table_of
from .ship_of_logs import ship_of_logs
from .thinning import thinned
from .unit_factors import UNITS

__all__ = [
    "OF_UNIT",
    "QUANTITY",
    "UNITS",
    "Column",
    "Counts",
    "Run",
    "Track",
    "clean",
    "in_order",
    "layout_beside",
    "line_beside",
    "lost",
    "meaning",
    "other_columns",
    "propose",
    "read",
    "read_frame",
    "repeated",
    "ship_of_logs",
    "table_of",
    "thinned",
    "to_si",
]
