"""What every command does around its own work: exit codes, signals, broken pipes."""

import argparse
import sys
from collections import namedtuple
from collections.abc import Callable
from typing import Any, NoReturn

from rich.console import Console

from cybership.command_arguments import (
    command_parser,
    complain,
    finite,
    folder_name,
    positive,
    program,
    whole_number,
)
from cybership.message_text import printable
from cybership.renamed import OPTIONS, old_names
from cybership.standard_streams import FAILED, code_of

from .interrupts import (
    INTERRUPTED,
    has_interrupted,
    hide_lost_interrupts,
    ignore_interrupts,
    raise_on_interrupt,
)
from .process.run_state import STATE

__all__ = [
    "BAD_INPUT",
    "FAILED",
    "INTERRUPTED",
    "Output",
    "command_parser",
    "complain",
    "finite",
    "folder_name",
    "missing_extra",
    "positive",
    "printable",
    "program",
    "renamed_option",
    "run_command",
    "whole_number",
]

# Exit codes, with FAILED; 130 is what shells report after Ctrl-C (128 + SIGINT).
BAD_INPUT = 2
# Libraries that not every installation has, as they are imported -> the extra that brings them.
EXTRAS = {
    "cryptography": "diagnosis",
    "distributed": "campaign",
    "fmu_manipulation_toolbox": "export",
    "jinja2": "diagnosis",
    "pandas": "diagnosis",
    "pyarrow": "tables",
    "pysindy": "analysis",
    "scipy": "diagnosis",
    "sklearn": "analysis",
    "threadpoolctl": "diagnosis",
    "ziglang": "native",
}


def renamed_option(
    made: argparse._MutuallyExclusiveGroup, new: str, of: Callable[[str], Any] = str, **how: Any
) -> None:
    """Add an option that had another name, which is read with a warning.

    Args:
        made: of options that exclude each other.
        new: the option; :data:`cybership.renamed.OPTIONS` has its old name.
        of: its type.
        how: further arguments of ``add_argument``.
    """
    old, warned = OPTIONS[new], []

    def under_old_name(text: str) -> Any:
        if not warned:
            warned.append(old)
            complain(old_names({old: new}), "warning: ")
        return of(text)

    dest = made.add_argument(new, type=of, **how).dest
    hidden: dict[str, Any] = how | {"help": argparse.SUPPRESS}
    made.add_argument(old, type=under_old_name, dest=dest, **hidden)


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """What to install so that an import works, in a line; None if no extra brings the library."""
    library = (error.name or "").partition(".")[0]
    if library not in EXTRAS:
        return None
    return f"this needs {library}: pip install 'cybership[{EXTRAS[library]}]'"


class Output(Console):
    """Standard output; raises BrokenPipeError where the reader has closed the pipe."""

    def on_broken_pipe(self) -> None:
        raise BrokenPipeError


def run_command(main: Callable[[], int]) -> NoReturn:
    """Run a command's ``main`` and exit with its code; an exception becomes one line on standard error.

    A request to terminate counts as Ctrl-C. A reader that closes the pipe (``| head``) is no error.
    """
    code = FAILED
    hide_lost_interrupts()
    try:
        raise_on_interrupt()
        try:
            code = code_of(main)
        finally:
            ignore_interrupts()
    except KeyboardInterrupt as interrupt:
        complain(": ".join(["interrupted", *map(str, interrupt.args)]), kind="")
        code = INTERRUPTED
        # CPython ends by the signal itself if KeyboardInterrupt left an exec(), as of a named tuple that
        # was being made, though it was caught; making another one clears that mark.
        namedtuple("Cleared", ())
    except ModuleNotFoundError as error:
        line = missing_extra(error)
        complain(line or f"internal error: {error!r}; please report it")
        code = BAD_INPUT if line else FAILED
    except Exception as error:
        # Python wraps what is raised while a class is made, and libraries what they meet.
        if has_interrupted():
            complain("interrupted", kind="")
            code = INTERRUPTED
        else:
            complain(f"internal error: {error!r}; please report it")
    STATE.end(code)
    sys.exit(code)
