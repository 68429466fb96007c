"""Progress of long work: a callback that is given what is being done, and a terminal line for it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Column

from cosim.interrupts import raise_if_interrupted

Advance = Callable[[str], None]
# s between two lines where there is no terminal; chosen: nobody thinks that it hangs.
EVERY = 30.0


def silent(what: str) -> None:
    """No-op progress callback."""


class ProgressLine:
    """A progress callback: one line on the terminal, elsewhere a line every half a minute.

    Args:
        console: where it is shown.
        bar: the line on the terminal.
    """

    def __init__(self, console: Console, bar: Progress) -> None:
        self._console, self._bar = console, bar
        self._task = bar.add_task("starting", total=None)
        self._started = self._shown = time.monotonic()

    def __call__(self, what: str) -> None:
        """A step begins."""
        raise_if_interrupted()
        self._bar.update(self._task, description=what)
        now = time.monotonic()
        if not self._console.is_terminal and now - self._shown > EVERY:
            self._shown = now
            self._console.print(f"{now - self._started:.0f} s: {what}", markup=False)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Something else is printed inside, where the line would be in its way."""
        self._bar.stop()
        try:
            yield
        finally:
            self._bar.start()


@contextmanager
def progress(console: Console) -> Iterator[ProgressLine]:
    """A progress callback that is shown until the end."""
    described = Column(no_wrap=True, overflow="ellipsis", ratio=1)  # what the time leaves of the line
    columns = (
        BarColumn(bar_width=20),  # it moves as long as the length of the work is not known
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False, table_column=described),
    )
    shown = console.is_terminal
    with Progress(*columns, console=console, transient=True, expand=True, disable=not shown) as bar:
        yield ProgressLine(console, bar)
