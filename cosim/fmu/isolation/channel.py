"""The protocol between master and process of an isolated FMU: frames of a kind and bytes, over pipes.

Frames hold numbers and JSON, never code, because the process runs an untrusted program.
"""

import json
import struct
import threading
from typing import IO, Any, NamedTuple

# Requests: a call as JSON [name, arguments...], or an exchange of values, see MOVE_HEAD.
CALL, MOVE = 0, 1
# Answers: the bytes requested, a failed run, refused input; LOG may precede any of them.
DONE, FAILED, REFUSED, LOG = 0, 1, 2, 3
# What to do (flags) and the time [s]; the inputs follow, if they are to be set.
MOVE_HEAD = struct.Struct("<Bd")
PUT, STEP, GET = 1, 2, 4

_FRAME = struct.Struct("<BI")
LONGEST = 2**28  # bytes of a frame; chosen: 33 million doubles, beyond any FMU

# Size of an output, in its unit, of a prediction that has diverged; chosen: its square is still finite.
DIVERGED = 1e50


class FeedbackTerm(NamedTuple):
    """What is added to an input before each step: ``coefficient`` times ``y |y|^(power - 1)``.

    With a ``turn`` y is ``cos(turn * output + phase)``.

    Attributes:
        input: its number.
        output: number of the output y.
        power: 0: the term is constant.
        rate: whether y is the output's derivative by time, from the last two steps.
        coefficient: in units of the input and of y.
        turn: angle by the output [rad by its unit]; 0: y is the output.
        phase: [rad].
    """

    input: int
    output: int
    power: int
    rate: bool
    coefficient: float
    turn: float = 0.0
    phase: float = 0.0


class GarbledError(Exception):
    """The bytes received are no frame: something else has written to the pipe."""


class Channel:
    """One end of the connection.

    Args:
        reader, writer: buffered binary files.
    """

    def __init__(self, reader: IO[bytes], writer: IO[bytes]) -> None:
        self._reader = reader
        self._writer = writer
        # FMUs may log from threads of their own.
        self._lock = threading.Lock()

    def send(self, kind: int, body: bytes = b"") -> None:
        """Send a frame at once."""
        with self._lock:
            self._writer.write(_FRAME.pack(kind, len(body)) + body)
            self._writer.flush()

    def send_json(self, kind: int, content: Any) -> None:
        """Send JSON; Python's json restores every double to the bit, NaN and infinity included."""
        self.send(kind, json.dumps(content).encode())

    def receive(self) -> tuple[int, bytes]:
        """Wait for a frame.

        Raises:
            EOFError: the other end has closed the pipe.
            GarbledError: the bytes received are no frame.
        """
        head = self._reader.read(_FRAME.size)
        if len(head) < _FRAME.size:
            raise EOFError
        kind, length = _FRAME.unpack(head)
        if kind > LOG or length > LONGEST:
            raise GarbledError
        body = self._reader.read(length) if length else b""
        if len(body) < length:
            raise EOFError
        return kind, body
