"""What lies in the archive (2.3)."""

import stat
from collections import Counter
from collections.abc import Iterator
from pathlib import PurePosixPath, PureWindowsPath
from zipfile import ZIP_DEFLATED, ZIP_STORED

from ..fmu import FmuArchive, suffix
from ..registry import rule


@rule("2.3")
def archive(fmu: FmuArchive) -> Iterator[str]:
    """Every path in the archive is relative, stays inside, occurs once, is not a link, has forward
    slashes, and is stored or compressed with deflate.
    """
    for member in fmu.members:
        # ZipInfo.filename has been tidied already; what was written is in orig_filename.
        name = member.orig_filename
        path = PureWindowsPath(name)  # which knows drives, too
        if "\\" in name:
            yield f"'{name}' has a backslash"
        if path.anchor or ".." in path.parts:
            yield f"'{name}' leads out of the folder that it is unpacked to"
        if stat.S_ISLNK(member.external_attr >> 16):
            yield f"'{name}' is a link"
        if member.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
            yield f"'{name}' is compressed by method {member.compress_type}, not by deflate"
    for name, times in Counter(member.filename for member in fmu.members).items():
        if times > 1:
            yield f"'{name}' occurs {times} times"


@rule("2.3")
def binaries(fmu: FmuArchive) -> Iterator[str]:
    """Each platform folder contains the library that modelIdentifier names; without such folders
    there are sources.
    """
    names = {member.filename for member in fmu.members}
    identifier = fmu.description.cs.get("modelIdentifier", "")
    folders = {
        PurePosixPath(n).parts[1] for n in names if n.startswith("binaries/") and n.count("/") > 1
    }
    for folder in sorted(folders):
        library = f"binaries/{folder}/{identifier}{suffix(folder)}"
        if suffix(folder) and library not in names:
            yield f"'{library}' is missing"
    if not any(map(suffix, folders)) and not any(n.startswith("sources/") for n in names):
        yield "the archive has neither binaries for a platform of the standard nor sources"
