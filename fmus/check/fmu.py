"""Opening an FMU that nobody vouches for."""

import sys
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree

from .description import Description

MOST_BYTES = 4 << 30  # unpacked; more is taken for an archive bomb

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


class BadFileError(Exception):
    """What was given is no FMU that can be checked here; the message says why."""


class Fmu:
    """An FMU archive, its description, and the folder that it is unpacked to.

    Args:
        path: the ``.fmu`` file.

    Raises:
        BadFileError: not there, no FMU, or not one for FMI 2.0 co-simulation.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        if not path.is_file():
            raise BadFileError(f"no such FMU: '{path}'")
        try:
            with zipfile.ZipFile(path) as archive:
                self.members = archive.infolist()
                text = archive.read("modelDescription.xml")
        except KeyError:
            raise BadFileError(f"'{path}' is not an FMU: it has no modelDescription.xml") from None
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, OSError) as error:
            raise BadFileError(f"'{path}' is not an FMU: {error}") from None
        if b"<!ENTITY" in text:
            raise BadFileError(
                f"'{path}': its modelDescription.xml defines entities, which no FMU needs"
            )
        try:
            root = ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise BadFileError(f"'{path}': its modelDescription.xml is not XML: {error}") from None
        version = root.get("fmiVersion")
        if version != "2.0":
            raise BadFileError(f"'{path}' is for FMI {version}; this checks FMI 2.0")
        if root.find("CoSimulation") is None:
            raise BadFileError(f"'{path}' is not for co-simulation")
        if sum(member.file_size for member in self.members) > MOST_BYTES:
            raise BadFileError(f"'{path}' unpacks to more than {MOST_BYTES >> 30} GiB")
        self.description = Description(root)

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
