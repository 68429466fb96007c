"""Progress of long work: a callback that is given what is being done, and a terminal line for it."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeElapsedColumn
from rich.progress_bar import ProgressBar
from rich.table import Column
from rich.text import Text

from cosim.interrupts import raise_if_interrupted

from .remaining_time import RemainingTime

Advance = Callable[[str], None]
# s between two lines where there is no terminal; chosen: nobody thinks that it hangs.
EVERY = 30.0
MARGIN = 16  # 1, characters of a line for spinner, elapsed time and a short bar


def silent(what: str) -> None:
    """No-op progress callback."""


class _Bar(ProgressColumn):
    """The share of the time that is over, and the remaining time; both move while a step goes on."""

    def __init__(self, time_left: RemainingTime) -> None:
        super().__init__()
        self._time = time_left

    def render(self, task: Task) -> ProgressBar | Text:
        share = self._time.share
        return Text("") if share is None else ProgressBar(total=1.0, completed=share)


class ProgressLine:
    """A progress callback: one line on the terminal, elsewhere a line every half a minute.

    Args:
        console: where it is shown.
        bar: the line on the terminal.
        time_left: estimate of the remaining time.
    """

    def __init__(self, console: Console, bar: Progress, time_left: RemainingTime) -> None:
        self._console, self._bar, self._time = console, bar, time_left
        self._task = bar.add_task("starting", total=None)
        self._shown = time.monotonic()

    def __call__(self, what: str) -> None:
        """A step begins."""
        raise_if_interrupted()
        self._time.begin(what)
        self._bar.update(self._task, description=f"{what}{remaining(self._time)}")
        now = time.monotonic()
        if not self._console.is_terminal and now - self._shown > EVERY:
            self._shown = now
            line = f"{self._time.elapsed:.0f} s: {what}{remaining(self._time)}"
            self._console.print(line, markup=False)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Something else is printed inside, where the line would be in its way."""
        self._bar.stop()
        try:
            yield
        finally:
            self._bar.start()


def remaining(time_left: RemainingTime) -> str:
    """The remaining time in words, with what is before them; empty where it is not known."""
    seconds = time_left.seconds
    if seconds is None:
        return ""
    size, unit = (60.0, "min") if seconds >= 90.0 else (1.0, "s")
    return f", about {seconds / size:.0f} {unit} more"


@contextmanager
def progress(console: Console) -> Iterator[ProgressLine]:
    """A progress callback that is shown until the end."""
    time_left = RemainingTime()
    # Long names of runs leave room for the time and the bar.
    described = Column(no_wrap=True, overflow="ellipsis", max_width=max(console.width - MARGIN, 1))
    columns = (
        SpinnerColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}", markup=False, table_column=described),
        _Bar(time_left),
    )
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        yield ProgressLine(console, bar, time_left)
