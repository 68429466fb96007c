"""Filters of system calls (seccomp(2)): those that a confined process may not make.

What processes of one user share beside files would let an instance of an FMU tell another one what it
was given: memory, queues and semaphores by a key, key rings, sockets, and processes that outlive it in
a session or group of their own. Namespaces hide these, Landlock does not. Submission queues (io_uring)
open files unseen by filters.
"""

from __future__ import annotations

import ctypes
import errno
import os
import platform
import struct
from collections.abc import Sequence

Instruction = tuple[int, int, int, int]  # code, places to jump if so, if not, and a number
LOAD, JUMP_IF_EQUAL, JUMP_IF_AT_LEAST, RETURN = 0x20, 0x15, 0x35, 0x06
ALLOW, NOTIFY, REFUSE = 0x7FFF0000, 0x7FC00000, 0x50000 | errno.EPERM
NUMBER, ARCHITECTURE = 0, 4  # places in a call
SET_FILTER = 1
FOREIGN = 0x40000000  # from here on numbers are of the 32-bit interface x32

MACHINE = platform.machine()
# Of linux/audit.h; numbers of seccomp, open (-1: there is none), openat, openat2.
ARCH, SECCOMP, OPENING = (
    (0xC000003E, 317, (2, 257, 437)) if MACHINE == "x86_64" else (0xC00000B7, 277, (-1, 56, 437))
)
# shmget, semget, msgget, mq_open, add_key, request_key, keyctl, socket, io_uring_setup, setpgid, setsid.
SHARING = {
    "x86_64": (29, 64, 68, 240, 248, 249, 250, 41, 425, 109, 112),
    "aarch64": (194, 190, 186, 180, 217, 218, 219, 198, 425, 154, 157),
}


def set_filter(lines: Sequence[Instruction], flags: int = 0) -> int:
    """Filter the system calls of this process from now on; returns what seccomp does.

    Raises:
        OSError: the system refuses.
    """
    code = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *line) for line in lines))
    program = struct.pack("@HxxxxxxQ", len(lines), ctypes.addressof(code))
    found = ctypes.CDLL(None, use_errno=True).syscall(SECCOMP, SET_FILTER, flags, program)
    if found < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return found


def refuse_sharing() -> None:
    """Refuse this process what it could share with others, and calls of other interfaces.

    Raises:
        OSError: the system refuses.
    """
    calls = SHARING.get(MACHINE)
    if calls is None:
        return
    lines = [(LOAD, 0, 0, ARCHITECTURE), (JUMP_IF_EQUAL, 0, len(calls) + 3, ARCH), (LOAD, 0, 0, NUMBER)]
    lines += [(JUMP_IF_AT_LEAST, len(calls) + 1, 0, FOREIGN)]
    lines += [(JUMP_IF_EQUAL, len(calls) - k, 0, n) for k, n in enumerate(calls)]
    set_filter([*lines, (RETURN, 0, 0, ALLOW), (RETURN, 0, 0, REFUSE)])
