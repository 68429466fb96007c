"""The process of an isolated FMU as the master sees it: its pipes, its end, and what it prints."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import IO, Protocol

from cybership.message_text import printable

# An escape sequence of a terminal (ECMA-48), and the title of its window.
ESCAPE = re.compile(r"\x1b(\[[0-?]*[ -/]*[@-~]|\][^\x07\x1b]*(\x07|\x1b\\)|[@-Z\\^_])")
# What is shown of what one FMU prints; chosen: enough for a message, and no screen is lost by it.
LONGEST_PRINTED, MOST_PRINTED = 200, 100  # characters of a line, lines
# Wall time for the last words of a process that has ended [s]; what it has started may keep the pipe.
LAST_WORDS = 1.0
KILLED = -9


class WorkerProcess(Protocol):
    """A process that :func:`cosim.fmu.isolation.worker.serve` runs in: its pipes, and its end."""

    @property
    def reader(self) -> IO[bytes]: ...
    @property
    def writer(self) -> IO[bytes]: ...
    @property
    def printed(self) -> IO[bytes]: ...

    def wait(self, timeout: float) -> int:
        """Exit code, negative for a signal.

        Raises:
            subprocess.TimeoutExpired: it still runs.
        """
        ...

    def kill(self) -> None:
        """End it with all processes that the FMU has started."""
        ...


class StartedProcess:
    """A process that is started for one FMU and may do what the user may.

    Args:
        folder: its working directory; None: that of this process.
        environment: None: that of this process.
    """

    def __init__(self, folder: Path | None = None, environment: Mapping[str, str] | None = None) -> None:
        # A session of its own: Ctrl-C reaches the master only, and children end with their parent.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "cosim.fmu.isolation.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            start_new_session=True,
            cwd=folder,
            env=environment,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self.writer, self.reader = self._process.stdin, self._process.stdout
        self.printed = self._process.stderr

    def wait(self, timeout: float) -> int:
        return self._process.wait(timeout)

    def kill(self) -> None:
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self._process.pid, signal.SIGKILL)
            else:
                self._process.kill()


class ForkedProcess:
    """A process that a fork server has made.

    Args:
        server: connection to it.
        folder: the only one that the process may write to.

    Attributes:
        opened: connection over which it says what it opens.
    """

    def __init__(self, server: socket.socket, folder: Path) -> None:
        pairs = [os.pipe() for _ in range(4)]
        (requests, mine), *others = pairs
        self.opened, notices = socket.socketpair()
        theirs = [requests, *(writer for _, writer in others)]
        try:
            socket.send_fds(server, [json.dumps(str(folder)).encode()], [*theirs, notices.fileno()])
            answer = server.recv(32)
        finally:
            notices.close()
            for pipe in theirs:
                os.close(pipe)
        self.writer = os.fdopen(mine, "wb")
        self.reader, self.printed, self._ended = (os.fdopen(reader, "rb") for reader, _ in others)
        if not answer:
            raise OSError("the process that makes it has ended")
        self._pid, self._code = int(answer), None

    def wait(self, timeout: float) -> int:
        if self._code is None:
            if not select.select([self._ended], [], [], timeout)[0]:
                raise subprocess.TimeoutExpired("fork_server", timeout)
            # Nothing where the first process was ended, and the others with it.
            self._code = int(self._ended.read() or KILLED)
            self._ended.close()
        return self._code

    def kill(self) -> None:
        # Its number is free for another process once it has ended.
        if self._code is None:
            with suppress(OSError):
                os.killpg(self._pid, signal.SIGKILL)


class Printed:
    """Passes on what a process prints: line by line, shortened, without escape codes.

    Args:
        pipe: of the process.
        show: receives each line.
    """

    def __init__(self, pipe: IO[bytes], show: Callable[[str], None]) -> None:
        self._pipe, self._show = pipe, show
        self._thread = threading.Thread(target=self._pass_on, name="printed", daemon=True)
        self._thread.start()

    def _pass_on(self) -> None:
        count = 0
        with suppress(OSError, ValueError):  # the pipe is closed at the end
            while line := self._pipe.readline(16 * LONGEST_PRINTED):
                count += 1
                if count <= MOST_PRINTED:
                    self._show(cleaned(line.decode(errors="replace")))
        if count > MOST_PRINTED:
            self._show(f"... and {count - MOST_PRINTED} more lines")

    def finish(self) -> None:
        """Wait for the last words of a process that has ended."""
        self._thread.join(LAST_WORDS)
        if not self._thread.is_alive():
            self._pipe.close()


def cleaned(line: str) -> str:
    """A line as it is shown."""
    text = printable(ESCAPE.sub("", line).rstrip())
    return text if len(text) <= LONGEST_PRINTED else f"{text[: LONGEST_PRINTED - 3]}..."
