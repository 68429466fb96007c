"""When Ctrl-C, a request to terminate and a closed terminal take effect.

A signal handler of Python runs between any two steps of the program, also between the creation of a
folder and the statement that remembers it. So a command leaves at once while it has nothing to clean up
(:func:`leave_on_interrupt`), and interrupts wait while it makes, moves or removes files (:class:`Held`).

A second process watches a command (:mod:`cosim.supervision`). A terminal sends signals to both, and the
supervisor passes on its own: what it has counted is a request of the user, what it knows nothing
of was sent to the working process alone, and ends it.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import contextmanager

from .process.run_state import HELD, REQUESTS, STATE

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping
    from types import FrameType
    from typing import Any, ClassVar

__all__ = [
    "INTERRUPTED",
    "SIGNALS",
    "Held",
    "ignore_interrupts",
    "leave_on_interrupt",
    "on_interrupt",
    "raise_if_interrupted",
    "raise_on_interrupt",
    "uninterrupted_processes",
]

INTERRUPTED = 130  # exit code: 128 + SIGINT, as shells have it
NAMES = ("SIGINT", "SIGTERM", "SIGHUP")
SIGNALS = tuple(getattr(signal, name) for name in NAMES if hasattr(signal, name))

# Longest wall time until the supervisor has counted a request that reached both processes, and in
# which the same request may reach this one again [s]; chosen: enough on a busy machine.
SETTLED = 1.0
# Wall time between two looks at that count [s]; chosen: not noticeable.
LOOK = 0.002


class _Requests:
    """Which signals are requests of the user."""

    def __init__(self) -> None:
        self._handled, self._last = 0, -SETTLED

    def is_new(self, number: int) -> bool:
        """Whether a signal is a request that has not been handled; ends the process if it is none."""
        if not STATE.watched:
            return True
        until = time.monotonic() + SETTLED
        while STATE.numbers[REQUESTS] == self._handled:
            now = time.monotonic()
            if now - self._last < SETTLED:
                return False
            if now > until:
                signal.signal(number, signal.SIG_DFL)
                os.kill(os.getpid(), number)
            time.sleep(LOOK)
        self._handled, self._last = STATE.numbers[REQUESTS], time.monotonic()
        return True


_requests = _Requests()


def on_interrupt(action: Callable[[], object]) -> dict[int, Any]:
    """From now on an interrupt does something.

    Args:
        action: what to do.

    Returns:
        The handlers until now, for :func:`restore`.
    """

    def handle(number: int, frame: FrameType | None) -> None:
        if _requests.is_new(number):
            action()

    before = {number: signal.getsignal(number) for number in SIGNALS}
    restore(dict.fromkeys(SIGNALS, handle))
    return before


def restore(handlers: Mapping[int, Any]) -> None:
    """Have interrupts handled so, but for those that are ignored, as nohup does."""
    for number, handler in handlers.items():
        if handler is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def leave_on_interrupt() -> None:
    """From now on an interrupt ends the process at once: for imports, which leave nothing."""
    on_interrupt(_leave)


def _leave() -> None:
    os.write(2, b"interrupted\n")
    STATE.end(INTERRUPTED)
    os._exit(INTERRUPTED)


_interrupted = False  # whether an interrupt has raised since raise_on_interrupt


def raise_on_interrupt() -> None:
    """From now on an interrupt raises KeyboardInterrupt, and is remembered."""
    global _interrupted
    _interrupted = False
    on_interrupt(_raise)


def hide_lost_interrupts() -> None:
    """From now on nothing is printed where an interrupt is lost, see :func:`raise_if_interrupted`."""
    sys.unraisablehook = _show_unraisable


def _show_unraisable(lost: sys.UnraisableHookArgs) -> None:
    if not (_interrupted and issubclass(lost.exc_type, KeyboardInterrupt)):
        sys.__unraisablehook__(lost)


def _raise() -> None:
    global _interrupted
    _interrupted = True
    if STATE.watched and (log := sys.modules.get("logging")):
        log.disable()  # libraries would tell how their threads and connections end
    raise KeyboardInterrupt


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt again if an interrupt was lost.

    Where Python runs a callback of C, as in some imports and destructors, an exception goes nowhere.
    """
    if _interrupted:
        raise KeyboardInterrupt


def has_interrupted() -> bool:
    """Whether an interrupt has raised since :func:`raise_on_interrupt`."""
    return _interrupted


def was_lost() -> bool:
    """Whether an interrupt has raised, though the program goes on; asked once, then forgotten."""
    global _interrupted
    lost, _interrupted = _interrupted, False
    return lost


def ignore_interrupts() -> None:
    """From now on Ctrl-C does nothing: the command has ended but for its exit code."""
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)


class Held:
    """Interrupts that arrive inside wait, but where :meth:`allow` lets them act.

    At the end a waiting one acts, unless :meth:`finish` was called: then it came too late, or waits in
    the enclosing ``Held``, which holds from there on. In another thread than the main one, which
    signals do not interrupt, nothing happens.
    """

    _innermost: ClassVar[Held | None] = None

    def __init__(self) -> None:
        self._waiting: list[int] = []
        self._finished = False
        self._before: dict[int, Any] = {}
        self._acting: Mapping[int, Any] = {}
        self._outer: Held | None = None
        self._was_held = 0

    def __enter__(self) -> Held:
        import threading

        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.getsignal(number) for number in SIGNALS}
            self._outer, self._was_held = Held._innermost, STATE.numbers[HELD]
            self._acting = self._outer._acting if self._outer else self._before
            Held._innermost = self
            self.hold()
        return self

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if not self._before:
            return
        self.hold()
        Held._innermost = self._outer
        if self._finished and self._outer:
            self._outer._waiting += self._waiting
            self._outer.hold()
            return
        restore(self._before)
        STATE.numbers[HELD] = self._was_held
        if not self._finished and error is None:
            self.act()

    def hold(self) -> None:
        """Interrupts wait."""
        restore(dict.fromkeys(self._before, self._wait))
        STATE.numbers[HELD] = bool(self._before)

    def allow(self) -> None:
        """Interrupts act, those that waited at once."""
        restore(self._acting)
        STATE.numbers[HELD] = 0
        self.act()

    def act(self) -> None:
        """Raise KeyboardInterrupt if an interrupt waits, or was lost."""
        raise_if_interrupted()
        if self._waiting:
            self._waiting.clear()
            raise KeyboardInterrupt

    def finish(self) -> None:
        """What was to be done is done: interrupts come too late."""
        self._finished = True

    def _wait(self, number: int, frame: FrameType | None) -> None:
        self._waiting.append(number)


@contextmanager
def uninterrupted_processes() -> Iterator[None]:
    """Processes that are started inside never see SIGINT, which a terminal sends to all of a command.

    They inherit the mask of this thread. Windows has no such masks.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
