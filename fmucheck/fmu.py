"""An FMU as an archive with a description."""

import sys
import zipfile
from pathlib import Path

from .description import FmuDescription
from .source import BadFileError, read_archive, read_xml

# Folder of this machine's binaries, and the suffix of a shared library, by sys.platform (2.3).
SUFFIXES = {"win": ".dll", "linux": ".so", "darwin": ".dylib"}


def platform() -> str:
    """The standard's name for this machine, such as ``linux64``."""
    system = "win" if sys.platform.startswith("win") else sys.platform
    return f"{system}{64 if sys.maxsize > 2**32 else 32}"


def suffix(folder: str) -> str:
    """Suffix of a shared library in a folder such as ``linux64``; empty if the standard has no such
    one.
    """
    return SUFFIXES.get(folder.rstrip("0123456789"), "")


class FmuArchive:
    """An FMU archive, its description, and the folder that it is unpacked to.

    Args:
        path: the ``.fmu`` file.

    Attributes:
        members: entries of the archive.

    Raises:
        BadFileError: not there, no FMU, or not one for FMI 2.0 co-simulation.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.members, text = read_archive(path)
        root = read_xml(text, path)
        version = root.get("fmiVersion")
        if version != "2.0":
            raise BadFileError(f"'{path}' is for FMI {version}; FMI 2.0 is supported")
        if root.find("CoSimulation") is None:
            raise BadFileError(f"'{path}' is not for co-simulation")
        self.description = FmuDescription(root)

    @property
    def library(self) -> str:
        """Path inside the archive of the library for this machine."""
        here = platform()
        return f"binaries/{here}/{self.description.cs.get('modelIdentifier', '')}{suffix(here)}"

    def unpack(self, folder: Path) -> None:
        """Unpack into a folder all but the binaries of other platforms; zipfile drops what would leave
        it, and writes links as plain files.
        """
        here = f"binaries/{platform()}/"
        names = [member.filename for member in self.members]
        wanted = [n for n in names if n.startswith(here) or not n.startswith("binaries/")]
        with zipfile.ZipFile(self.path) as archive:
            archive.extractall(folder, wanted)
