"""Reading archives and XML that nobody vouches for: refused before they fill the memory or the disk."""

import lzma
import zipfile
import zlib
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from cybership.message_text import PrintableError

DAMAGED = (zipfile.BadZipFile, zlib.error, lzma.LZMAError)
MOST_ENTRIES = 50_000
MOST_BYTES = 4 << 30  # unpacked, which ...
MOST_RATIO = 200  # ... beyond this many bytes for a byte of the archive is taken for a bomb
SMALL = 64 << 20  # unless it is no more than this
DEEPEST = 100  # elements within elements; the standard needs 5, annotations may want some more


class BadFileError(PrintableError):
    """What was given is no FMU that can be checked here; the message says why."""


def read_archive(path: Path) -> tuple[list[zipfile.ZipInfo], bytes]:
    """Entries of an FMU, and its modelDescription.xml.

    Raises:
        BadFileError: not there, no FMU, or a bomb.
    """
    if path.is_dir():
        raise BadFileError(f"'{path}' is a folder, not an FMU")
    if not path.is_file():
        raise BadFileError(f"no such FMU: '{path}'")
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
            _limit(path, members)
            return members, archive.read("modelDescription.xml")
    except KeyError:
        raise BadFileError(f"'{path}' is not an FMU: it has no modelDescription.xml") from None
    except (*DAMAGED, EOFError, RuntimeError, OSError, ValueError) as error:
        raise BadFileError(f"'{path}' is not an FMU: {error}") from None


def _limit(path: Path, members: list[zipfile.ZipInfo]) -> None:
    if len(members) > MOST_ENTRIES:
        raise BadFileError(f"'{path}' holds {len(members)} files, more than {MOST_ENTRIES}")
    packed, size = path.stat().st_size, sum(member.file_size for member in members)
    if size > min(MOST_BYTES, max(SMALL, MOST_RATIO * packed)):
        raise BadFileError(
            f"'{path}' is refused as an archive bomb: its {packed} bytes unpack to {size}, more "
            f"than {MOST_BYTES >> 30} GiB or {MOST_RATIO} times as much"
        )


def read_xml(text: bytes, path: Path) -> ElementTree.Element:
    """Root element of a description.

    Args:
        text: the description.
        path: of the FMU, for messages.

    Raises:
        BadFileError: not XML, in an encoding that nobody knows, with entities, or nested too deep.
    """
    where = f"'{path}': its modelDescription.xml"
    depth = 0

    def refuse_entity(*_: object) -> None:
        raise BadFileError(f"{where} defines entities, which are not allowed")

    def enter(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise BadFileError(f"{where} nests more than {DEEPEST} elements")

    def leave(_: str) -> None:
        nonlocal depth
        depth -= 1

    parser = expat.ParserCreate()
    parser.EntityDeclHandler = refuse_entity
    parser.StartElementHandler, parser.EndElementHandler = enter, leave
    try:
        parser.Parse(text, True)
        return ElementTree.fromstring(text)
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise BadFileError(f"{where} is not XML: {error}") from None
