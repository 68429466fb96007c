"""What the installed program ``cybership`` runs first: from here on an interrupt ends it in one line."""

from cosim.interrupts import leave_on_interrupt

leave_on_interrupt()  # before all other imports, which take a while

from .__main__ import main as named_command  # noqa: E402 - see above
from .standard_streams import code_of  # noqa: E402

__all__ = ["main"]


def main() -> int:
    """Run the command that is named; its exit code."""
    return code_of(named_command)
