"""What every command of this package does around its own work."""

import os
import signal
import sys
from collections.abc import Callable
from typing import NoReturn

from rich.console import Console

BAD_INPUT, FAILED, INTERRUPTED = 2, 3, 130


class Output(Console):
    """Standard output; a reader that went away is told to the caller."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def run_command(main: Callable[[], int]) -> NoReturn:
    """Run a command's ``main`` and leave with its exit code, one line where something went wrong.

    A request to terminate counts as Ctrl-C. A reader that went away (``| head``) is no error.
    """
    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    code = FAILED
    try:
        code = main()
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    except BrokenPipeError:
        code = 0
    except OSError as error:
        print(f"error: {error}", file=sys.stderr)
    except Exception as error:
        print(f"error: this should not have happened: {error!r}; please report it", file=sys.stderr)
    # What is left in the buffer of a closed pipe must not raise again while Python ends.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)
