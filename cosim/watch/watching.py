"""A process that watches the simulating one: however that ends, the command says so.

An FMU in the simulating process can end it without a word: by a crash, or by exit(0), which looks like
success. The watching process is the one that was started; it forks before the imports, does nothing but
wait, passes interrupts on, and returns the exit code of the run. It reads what was being called from
:mod:`cosim.process.run_state`. On systems without fork() there is none.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from contextlib import suppress

from ..interrupts import SIGNALS, leave_on_interrupt
from ..process.run_state import CODE, ENDED, INSTANCE, NOTHING, REQUESTS, STATE

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import FrameType

# Two interrupts within this wall time [s] are one: ``timeout`` sends its signal to a process and to its
# group. Chosen: longer than that takes, shorter than between two presses of a key.
ONE_REQUEST = 0.1
# Wall time [s] that an FMU may go on after the second interrupt before its process is ended; chosen: the
# end of a Python FMU, which the interrupt reaches, takes less.
GRACE = 1.0
# Signals that would end the watching process and mean nothing to it: an FMU may send them to its parent.
INDIFFERENT = ("SIGUSR1", "SIGUSR2", "SIGPIPE", "SIGQUIT", "SIGVTALRM", "SIGPROF", "SIGXCPU")
PR_SET_PDEATHSIG = 1  # of Linux' prctl(2)


def watched() -> None:
    """Go on in a process that this one watches; this one never returns."""
    if not hasattr(os, "fork"):
        leave_on_interrupt()
        return
    # What nohup has ignored stays so.
    asked = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    waited = (*asked, signal.SIGCHLD, signal.SIGALRM)
    signal.pthread_sigmask(signal.SIG_BLOCK, waited)
    for number in waited:
        signal.signal(number, _no_action)  # what is ignored by default cannot be waited for
    STATE.watched = True
    watching = os.getpid()
    child = os.fork()
    if child:
        _Watch(child).run(waited)
    for number in waited:
        signal.signal(number, signal.SIG_DFL)
    leave_on_interrupt()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, waited)
    STATE.keep()
    _end_with(watching)


def _no_action(number: int, frame: FrameType | None) -> None:
    """Handler that does nothing."""


def _end_with(watching: int) -> None:
    """Have this process end when the watching one is killed."""
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != watching:
            os._exit(1)


class _Watch:
    """The watching process.

    Args:
        child: the simulating process.
    """

    def __init__(self, child: int) -> None:
        self._child = child
        self._last = -ONE_REQUEST
        for name in INDIFFERENT:
            if hasattr(signal, name):
                signal.signal(getattr(signal, name), signal.SIG_IGN)

    def run(self, waited: Sequence[int]) -> None:
        """Wait for the end of the run, and exit with its code.

        Args:
            waited: interrupts, SIGCHLD and SIGALRM; all are blocked.
        """
        ended = status = 0
        while not ended:
            # Not a handler beside waitpid(): one that is due just before that call would run after it.
            number = signal.sigwait(waited)
            if number in SIGNALS:
                self._pass_on(number)
            elif number == signal.SIGALRM:
                self._end_hanging()
            else:
                ended, status = os.waitpid(self._child, os.WNOHANG)
        code = STATE.numbers[CODE]
        if not STATE.numbers[ENDED]:
            from .post_mortem import report  # only now: it takes a while to import

            time.sleep(ONE_REQUEST)  # a signal to all processes of the command ends the other one first
            code = report(os.waitstatus_to_exitcode(status), STATE.numbers[REQUESTS] > 0)
        os._exit(code)

    def _pass_on(self, number: int) -> None:
        now = time.monotonic()
        if now - self._last < ONE_REQUEST:
            return
        self._last = now
        STATE.numbers[REQUESTS] += 1
        if STATE.numbers[REQUESTS] > 1:
            signal.setitimer(signal.ITIMER_REAL, GRACE)
        self._send(number)

    def _end_hanging(self) -> None:
        """After the second interrupt: end a process that is still in a call of an FMU."""
        if STATE.numbers[INSTANCE] == NOTHING:
            signal.setitimer(signal.ITIMER_REAL, GRACE)
        else:
            self._send(signal.SIGKILL)

    def _send(self, number: int) -> None:
        with suppress(ProcessLookupError):
            os.kill(self._child, number)
