"""How the master and the process of an isolated FMU talk: frames, a kind and some bytes, over pipes.

What arrives is numbers and JSON, never code: the process runs a program of somebody else.
"""

import json
import struct
import threading
from typing import IO, Any

# Requests: a call as JSON [name, arguments...], or values that move, see MOVE_HEAD.
CALL, MOVE = 0, 1
# Answers: bytes asked for, a run that failed, input that is refused; LOG may come before any of them.
DONE, FAILED, REFUSED, LOG = 0, 1, 2, 3
# What to do (flags) and the time [s]; then follow the inputs, if they are to be set.
MOVE_HEAD = struct.Struct("<Bd")
PUT, STEP, GET = 1, 2, 4

_FRAME = struct.Struct("<BI")
LONGEST = 2**28  # bytes of a frame


class GarbledError(Exception):
    """What arrived is no frame: somebody else has written to the pipe."""


class Channel:
    """One end of the conversation.

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
        """Send JSON; Python's own reads back every double to the bit, NaN and infinity included."""
        self.send(kind, json.dumps(content).encode())

    def receive(self) -> tuple[int, bytes]:
        """Await a frame.

        Raises:
            EOFError: the other end is gone.
            GarbledError: what arrived is no frame.
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
