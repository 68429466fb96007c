"""Waiting for what happens in another process: the limit of the test ends it, as a busy machine takes its time."""

import time
from collections.abc import Callable
from typing import TypeVar

T = TypeVar("T")


def once_there(look: Callable[[], T], every: float = 0.02) -> T:
    """What a function gives, once that is true; it is asked again after some time [s]."""
    while not (found := look()):
        time.sleep(every)
    return found
