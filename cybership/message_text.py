"""Text of messages: what they repeat of files is on one line, without control characters, and short."""

from __future__ import annotations

import re

TYPE_CHECKING = False  # typing itself takes a while to import
if TYPE_CHECKING:
    from collections.abc import Iterable

# A value between quotes, which an apostrophe of a word is not.
VALUE = re.compile(r"(?<!\w)'([^']*)'(?!\w)")
PATH = re.compile(r"[/\\]")  # separators, with which a value may be a path
Location = tuple[int | str, ...]  # the keys and indices that lead to a place in a file

# Characters of what a message repeats of a file, and of what it says of it; chosen: a few lines in all.
LONGEST_VALUE, LONGEST_FAULT = 60, 600
# Longest word and line of any message [characters]; chosen: longer than any path or name in use.
LONGEST_WORD, LONGEST_LINE = 400, 4000
# Similarity (difflib's ratio, 0 to 1) above which a known name is suggested; chosen: lower ones mislead.
SIMILAR = 0.5
# Known names that a hint lists where none is similar; chosen: more do not fit on a line.
LISTED = 8


def printable(text: str) -> str:
    """A message as one line for the terminal.

    Names in files and messages of FMUs may hold control characters, which would move the cursor or
    change colours, or be very long: these are shown as Python writes them, and cut.
    """
    text = VALUE.sub(lambda value: value[0] if PATH.search(value[1]) else f"'{name_of(value[1])}'", text)
    return _cut(_words_cut(_one_line(text), LONGEST_WORD), LONGEST_LINE)


class PrintableError(Exception):
    """An error whose message, whatever it repeats of a file, is :func:`printable`."""

    def __str__(self) -> str:
        return printable(super().__str__())


def brief(text: str) -> str:
    """What is wrong with a file, whose values are cut: on one line, for behind the name of the file."""
    text = re.sub(r"'([^']*)'", lambda value: f"'{_cut(value[1], LONGEST_VALUE)}'", _one_line(text))
    return _cut(_words_cut(text, LONGEST_VALUE + 4), LONGEST_FAULT)  # quotes and punctuation around it


def counted(number: int, what: str) -> str:
    """A number of things: "1 row", "2 rows"."""
    return f"{number} {what}{'s' * (number != 1)}"


def failure(error: BaseException) -> str:
    """An exception of a user's file as a message has it; of a mistake in its syntax with the line."""
    if isinstance(error, SyntaxError):
        return f"{type(error).__name__}: {error.msg}, line {error.lineno}"
    return repr(error)


def quoted(value: object) -> str:
    """A value of a file as a message repeats it: as Python writes it, and cut."""
    return _cut(repr(value), LONGEST_VALUE)


def name_of(text: str) -> str:
    """A name in a file as a message says it between its own quotes or without: on one line, and cut."""
    return _cut(_one_line(text), LONGEST_VALUE)


def most_alike(name: str, known: Iterable[str]) -> str | None:
    """The known name that is a name but for case, else the one most like it; None if none is similar."""
    import difflib

    known = list(known)
    folded = {each.casefold(): each for each in reversed(known)}
    if name.casefold() in folded:
        return folded[name.casefold()]
    near = difflib.get_close_matches(name, known, 1, SIMILAR)
    return near[0] if near else None


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint at the known name most like a wrong one, or at what there is.

    Args:
        name: what was written.
        known: what could have been meant.

    Returns:
        Text to append to a message; empty if nothing is known.
    """
    known = list(known)
    near = most_alike(name, known)
    if near is not None:
        return f"; did you mean '{near}'?"
    if not known:
        return ""
    shown = ", ".join(each[:LONGEST_VALUE] for each in known[:LISTED]) + (
        ", ..." if len(known) > LISTED else ""
    )
    return f"; there is {shown}" if len(known) == 1 else f"; there are {shown}"


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))


def _words_cut(text: str, longest: int) -> str:
    return re.sub(rf"\S{{{longest + 1},}}", lambda word: _cut(word[0], longest), text)


def _cut(text: str, longest: int) -> str:
    """Both ends of a text that is too long."""
    half = (longest - 3) // 2
    return text if len(text) <= longest else f"{text[:half]}...{text[-half:]}"
