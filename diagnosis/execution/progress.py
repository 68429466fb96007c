"""Progress of long work: a callback that is given what is being done, and a terminal line for it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from cosim.interrupts import raise_if_interrupted

Advance = Callable[[str], None]
# s between two lines where there is no terminal; chosen: nobody thinks that it hangs.
EVERY = 30.0


def silent(what: str) -> None:
    """No-op progress callback."""


@contextmanager
def progress(console: Console) -> Iterator[Advance]:
    """A progress callback: one line on the terminal, elsewhere a line every half a minute."""
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        started = told = time.monotonic()

        def advance(what: str) -> None:
            nonlocal told
            raise_if_interrupted()
            bar.update(task, description=what)
            now = time.monotonic()
            if not console.is_terminal and now - told > EVERY:
                told = now
                console.print(f"{now - started:.0f} s: {what}", markup=False)

        yield advance
