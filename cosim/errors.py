"""The two ways in which a run can go wrong."""

import difflib
from collections.abc import Iterable


class InputError(Exception):
    """What the user gave cannot be used; the message says what, where and what was near. Exit code 2."""


class SimulationError(Exception):
    """The simulation itself failed; what was logged is kept. Exit code 3."""


def nearest(name: str, known: Iterable[str]) -> str:
    """A hint at the known name most like a wrong one, or at what there is.

    Args:
        name: what was written.
        known: what could have been meant.

    Returns:
        Text to append to a message; empty if nothing is known.
    """
    known = list(known)
    near = difflib.get_close_matches(name, known, 1, 0.5)
    if near:
        return f"; did you mean '{near[0]}'?"
    if not known:
        return ""
    shown = ", ".join(known[:8]) + (", ..." if len(known) > 8 else "")
    return f"; there is {shown}" if len(known) == 1 else f"; there are {shown}"
