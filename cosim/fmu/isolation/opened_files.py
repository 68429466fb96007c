"""Which files a confined process opens, by notifications of its system calls (seccomp_unotify(2)).

They refuse nothing, that is for :mod:`.confinement`: they show what was tried, refused or not.
"""

from __future__ import annotations

import array
import os
import posixpath
import socket
import struct
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress

from .system_calls import (
    ALLOW,
    ARCH,
    ARCHITECTURE,
    JUMP_IF_EQUAL,
    LOAD,
    NOTIFY,
    NUMBER,
    OPENING,
    RETURN,
    set_filter,
)

NEW_LISTENER, CONTINUE = 1 << 3, 1  # of linux/seccomp.h
RECEIVE, ANSWER = 0xC0502100, 0xC0182101
NOTICE, REPLY = struct.Struct("=QIIiIQ6Q"), struct.Struct("=QqiI")
LONGEST = 4096  # bytes of a path
USUAL = (
    "/dev",
    "/sys",
    "/run",
    "/proc",
    "/var/lib/libuuid",
)  # what libraries look at, and what is not the user's


def install(to: socket.socket) -> None:
    """Have the master of this process notified of each file that it opens from now on.

    Args:
        to: connection to the master, which gets the listener.

    Raises:
        OSError: the system refuses.
    """
    calls = [n for n in OPENING if n >= 0]
    lines = [(LOAD, 0, 0, ARCHITECTURE), (JUMP_IF_EQUAL, 0, len(calls) + 1, ARCH), (LOAD, 0, 0, NUMBER)]
    lines += [(JUMP_IF_EQUAL, len(calls) - k, 0, n) for k, n in enumerate(calls)]
    listener = set_filter([*lines, (RETURN, 0, 0, ALLOW), (RETURN, 0, 0, NOTIFY)], NEW_LISTENER)
    socket.send_fds(to, [b"l"], [listener])
    os.close(listener)


class OpenedFiles:
    """Receives the notifications of one process, in a thread of its own, until that has ended.

    Args:
        connection: over which the listener comes.
        allowed: folders that it may open.
        found: receives the path of each other file.
    """

    def __init__(
        self, connection: socket.socket, allowed: Sequence[str], found: Callable[[str], None]
    ) -> None:
        self._connection, self._found = connection, found
        self._allowed = tuple(f"{folder.rstrip('/')}/" for folder in (*allowed, *USUAL))
        threading.Thread(target=self._serve, name="opened files", daemon=True).start()

    def _serve(self) -> None:
        with self._connection, suppress(OSError):
            _, listeners, *_ = socket.recv_fds(self._connection, 1, 1)
            for listener in listeners:
                try:
                    self._listen(listener)
                finally:
                    os.close(listener)

    def _listen(self, listener: int) -> None:
        import fcntl

        while True:
            notice = array.array("B", bytes(NOTICE.size))
            try:
                fcntl.ioctl(listener, RECEIVE, notice)
            except FileNotFoundError:  # it was interrupted, or the process has ended
                if self._connection.fileno() < 0 or _ended(listener):
                    return
                continue
            identity, pid, _, number, _, _, *arguments = NOTICE.unpack(notice)
            path = _text(pid, arguments[0 if number == OPENING[0] else 1])
            self._look(path)
            with suppress(FileNotFoundError):
                fcntl.ioctl(listener, ANSWER, REPLY.pack(identity, 0, 0, CONTINUE))

    def _look(self, path: str) -> None:
        full = posixpath.normpath(path) if path.startswith("/") else "/"
        of_process = full.startswith("/proc/") and full.split("/")[2].isdigit()
        folder = f"{full.rstrip('/')}/"  # on the way to what may be opened, too
        known = folder.startswith(self._allowed) or any(a.startswith(folder) for a in self._allowed)
        if of_process or not known:
            self._found(full)


def _ended(listener: int) -> bool:
    import select

    poll = select.poll()
    poll.register(listener, select.POLLIN)
    return any(event & select.POLLHUP for _, event in poll.poll(0))


def _text(pid: int, address: int) -> str:
    """A text of another process; empty where it cannot be read."""
    with suppress(OSError, ValueError, OverflowError):
        memory = os.open(f"/proc/{pid}/mem", os.O_RDONLY | os.O_CLOEXEC)
        try:
            data = os.pread(memory, 256, address)
            if b"\0" not in data:
                data += os.pread(memory, LONGEST, address + len(data))
            return data.partition(b"\0")[0].decode(errors="replace")
        finally:
            os.close(memory)
    return ""
