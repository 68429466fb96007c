"""A command of the project, run in this process."""

import io
import os
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple


class Done(NamedTuple):
    """Exit code and output of a command, named as those of a process that has ended."""

    returncode: int
    stdout: str
    stderr: str


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
