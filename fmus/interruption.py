"""Ctrl-C and requests to terminate, for the commands of this package."""

from __future__ import annotations

import os
import signal
import sys

from cybership.standard_streams import code_of

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import NoReturn

INTERRUPTED = 130  # exit code; 128 + SIGINT, as shells have it
# Wall time that an interrupted command has to end what it began [s]; then it ends at once. Chosen: with
# that, and the end of the process, it has ended within 2 s, also where Python has lost the interrupt.
GRACE = 1.5
SIGNALS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]


def _on_interrupt(action: Callable[..., object] | signal.Handlers) -> None:
    for number in SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:  # as for nohup
            signal.signal(number, action)


def leave_on_interrupt() -> None:
    """From now on an interrupt ends the process at once: for imports, which leave nothing."""
    _on_interrupt(_leave)


def _leave(*_: object) -> NoReturn:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)


def _raise(*_: object) -> NoReturn:
    """Once only: a second Ctrl-C must not keep the first from ending what was begun."""
    _on_interrupt(signal.SIG_IGN)
    if hasattr(signal, "setitimer"):  # Windows has none
        signal.signal(signal.SIGALRM, _leave)
        signal.setitimer(signal.ITIMER_REAL, GRACE)
    raise KeyboardInterrupt


def run_interruptible(main: Callable[[], int]) -> NoReturn:
    """Run a command and exit with its code, or with that of an interrupt."""
    try:
        _on_interrupt(_raise)
        try:
            code = code_of(main)
        finally:
            _on_interrupt(signal.SIG_IGN)
            if hasattr(signal, "setitimer"):
                signal.setitimer(signal.ITIMER_REAL, 0.0)
    except KeyboardInterrupt:
        _leave()  # past what libraries do at exit, which may wait
    sys.exit(code)
