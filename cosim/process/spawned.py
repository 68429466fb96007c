"""Processes that are started from a user's program: they do not run it again, and end with it."""

from __future__ import annotations

import os
import signal
import sys
from contextlib import contextmanager, suppress
from importlib.machinery import ModuleSpec

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Iterator

PR_SET_PDEATHSIG = 1  # of Linux' prctl(2)


def die_with_parent() -> None:
    """Have this process killed when the one that has made it ends (on Linux)."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def end_with_parent(parent: int) -> None:
    """The same, also where that process has ended before."""
    die_with_parent()
    if sys.platform == "linux" and os.getppid() != parent:
        os._exit(1)


def ending(code: int) -> str:
    """How a process ended, as text, by its exit code; negative for a signal, as subprocess has it."""
    if code >= 0:
        return f"exit code {code}"
    with suppress(ValueError):
        return f"signal {-code}, {signal.Signals(-code).name}"
    return f"signal {-code}"


def mute_started_processes() -> None:
    """From now on what processes started by this one write to standard error is not shown.

    Workers that end while they start, or before the one that has started them, would add tracebacks to
    the line that says why a command ends.
    """
    shown = os.dup(2)  # not inherited
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    sys.stderr = open(shown, "w", 1, sys.stderr.encoding, sys.stderr.errors)  # noqa: SIM115


@contextmanager
def without_program() -> Iterator[None]:
    """Processes that multiprocessing spawns inside do not import the program that spawns them.

    They would run a plain script again that has no ``if __name__ == "__main__":``.
    A specification by the name ``__main__`` is what multiprocessing takes for a program that needs no
    import. A program that was started as a module (``python -m``) is left as it is.
    """
    program = sys.modules["__main__"]
    if getattr(program, "__spec__", None) is not None:
        yield
        return
    program.__spec__ = ModuleSpec("__main__", None)
    try:
        yield
    finally:
        program.__spec__ = None
