"""Which ship a name on the command line means."""

from pathlib import Path

from ..ship_description import Description

DEFAULT = "cse1"


def described_ship(name: Description | str | Path | None = None) -> Description:
    """The description of a ship.

    Args:
        name: of a shipped ship, or the path of a ``.toml`` file; a description stays what it is; None:
            the default ship.

    Raises:
        DeclarationError: no such ship, or its file is not as it should be.
    """
    if isinstance(name, Description):
        return name
    from .ship_file import read_ship  # only now: pydantic takes a while to import

    return read_ship(DEFAULT if name is None else name)
