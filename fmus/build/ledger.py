"""What was built here: the hash of every program file that a build on this computer put into an FMU.

A file with such a hash came from this project's source, compiled here or by its release, from a
component file given to the build, or from the installed pythonfmu: every program in it is known. The
model description holds no program and does not count, so an FMU whose start values were changed is still
one of ours.
"""

import hashlib
import zipfile
from pathlib import Path

LEDGER = "built.sha256"
# Where FMI 2.0 has programs: libraries, whatever they read or run, source that a tool may compile.
PROGRAMS = ("binaries/", "resources/", "sources/")


def _programs(fmu: Path) -> dict[str, str]:
    """SHA-256 of every program file inside an FMU, by name."""
    found: dict[str, str] = {}
    with zipfile.ZipFile(fmu) as archive:
        for entry in archive.infolist():
            if entry.filename.startswith(PROGRAMS) and not entry.is_dir():
                digest = hashlib.sha256()
                with archive.open(entry) as reader:
                    while block := reader.read(1 << 20):
                        digest.update(block)
                found[entry.filename] = digest.hexdigest()
    return found


def _known(folder: Path) -> set[str]:
    try:
        return set((folder / LEDGER).read_text(encoding="utf-8").split())
    except FileNotFoundError:
        return set()


def record(fmu: Path, folder: Path) -> None:
    """Enter an FMU that has just been built.

    Args:
        fmu: its file.
        folder: where the ledger is; the caller holds its lock.
    """
    new = sorted(set(_programs(fmu).values()) - _known(folder))
    if new:
        with (folder / LEDGER).open("a", encoding="utf-8") as ledger:
            ledger.write("".join(f"{digest}\n" for digest in new))


def unknown_binary(fmu: Path, folder: Path) -> str:
    """Name of the first program file in an FMU that no build here has made; empty if there is none.

    Args:
        fmu: its file.
        folder: where the ledger is.
    """
    known = _known(folder)
    return next((name for name, digest in _programs(fmu).items() if digest not in known), "")
