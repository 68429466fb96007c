"""What another process must know of a command whose process has died: its files, and the last call.

The state lies in one block of memory. A command shares it with the process that watches it
(:mod:`cosim.supervision`); from Python it is written all the same, which costs less than a test whether
anybody reads it.
"""

from __future__ import annotations

import mmap
import os
import struct

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Sequence

# Bytes of the state; chosen: the description of a run of thousands of FMUs fits, and 256 rows of 30,000
# signals. Only the pages that are written take room.
SIZE = 2**26
# Texts: first byte and most bytes of each. A call is a name and a short text, a folder a path.
CALL, LATE, FOLDER, LAYOUT = (256, 2048), (2304, 2048), (8192, 8192), (2**15, 2**20)
CAMPAIGN, UNFINISHED = (2**14, 2**13), (3 * 2**13, 2**13)
NAMES, APART, DESCRIPTION = (2**21, 2**20), (3 * 2**20, 2**20), (2**22, 2**22)
ROWS = (2**23, SIZE - 2**23)  # the rows that are not in the log yet
LENGTH = struct.Struct("<I")
# Values of ``numbers[INSTANCE]`` that are no instance.
NOTHING, NAMED = -1, -2
# Places in ``numbers``.
INSTANCE, REQUESTS, ENDED, CODE, LOGGING, TAKEN, STEPS, HELD, CALLS, ALLOWED = range(10)


class RunState:
    """The state of a run, in memory that processes started by fork share.

    Attributes:
        numbers: whole numbers, by place: INSTANCE is the position in ``names`` of the FMU that the step
            loop is calling, NAMED if the call is the text CALL, or NOTHING; REQUESTS counts the
            interrupts that the supervisor has received; ENDED is 1 once the command has ended in
            order, with exit code CODE; LOGGING is 1 once the log is the run's own; TAKEN is the number
            of rows that wait in ROWS, and STEPS that of the rows before them, both at every base step;
            HELD is 1 while interrupts wait; CALLS is the base step that is under way; ALLOWED the
            longest wall time of a call [ms], 0 where none is given.
        watched: whether another process reads it.
    """

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, SIZE)
        self._octets = memoryview(self._memory)
        self.numbers = self._octets[: CALL[0]].cast("i")
        self.numbers[INSTANCE] = NOTHING
        self.watched = False

    def keep(self) -> None:
        """Share the memory with no further process: a copy that an FMU makes by fork would write, too.

        On Linux such a copy ends where it would write first; elsewhere at the end of a block of rows.
        """
        if hasattr(mmap, "MADV_DONTFORK"):
            self._memory.madvise(mmap.MADV_DONTFORK)

    def write(self, place: tuple[int, int], text: str) -> None:
        """Put a text in its place, cut to the room there."""
        first, room = place
        data = text.encode(errors="replace")[: room - LENGTH.size]
        LENGTH.pack_into(self._octets, first, 0)  # never a length of something that is half written
        self._octets[first + LENGTH.size : first + LENGTH.size + len(data)] = data
        LENGTH.pack_into(self._octets, first, len(data))

    def read(self, place: tuple[int, int]) -> str:
        """The text in a place; empty if there is none."""
        (length,) = LENGTH.unpack_from(self._octets, place[0])
        first = place[0] + LENGTH.size
        return bytes(self._octets[first : first + length]).decode(errors="replace")

    def pending(self, octets: int) -> tuple[memoryview, memoryview]:
        """Memory for rows that another process writes if this one dies, and numbers with their counts.

        Args:
            octets: how much is needed; more than there is, or memory that nobody watches, is private.
        """
        first, room = ROWS
        if self.watched and octets <= room:
            return self._octets[first : first + room], self.numbers
        return memoryview(bytearray(octets)), memoryview(bytearray(64)).cast("i")

    def steps(self, names: Sequence[str], apart: Sequence[str]) -> None:
        """From now on the step loop calls these instances, in this order.

        Args:
            names: of all.
            apart: of those with a process of their own.
        """
        self.write(NAMES, "\n".join(names))
        self.write(APART, "\n".join(apart))

    def is_apart(self, name: str) -> bool:
        """Whether an instance has a process of its own."""
        return name in self.read(APART).split("\n")

    @property
    def timeout(self) -> float | None:
        """Longest wall time that a call of an FMU may take [s]; None: by what a step usually takes."""
        return self.numbers[ALLOWED] / 1000.0 or None

    @timeout.setter
    def timeout(self, seconds: float | None) -> None:
        self.numbers[ALLOWED] = 0 if seconds is None else min(max(1, round(1000.0 * seconds)), 2**31 - 1)

    def unfinished(self, *paths: str | os.PathLike[str]) -> None:
        """Folders to remove if this process dies: the first with all that is in it, others if empty."""
        self.write(UNFINISHED, "\n".join(os.fspath(path) for path in paths))

    def begin(self, folder: str, description: str) -> None:
        """A run begins.

        Args:
            folder: of its results.
            description: what its log.json will say, but for how it ended; JSON.
        """
        fits = len(description) * 4 < DESCRIPTION[1]  # bytes of a character, at most
        self.write(DESCRIPTION, description if fits else "{}")
        self.numbers[LOGGING] = 0
        self.write(FOLDER, folder)

    def calls(self, instance: str, what: str) -> None:
        """A function of an FMU is being called outside of the step loop."""
        self.write(CALL, f"{instance}\n{what}")
        self.numbers[INSTANCE] = NAMED

    def calls_nothing(self) -> None:
        """No FMU is being called."""
        self.numbers[INSTANCE] = NOTHING

    def finish(self) -> None:
        """The run has ended, and its files are written."""
        self.calls_nothing()
        self.write(FOLDER, "")

    def end(self, code: int) -> None:
        """The command ends in order, with an exit code."""
        self.numbers[CODE] = code
        self.numbers[ENDED] = 1

    def call(self) -> tuple[str, str]:
        """The instance that was being called, and its function; empty if none was."""
        k = self.numbers[INSTANCE]
        if k == NAMED:
            name, _, what = self.read(CALL).partition("\n")
            return name, what
        names = self.read(NAMES).split("\n")
        return (names[k], "a step") if 0 <= k < len(names) else ("", "")


STATE = RunState()


class Owner:
    """The process that made something; an FMU may have copied it with everything in it (fork)."""

    def __init__(self) -> None:
        self._pid = os.getpid()

    def leave_copies(self) -> None:
        """End this process if it is a copy: it must not write what the original writes too."""
        if os.getpid() != self._pid:
            os._exit(0)
