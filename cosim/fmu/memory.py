"""The memory of doubles through which FMUs and the master exchange values."""

import ctypes
from dataclasses import dataclass

from .fmu_model import FmuVariable


class DoubleMemory:
    """Doubles that FMUs read and write.

    Args:
        count: how many.
    """

    def __init__(self, count: int) -> None:
        self._memory = (ctypes.c_double * max(1, count))()
        self.address = ctypes.addressof(self._memory)
        self.octets = memoryview(self._memory).cast("B")
        self.values = self.octets.cast("d")


@dataclass(frozen=True)
class Port:
    """A variable and its place in a memory."""

    variable: FmuVariable
    slot: int
