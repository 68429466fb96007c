"""The two ways in which a run can go wrong, hints for messages, and keys that occur twice."""

import difflib
from collections.abc import Iterable, Sequence
from typing import Any

from cybership.message_text import LONGEST_VALUE, PrintableError, quoted

__all__ = ["InputError", "SimulationError", "most_alike", "nearest", "unique_keys"]

# Similarity (difflib's ratio, 0 to 1) above which a known name is suggested; chosen: lower ones mislead.
SIMILAR = 0.5
# Known names that a hint lists where none is similar; chosen: more do not fit on a line.
LISTED = 8


class InputError(PrintableError):
    """The user's input cannot be used; the message says what, where and what was near. Exit code 2."""


class SimulationError(PrintableError):
    """The simulation itself failed; what was logged is kept. Exit code 3."""


def most_alike(name: str, known: Iterable[str]) -> str | None:
    """The known name that is a name but for case, else the one most like it; None if none is similar."""
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


def unique_keys(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object from its pairs, for :func:`json.loads`, which alone keeps the last of equal keys.

    Raises:
        InputError: a key occurs twice.
    """
    found: dict[str, Any] = {}
    for name, value in pairs:
        if name in found:
            raise InputError(f"the key {quoted(name)} occurs twice in one object")
        found[name] = value
    return found
