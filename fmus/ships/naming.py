"""Which ship a name on the command line means."""

from pathlib import Path

from ..ship_description import Description

DEFAULT = "cse1"


def described_ship(name: Description | str | Path | None) -> Description | None:
    """The description of a ship; None for CyberShip Enterprise 1, which the components declare.

    Args:
        name: of a shipped ship, or the path of a ``.toml`` file; a description stays what it is.

    Raises:
        DeclarationError: no such ship, or its file is not as it should be.
    """
    if name is None or isinstance(name, Description):
        return name
    if str(name) == DEFAULT:
        return None
    from .ship_file import read_ship  # only now: pydantic takes a while to import

    return read_ship(name)
