"""A process that watches the working one: however that ends, the command says so.

An FMU in the working process can end it without a word: by a crash, or by exit(0), which looks like
success. The supervisor is the one that was started; it forks before the imports, does nothing but
wait, passes interrupts on, ends a process that does not follow them or in which an FMU hangs, and
returns the exit code. It reads what was being called from :mod:`cosim.process.run_state`. On systems
without fork() there is none.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress

from cybership.standard_streams import open_closed_streams

from ..interrupts import SIGNALS, leave_on_interrupt
from ..process.call_watch import LOOK as LOOK_AT_CALL
from ..process.call_watch import CallWatch
from ..process.run_state import CODE, ENDED, HELD, REQUESTS, STATE
from ..process.spawned import end_with_parent

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

# Two interrupts within this wall time [s] are one: ``timeout`` sends its signal to a process and to its
# group. Chosen: longer than that takes, shorter than between two presses of a key.
ONE_REQUEST = 0.1
# Wall time after an interrupt until a process that has not ended in order is killed [s]; chosen: enough
# for a step and the end of a run, and with what remains to be done a command ends within 2 s.
GRACE = 1.5
# Wall time between two looks at a process that is to be ended, while interrupts wait in it [s].
LOOK = 0.1
# Signals that would end the supervisor and mean nothing to it: an FMU may send them to its parent.
INDIFFERENT = ("SIGUSR1", "SIGUSR2", "SIGPIPE", "SIGQUIT", "SIGVTALRM", "SIGPROF", "SIGXCPU")


def supervised() -> None:
    """Go on in a process that this one watches; this one never returns."""
    sys.excepthook = end_without_extra
    open_closed_streams()
    if not hasattr(os, "fork"):
        leave_on_interrupt()
        return
    # What nohup has ignored stays so.
    asked = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    waited = (*asked, signal.SIGCHLD, signal.SIGALRM)
    signal.pthread_sigmask(signal.SIG_BLOCK, waited)
    for number in waited:
        signal.signal(number, lambda *_: None)  # what is ignored by default cannot be waited for
    STATE.watched = True
    watching = os.getpid()
    child = os.fork()
    if child:
        _Supervisor(child).run(waited)
    for number in waited:
        signal.signal(number, signal.SIG_DFL)
    leave_on_interrupt()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, waited)
    STATE.keep()
    end_with_parent(watching)


def end_without_extra(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Hook for an exception that ends a command; a library of an extra is named in one line.

    Commands catch their own exceptions, but not those of their imports.
    """
    from ..command import BAD_INPUT, complain, missing_extra  # only now: it takes a while to import

    line = missing_extra(error) if isinstance(error, ModuleNotFoundError) else None
    if line is None:
        sys.__excepthook__(kind, error, trace)
        return
    complain(line)
    STATE.end(BAD_INPUT)
    raise SystemExit(BAD_INPUT)


class _Supervisor:
    """The supervisor.

    Args:
        child: the working process.
    """

    def __init__(self, child: int) -> None:
        self._child, self._watch = child, CallWatch()
        self._last = -ONE_REQUEST
        for name in INDIFFERENT:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)

    def run(self, waited: Sequence[int]) -> None:
        """Wait for the end of the command, and exit with its code.

        Args:
            waited: interrupts, SIGCHLD and SIGALRM; all are blocked.
        """
        ended = status = 0
        signal.setitimer(signal.ITIMER_REAL, LOOK_AT_CALL, LOOK_AT_CALL)
        while not ended:
            # Not a handler beside waitpid(): one that is due just before that call would run after it.
            number = signal.sigwait(waited)
            if number in SIGNALS:
                self._pass_on(number)
            elif number == signal.SIGALRM and STATE.numbers[REQUESTS]:
                self._end_late()
            elif number == signal.SIGALRM:
                if self._watch.is_late():
                    self._send(signal.SIGKILL)
            else:
                ended, status = os.waitpid(self._child, os.WNOHANG)
        code = STATE.numbers[CODE]
        if not STATE.numbers[ENDED]:
            from .post_mortem import report  # only now: it takes a while to import

            if not STATE.numbers[REQUESTS]:
                time.sleep(ONE_REQUEST)  # a signal to all of the command ends the other process first
            code = report(os.waitstatus_to_exitcode(status), STATE.numbers[REQUESTS] > 0)
        os._exit(code)

    def _pass_on(self, number: int) -> None:
        now = time.monotonic()
        if now - self._last < ONE_REQUEST:
            return
        self._last = now
        STATE.numbers[REQUESTS] += 1
        if STATE.numbers[REQUESTS] == 1:
            signal.setitimer(signal.ITIMER_REAL, GRACE)
        self._send(number)

    def _end_late(self) -> None:
        """End a process that still runs; while it makes, moves or removes files it may finish that."""
        if STATE.numbers[HELD]:
            signal.setitimer(signal.ITIMER_REAL, LOOK)
        else:
            self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.kill(self._child, number)
