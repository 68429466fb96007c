"""Who does long work tells what it is doing."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

Advance = Callable[[str], None]


def silent(what: str) -> None:
    """Where nobody wants to know what is being done."""


@contextmanager
def steps(console: Console) -> Iterator[Advance]:
    """A line on the terminal, if there is one, that tells what is being done."""
    columns = (SpinnerColumn(), TextColumn("{task.description}", markup=False), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("starting", total=None)
        yield lambda what: bar.update(task, description=what)
