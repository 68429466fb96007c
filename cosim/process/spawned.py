"""Processes that are started from a user's program, and do not run it again."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from importlib.machinery import ModuleSpec

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Iterator


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
