"""Standard streams of every command: closed ones, readers that leave, and disks that are full."""

from __future__ import annotations

import io
import os
import sys

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Callable

FAILED = 3  # exit code


def open_closed_streams() -> None:
    """Open the null device in place of standard streams that are closed (``>&-``)."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:  # the lowest free number, which this is, is the one that a file gets
            os.set_inheritable(os.open(os.devnull, os.O_RDWR), True)
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - until the end
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - until the end


def code_of(main: Callable[[], int]) -> int:
    """Exit code of a command, whose output is written then.

    A reader that closes the pipe (``| head``) is no error. Output that cannot be written, as to a full
    disk, is one line on standard error. Characters that it cannot show are question marks.
    """
    open_closed_streams()
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without Greek
    code = 0
    try:
        code = _returned(main)
        sys.stdout.flush()
    except BrokenPipeError:
        pass
    except OSError as error:
        from .command_arguments import complain  # only now: it takes a while to import

        complain(error)
        code = FAILED
    finally:
        # Text left in the buffer of a closed pipe must not raise again while Python exits.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code


def _returned(main: Callable[[], int]) -> int:
    """What a command returns; argparse raises its code after it has written help or what is wrong."""
    try:
        return main()
    except SystemExit as request:
        if request.code is None or isinstance(request.code, int):
            return request.code or 0
        return FAILED
