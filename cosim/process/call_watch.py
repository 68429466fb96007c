"""A look at the call that an FMU is carrying out in another process, and whether it takes too long."""

from __future__ import annotations

import os
import signal
import time

from .run_state import CALLS, INSTANCE, LATE, NAMED, NOTHING, STATE, STEPS, TAKEN

# Longest wall time of one call where none is given: so many seconds, or so many times what a step has
# taken on average. Chosen: a garbage collector or a busy computer stops a program for less.
TIMEOUT, TIMES_USUAL = 30.0, 100.0
LOOK = 0.5  # wall time between two looks [s]; chosen: short compared with the timeout


class CallWatch:
    """Looks at the state of a run from time to time."""

    def __init__(self) -> None:
        self._seen: tuple[int | str, ...] = ()
        self._since = self._first = time.monotonic()
        self._steps = 0

    def is_late(self) -> bool:
        """Whether the call that is under way takes too long; what it is then stands in the state."""
        now, n = time.monotonic(), STATE.numbers
        called = n[INSTANCE]
        seen = (called, n[CALLS], n[TAKEN], n[STEPS], STATE.call()[1] if called == NAMED else "")
        if seen != self._seen or called == NOTHING:
            if n[CALLS] < self._steps or called in (NOTHING, NAMED):  # another run, or none
                self._first, self._steps = now, n[CALLS]
            self._seen, self._since = seen, now
            return False
        steps = n[CALLS] - self._steps
        usual = (self._since - self._first) / steps if steps > 0 else 0.0
        allowed = STATE.timeout or max(TIMEOUT, TIMES_USUAL * usual)
        (instance, what), late = STATE.call(), now - self._since > allowed
        if not late or STATE.is_apart(instance):  # a process of its own has a timeout of its own
            return False
        STATE.write(LATE, f"{instance}: {what} took longer than {allowed:g} s; its process was ended")
        return True


def watch_from_copy(notes: str) -> None:
    """Have a copy of this process end it when a call of an FMU takes too long.

    Args:
        notes: file that the copy says it in.
    """
    watched = os.getpid()
    if not hasattr(os, "fork") or os.fork():
        return
    os.closerange(0, 2**12)  # its connections are to end with it
    watch = CallWatch()
    while os.getppid() == watched:
        time.sleep(LOOK)
        if watch.is_late():
            with open(notes, "a", encoding="utf-8") as file:
                file.write(f"{STATE.read(LATE)}\n")
            os.kill(watched, signal.SIGKILL)
            break
    os._exit(0)
