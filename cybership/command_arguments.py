"""What the commands of all packages share: parser, types of options, and lines on standard error."""

import argparse
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from .message_text import most_alike, printable

if TYPE_CHECKING:
    from _typeshed import SupportsWrite


def complain(message: object, kind: str = "error: ") -> None:
    """Say on standard error why the command ends, in one line."""
    with suppress(OSError):  # its reader has left, or the disk is full: the exit code remains
        print(f"{kind}{printable(str(message))}", file=sys.stderr, flush=True)


def program(module: str) -> str:
    """The name of a command in its usage line: ``cybership NAME`` if that began it."""
    return sys.argv[0] if sys.argv[0].startswith("cybership ") else f"python -m {module}"


class _Parser(argparse.ArgumentParser):
    """A parser that says in one line what is wrong, and names the nearest option where there is none."""

    def print_help(self, file: "SupportsWrite[str] | None" = None) -> None:
        """Print the help; argparse itself hides that it cannot be written."""
        print(self.format_help(), end="", file=file)

    def error(self, message: str) -> NoReturn:
        options = [option[2:] for action in self._actions for option in action.option_strings]
        given = re.match(r"unrecognized arguments: .*?--(\w[\w-]*)", message)
        near = most_alike(given[1], filter(None, options)) if given else None
        hint = f"did you mean '--{near}'?" if near else f"'{self.prog} --help' lists all options"
        complain(f"{message}; {hint}")
        self.exit(2)


def command_parser(module: str, description: str, epilog: str) -> argparse.ArgumentParser:
    """A parser of the command that a module is.

    Args:
        module: ``python -m`` runs it.
        description: what the command does.
        epilog: examples and exit codes, line by line.
    """
    return _Parser(
        prog=program(module),
        description=description,
        epilog=epilog,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def whole_number(least: int) -> Callable[[str], int]:
    """Type of an option that takes a whole number from 0, 1 or 2 on."""
    wanted = ("from zero on", "above zero", "from two on")[least]

    def of(text: str) -> int:
        if not text.isdecimal() or int(text) < least:
            raise argparse.ArgumentTypeError(f"needs a whole number {wanted}, not '{text}'")
        return int(text)

    return of


def finite(text: str) -> float:
    """Type of an option that takes a number."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not -float("inf") < value < float("inf"):
        raise argparse.ArgumentTypeError(f"needs a number, not '{text}'")
    return value


def positive(text: str) -> float:
    """Type of an option that takes a positive number."""
    wanted = f"needs a positive number, not '{text}'"
    try:
        value = float(text)
    except ValueError:
        hint = f"{wanted} (the file of a command comes before this option)"
        raise argparse.ArgumentTypeError(hint) from None
    if not 0.0 < value < float("inf"):
        raise argparse.ArgumentTypeError(wanted)
    return value


def folder_name(text: str) -> Path:
    """Type of an option that names a folder: nothing is no name of the working directory."""
    if not text.strip():
        raise argparse.ArgumentTypeError("needs the name of a folder")
    return Path(text)
