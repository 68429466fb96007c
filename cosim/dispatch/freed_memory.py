"""What becomes of memory that a run has freed."""

import ctypes
from contextlib import suppress

# Of glibc's mallopt: how much free memory at the end of the heap goes back to the system, and from
# which size on a block is not of the heap.
TRIM_THRESHOLD, MMAP_THRESHOLD = -1, -3
# Memory [bytes] that stays with the process; chosen: above what a run of some hours keeps of its log.
KEPT = 64 * 2**20
# The largest block that glibc lets be of the heap [bytes].
BLOCK = 32 * 2**20


def keep_freed_memory() -> None:
    """Have memory that a run frees wait in this process for the next run.

    Else the C library gives it back to the system after each run and gets it again page by page, which
    takes a tenth of the time of a short run. Nothing happens where the C library is not glibc.
    """
    with suppress(OSError, AttributeError, TypeError):
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(TRIM_THRESHOLD, KEPT)
        mallopt(MMAP_THRESHOLD, BLOCK)
