"""Checks of archives and XML of unknown origin, before anything of them is used.

An FMU is a program, and running it means trusting it. But reading one must not write outside of its own
folder, fill the disk or the memory, or name another file on another computer.
"""

import lzma
import math
import re
import shutil
import stat
import unicodedata
import zipfile
import zlib
from pathlib import Path
from xml.parsers import expat

from ..errors import InputError, nearest

# Names that Windows gives to devices, with any extension.
DEVICE = re.compile(
    r"(con|prn|aux|nul|conin\$|conout\$|com[0-9¹²³]|lpt[0-9¹²³])\s*(\.|$)", re.IGNORECASE
)
ENCRYPTED = 0x1  # bit of the general purpose flags of a zip entry
XML = (".xml", ".ssd", ".ssv", ".ssm")
# How large an archive may become; chosen: well above the largest FMUs in use.
MOST_FILES = 50_000  # entries
MOST_BYTES = 4 * 2**30  # of all entries together, unpacked
MOST_RATIO = 200.0  # of that size to the size of the archive; does not count below ALWAYS [bytes]
ALWAYS = 64 * 2**20
LARGEST_XML = 128 * 2**20  # bytes of one XML file, which takes many times as much memory to read
# What zipfile raises for a file that is no archive, is damaged, or uses an unknown compression.
DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    EOFError,
    OSError,
    RuntimeError,  # NotImplementedError is one
    ValueError,
)
# Largest entry that is read into memory [bytes]; chosen: above any FMU in an SSP archive.
LARGEST = 2**30
# Numbers as XML writes them; Python's float() also accepts underscores and digits of other scripts.
REAL = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
INTEGER = re.compile(r"[+-]?\d{1,30}", re.ASCII)


def check_archive(path: Path) -> list[zipfile.ZipInfo]:
    """Entries of an archive that can be unpacked anywhere without harm.

    Args:
        path: a zip archive.

    Raises:
        InputError: not a zip archive; an entry leaves the folder, is a link, is encrypted, has a name
            that not every computer can write or that another entry has too; or it is a zip bomb.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
        packed = path.stat().st_size
    except FileNotFoundError:
        raise InputError(f"no such file: '{path}'") from None
    except DAMAGED as error:
        raise InputError(f"'{path}' is not a zip archive: {error}") from None
    if len(entries) > MOST_FILES:
        raise InputError(f"'{path}' is refused: {len(entries)} entries are more than {MOST_FILES}")
    size = sum(entry.file_size for entry in entries)
    # Entries may share their bytes: only the size of the whole file is certain.
    if size > MOST_BYTES or (size > ALWAYS and size > MOST_RATIO * packed):
        raise InputError(
            f"'{path}' is refused: {packed} bytes unpack to {size} (at most {MOST_BYTES}, and "
            f"{MOST_RATIO:g} times the size of the archive)"
        )
    for entry in entries:
        if entry.file_size > LARGEST_XML and entry.filename.lower().endswith(XML):
            raise InputError(
                f"'{path}' is refused: its {entry.filename[:100]} is larger than {LARGEST_XML} bytes"
            )
        if reason := _fault(entry):
            raise InputError(f"'{path}' is refused: its entry {entry.orig_filename[:100]!r} {reason}")
    if clash := _clash([entry.filename for entry in entries]):
        raise InputError(f"'{path}' is refused: {clash}")
    return entries


def _fault(entry: zipfile.ZipInfo) -> str:
    """The fault of one entry; empty if it has none."""
    name = entry.orig_filename
    parts = name.removesuffix("/").split("/")
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if name.startswith("/") or ":" in name:
        return "is not a path inside the archive"
    if "\\" in name:
        return "has a backslash in its name"
    if ".." in parts:
        return "leads out of the folder"
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        return "is a link or a device, not a file"
    if entry.flag_bits & ENCRYPTED:
        return "is encrypted"
    if any(ord(c) < 32 for c in name) or any(p in ("", ".") or p[-1] in ". " for p in parts):
        return "has a name that some operating systems cannot write"
    if any(DEVICE.match(part) for part in parts):
        return "has the name of a device of Windows"
    return ""


def _clash(names: list[str]) -> str:
    """Two entries that are one file on some computer; empty if there are none."""
    files: dict[str, str] = {}
    for name in names:
        if not name.endswith("/"):
            key = _key(name)
            if key in files:
                both = f"its entries {files[key]!r} and {name!r}"
                return f"{both} are the same file on some operating systems"
            files[key] = name
    for name in names:
        parents = _key(name.removesuffix("/")).split("/")[: None if name.endswith("/") else -1]
        for k in range(len(parents)):
            key = "/".join(parents[: k + 1])
            if key in files:
                return f"its entry {files[key]!r} is a file, and the folder of {name!r}"
    return ""


def _key(name: str) -> str:
    """Equal for names that some file system cannot distinguish: by case, or by accents."""
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold())


def unpack(path: Path, folder: Path) -> None:
    """Unpack an archive into an empty folder, after :func:`check_archive`.

    Raises:
        InputError: refused, damaged, or the disk is full.
    """
    entries = check_archive(path)
    try:
        with zipfile.ZipFile(path) as archive:
            for entry in entries:
                target = folder / entry.filename
                if entry.is_dir():
                    target.mkdir(parents=True, exist_ok=True)
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                # zipfile reads no more than the announced size; "x" never follows what is there.
                with archive.open(entry) as reader, target.open("xb") as writer:
                    shutil.copyfileobj(reader, writer)
    except DAMAGED as error:
        raise InputError(f"'{path}' cannot be unpacked: {error}") from error


class Archive:
    """The files of an archive, after :func:`check_archive`.

    Args:
        path: a zip archive.

    Raises:
        InputError: refused.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._sizes = {entry.filename: entry.file_size for entry in check_archive(path)}

    def read(self, name: str) -> bytes:
        """Content of a file of the archive.

        Raises:
            InputError: it is not there, larger than ``LARGEST``, or damaged.
        """
        if name not in self._sizes:
            raise InputError(f"'{self.path}' has no '{name}'{nearest(name, self._sizes)}")
        if self._sizes[name] > LARGEST:
            raise InputError(f"'{self.path}': '{name}' is larger than {LARGEST // 2**30} GiB")
        try:
            with zipfile.ZipFile(self.path) as archive:
                return archive.read(name)
        except DAMAGED as error:
            raise InputError(f"'{self.path}': '{name}' cannot be unpacked: {error}") from None


def check_xml(data: bytes, path: Path | str, what: str) -> None:
    """Refuse XML that declares a document type, which allows entity bombs and reads of local files.

    Args:
        data: the document.
        path: where it comes from.
        what: what it should be, for the message.

    Raises:
        InputError: it has a DOCTYPE, or is not XML.
    """

    def refuse(*_: object) -> None:
        raise InputError(f"'{path}' is refused: its XML declares a document type (DOCTYPE)")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        raise InputError(f"'{path}' cannot be read as {what}: {error}") from None


def real(text: str) -> float | None:
    """A finite number as XML writes it (xs:double); None for anything else."""
    value = float(text) if REAL.fullmatch(text := text.strip()) else math.nan
    return value if math.isfinite(value) else None


def integer(text: str) -> int | None:
    """A whole number as XML writes it (xs:integer); None for anything else."""
    return int(text) if INTEGER.fullmatch(text := text.strip()) else None
