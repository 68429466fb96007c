"""What the installed program ``cybership`` runs first: from here on an interrupt ends it in one line."""

from cosim.interrupts import leave_on_interrupt

leave_on_interrupt()  # before all other imports, which take a while

from .__main__ import main  # noqa: E402 - see above

__all__ = ["main"]
