"""The surroundings of a run: interrupts as a flag, and no garbage collection in the step loop."""

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..interrupts import on_interrupt, raise_on_interrupt, restore, was_lost


@contextmanager
def interruptible() -> Iterator[Callable[[], bool]]:
    """Turn Ctrl-C and a termination request into a flag that is read between calls of FMUs.

    An exception would surface inside the FMU that happens to run. A second request, of any kind, raises
    KeyboardInterrupt.
    """
    asked = False

    def ask() -> None:
        nonlocal asked
        asked = True
        raise_on_interrupt()

    if threading.current_thread() is not threading.main_thread():
        yield lambda: False
        return
    previous = on_interrupt(ask)
    if was_lost():  # while this was prepared
        ask()
    try:
        yield lambda: asked
    finally:
        restore(previous)
        was_lost()  # the next run in this process has not been asked to end


_is_first = True  # run of this process


@contextmanager
def quiet_collector() -> Iterator[None]:
    """No garbage collection inside the block unless the caller runs it, and one before."""
    global _is_first
    if not _is_first:  # before the first run there is nothing to collect that would be worth its time
        gc.collect()
    _is_first = False
    with paused_collector():
        yield


@contextmanager
def paused_collector() -> Iterator[None]:
    """No garbage collection inside the block unless the caller runs it.

    Objects that exist at the start are exempt from it, which makes a collection cheap.
    """
    was_enabled = gc.isenabled()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_enabled:
            gc.enable()
