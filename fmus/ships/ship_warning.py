"""Warnings of what a ship's file says, and how a command shows them."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from cybership.renamed import OldNameWarning


class ShipWarning(UserWarning):
    """A number of a ship's file that is allowed, and which no ship has."""


SHOWN = (ShipWarning, OldNameWarning)


@contextmanager
def ship_warnings_to(show: Callable[[str], object]) -> Iterator[None]:
    """Give each warning of a user's file to a command's own output, in place of Python's."""

    def shown(message: Warning | str, category: type[Warning], *more: Any, **named: Any) -> None:
        if issubclass(category, SHOWN):
            show(str(message))
        else:
            otherwise(message, category, *more, **named)

    with warnings.catch_warnings():
        otherwise = warnings.showwarning
        for each in SHOWN:
            warnings.simplefilter("always", each)
        warnings.showwarning = shown
        yield
