"""How far a campaign is, on a terminal or in a file."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .conduct import Progress as Told

LINE_EVERY = 30.0  # s between two lines of progress where there is no terminal; chosen


@contextmanager
def shown_progress(console: Console, quiet: bool) -> Iterator[Told]:
    """A bar on a terminal, elsewhere a line now and then; gives what a campaign tells of its runs."""
    if quiet or not console.is_terminal:
        yield _lines(console, quiet)
        return
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("runs", total=None)

        def progress(ended: int, failed: int, of: int) -> None:
            said = f"runs ({failed} failed)" if failed else "runs"
            bar.update(task, completed=ended, total=of, description=said)

        yield progress


def _lines(console: Console, quiet: bool) -> Told:
    """A line every half a minute, where there is no terminal."""
    started = stated = time.monotonic()
    before: int | None = None  # ended in an earlier call of the command

    def progress(ended: int, failed: int, of: int) -> None:
        nonlocal stated, before
        now, before = time.monotonic(), ended if before is None else before
        if quiet or now - stated < LINE_EVERY or ended == before:
            return
        stated = now
        left = (now - started) * (of - ended) / (ended - before)
        said = f" ({failed} failed)" if failed else ""
        console.print(f"{ended} of {of} runs{said}, about {left:.0f} s left", markup=False)

    return progress
