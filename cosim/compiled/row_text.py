"""Rows of numbers as lines of CSV, in C: the same bytes as orjson gives."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache

import numpy as np
import orjson

from .library import NoLibraryError, library

LONGEST = 25  # characters of a number and what follows it; of rows.c
# Numbers of every notation, to find out whether the installed orjson has the same.
PROBES = (
    0.0, -0.0, 1.0, -1.5, 0.1, 1e-4, 1.25e-5, 123456.0, 1e15, 1e16, 1.2e17, 1e22, 1e-9, 5e-324, 2.0**-1022,
    1.7976931348623157e308, 1 / 3, 2.0**60, 0.3 - 0.1, 9007199254740993.0, 12345678.901234567, -1e-100,
)  # fmt: skip

# Lines and, behind each line, its end included, the bytes so far; shapes (bytes,), (rows,).
Lines = tuple[memoryview, np.ndarray]


@cache
def compiled_lines(with_zig: bool = False) -> Callable[[np.ndarray], Lines] | None:
    """A function of rows, shape (rows, columns), float64, C-contiguous; None where there is no library.

    The lines that it returns are valid until its next call.

    Args:
        with_zig: as in :func:`cosim.compiled.library.library`.
    """
    try:
        function = library(with_zig).format_rows
    except NoLibraryError:
        return None
    function.restype = None
    function.argtypes = [ctypes.c_void_p, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p]
    text = np.empty(0, np.uint8)

    def lines(block: np.ndarray) -> Lines:
        nonlocal text
        rows, columns = block.shape
        if len(text) < LONGEST * rows * columns:
            text = np.empty(LONGEST * rows * columns, np.uint8)
        ends = np.empty(rows, np.int64)
        function(block.ctypes.data, rows, columns, text.ctypes.data, ends.ctypes.data)
        return memoryview(text)[: int(ends[-1]) if rows else 0], ends

    probes = np.array([PROBES])
    expected = orjson.dumps(probes, option=orjson.OPT_SERIALIZE_NUMPY)[2:-2] + b"\n"
    return lines if bytes(lines(probes)[0]) == expected else None
