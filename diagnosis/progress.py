"""Progress of long work: a callback that is given what is being done, and a terminal line for it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from cosim.interrupts import raise_if_interrupted

Advance = Callable[[str], None]


def silent(what: str) -> None:
    """No-op progress callback."""


@contextmanager
def progress(console: Console) -> Iterator[Advance]:
    """A progress callback that shows one line on the terminal, if there is one."""
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=None)

        def advance(what: str) -> None:
            raise_if_interrupted()
            bar.update(task, description=what)

        yield advance
