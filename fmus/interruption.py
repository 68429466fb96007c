"""Ctrl-C, requests to terminate and the usage line, for the commands of this package."""

import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

BAD_INPUT, INTERRUPTED = 2, 130  # exit codes; 128 + SIGINT, as shells have it
SIGNALS = [getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]


def _on_interrupt(action: Callable[..., object]) -> None:
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
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def program(module: str) -> str:
    """The name of a command in its usage line: ``cybership NAME`` if that began it."""
    return sys.argv[0] if sys.argv[0].startswith("cybership ") else f"python -m {module}"


def run_interruptible(main: Callable[[], int]) -> NoReturn:
    """Run a command and exit with its code, or with that of an interrupt."""
    _on_interrupt(_raise)
    try:
        code = main()
    except KeyboardInterrupt:
        sys.stderr.write("interrupted\n")
        code = INTERRUPTED
    except OSError as error:
        sys.stderr.write(f"error: {error}\n")
        code = BAD_INPUT
    sys.exit(code)
