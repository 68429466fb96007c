"""A command of the project, run in this process, and what it says."""

import importlib
import io
import os
import re
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

# Lines that say what takes long, where there is no terminal: on a busy machine any command may write some.
PROGRESS = re.compile(
    r"^(\d+ s: |\d+ of \d+ (runs|members)|note: building \S+ takes longer than ).*\n", re.MULTILINE
)


def without_progress(stderr: str) -> str:
    """What a command has written on standard error, but for its progress."""
    return PROGRESS.sub("", stderr)


class Done(NamedTuple):
    """Exit code and output of a command, named as those of a process that has ended."""

    returncode: int
    stdout: str
    stderr: str


def main_of(name: str) -> Callable[..., int | None]:
    """The function ``main`` of a module that ``python -m`` runs."""
    module = importlib.import_module(name)
    return (module if hasattr(module, "main") else importlib.import_module(f"{name}.__main__")).main


def command(
    main: Callable[[Sequence[str]], int | None], *arguments: object, cwd: Path | None = None
) -> Done:
    """What ``python -m`` of a module would do, without the second that a process takes to start.

    Args:
        main: the function of the module that takes the arguments.
        arguments: each is turned into a string.
        cwd: folder in which it runs.
    """
    out, err, here = io.StringIO(), io.StringIO(), Path.cwd()
    os.chdir(cwd or here)
    with redirect_stdout(out), redirect_stderr(err):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as ended:  # from argparse
            code = ended.code
        finally:
            os.chdir(here)
    return Done(int(code or 0), out.getvalue(), err.getvalue())
