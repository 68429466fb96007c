"""Rows of numbers as lines of CSV, in C: the same bytes as orjson gives."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
import orjson

from .library import NoLibraryError, library

LONGEST = 25  # characters of a number and what follows it; of rows.c
# Numbers of every notation, to find out whether the installed orjson has the same.
PROBES = (
    0.0, -0.0, 1.0, -1.5, 0.1, 1e-4, 1.25e-5, 123456.0, 1e15, 1e16, 1.2e17, 1e22, 1e-9, 5e-324,
    2.0**-1022,
    1.7976931348623157e308, 1 / 3, 2.0**60, 0.3 - 0.1, 9007199254740993.0, 12345678.901234567, -1e-100,
)  # fmt: skip


class Rows(NamedTuple):
    """Rows of a log.

    Attributes:
        times: [s], float64, shape (rows,).
        table: values of all signals, float64, shape (rows, signals); those of a row are adjacent.
        slots: places in it of the logged signals, intp, shape (columns,).
    """

    times: np.ndarray
    table: np.ndarray
    slots: np.ndarray

    def block(self) -> np.ndarray:
        """Times and logged signals, shape (rows, 1 + columns), C-contiguous."""
        block = np.empty((len(self.times), 1 + len(self.slots)))
        block[:, 0] = self.times
        block[:, 1:] = self.table[:, self.slots]
        return block


# Lines, shape (bytes,), and the bytes up to the end of each, shape (rows,).
Lines = tuple[memoryview, np.ndarray]


@cache
def compiled_lines(with_zig: bool = False) -> Callable[[Rows], Lines] | None:
    """A function of rows; None where there is no library. The lines that it returns are valid until
    its next call.

    Args:
        with_zig: as in :func:`cosim.compiled.library.library`.
    """
    try:
        function = library(with_zig).format_rows
    except NoLibraryError:
        return None
    function.restype = None
    pointer, number = ctypes.c_void_p, ctypes.c_int64
    function.argtypes = [pointer, number, pointer, number, number, pointer, number, pointer, pointer]
    text = np.empty(0, np.uint8)

    def lines(rows: Rows) -> Lines:
        nonlocal text
        times, table, slots = rows.times, rows.table, rows.slots.astype(np.int64, copy=False)
        count, columns = len(times), len(slots)
        if len(text) < (room := LONGEST * count * (1 + columns)):
            text = np.empty(room, np.uint8)
        ends = np.empty(count, np.int64)
        function(
            times.ctypes.data,
            times.strides[0] // times.itemsize,
            table.ctypes.data,
            table.strides[0] // table.itemsize,
            count,
            slots.ctypes.data,
            columns,
            text.ctypes.data,
            ends.ctypes.data,
        )
        return text.data[: int(ends[-1]) if count else 0], ends

    probes = np.array([PROBES])
    expected = orjson.dumps(probes, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2] + b"\n"
    found, _ = lines(Rows(probes[:, 0], probes, np.arange(1, len(PROBES))))
    return lines if bytes(found) == expected else None
