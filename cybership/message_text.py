"""Text of messages: what they repeat of files is on one line, without control characters, and short."""

from __future__ import annotations

import re

TYPE_CHECKING = False  # typing itself takes a while to import, and so does pydantic
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from pydantic import ValidationError

# A value between quotes, which an apostrophe of a word is not.
VALUE = re.compile(r"(?<!\w)'([^']*)'(?!\w)")
PATH = re.compile(r"[/\\]")  # separators, with which a value may be a path
Location = tuple[int | str, ...]  # the keys and indices that lead to a place in a file

# Characters of what a message repeats of a file, and of what it says of it; chosen: a few lines in all.
LONGEST_VALUE, LONGEST_FAULT = 60, 600
# Longest word and line of any message [characters]; chosen: longer than any path or name in use.
LONGEST_WORD, LONGEST_LINE = 400, 4000


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


def quoted(value: object) -> str:
    """A value of a file as a message repeats it: as Python writes it, and cut."""
    return _cut(repr(value), LONGEST_VALUE)


def name_of(text: str) -> str:
    """A name in a file as a message says it between its own quotes or without: on one line, and cut."""
    return _cut(_one_line(text), LONGEST_VALUE)


def first_fault(
    error: ValidationError,
    hint: Callable[[Location], str] = lambda _: "",
    hidden: Callable[[str], bool] = lambda _: False,
    special: Callable[[str, Location, Any], str] = lambda *_: "",
    whole: str = "",
) -> str:
    """The first fault of a file in one line: where, what, and what may have been meant.

    A key that is not known comes before the one that it leaves missing.

    Args:
        error: of the file's model.
        hint: what is said behind a key that is not known, by its place.
        hidden: whether a part of a place is not of the file, but of the model.
        special: what is said of a fault by its type, place and value; empty: what pydantic says.
        whole: what stands for the place of a fault of the whole file.
    """
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    kind, loc, text = faults[0]["type"], faults[0]["loc"], faults[0]["msg"]
    value = faults[0]["input"]
    if own := special(kind, loc, value):
        text = own
    elif kind == "extra_forbidden":
        text = f"unknown key{hint(loc)}"
    elif kind == "missing":
        text = "is missing"
    elif loc and text.startswith("Input") and isinstance(value, int | float | str):
        text += f"; got {quoted(value)}"
    place = "" if loc else whole
    for part in loc:
        if isinstance(part, int):
            place += f"[{part}]"
        elif not hidden(part):
            place += ("." if place else "") + name_of(part)
    return (f"{place}: " if place else "") + brief(text.removeprefix("Value error, "))


def _one_line(text: str) -> str:
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in " ".join(text.split()))


def _words_cut(text: str, longest: int) -> str:
    return re.sub(rf"\S{{{longest + 1},}}", lambda word: _cut(word[0], longest), text)


def _cut(text: str, longest: int) -> str:
    """Both ends of a text that is too long."""
    half = (longest - 3) // 2
    return text if len(text) <= longest else f"{text[:half]}...{text[-half:]}"
