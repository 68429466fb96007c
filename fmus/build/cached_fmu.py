"""FMUs in the user's cache: whole, of this user, and where nobody else may write.

What is taken from there runs as the user. ``cosim.compiled`` keeps its library in the same way, in code
of its own, as neither package imports the other.
"""

import hashlib
import os
import shutil
import stat
from contextlib import suppress
from pathlib import Path

from platformdirs import user_cache_path

from cybership.scratch_folder import atomic_write, sweep_parts

from .finding import BuildError

SEAL = ".sha256"  # ends the name of the file next to an entry with its size [bytes] and SHA-256


def cache_folder() -> Path:
    """Where built FMUs are kept: ``CYBERSHIP_CACHE``, else the user's cache folder.

    Raises:
        BuildError: the user has no folder of that kind.
    """
    if chosen := os.environ.get("CYBERSHIP_CACHE"):
        return Path(chosen)
    with suppress(RuntimeError):  # of newer versions; older ones give a relative path
        if (folder := user_cache_path("cybership")).is_absolute():
            return folder
    raise BuildError("this user has no home folder: set CYBERSHIP_CACHE to a folder for built FMUs")


def is_whole(fmu: Path) -> bool:
    """Whether an entry is there, and is what was stored.

    Raises:
        BuildError: somebody else may have written it.
    """
    if hasattr(os, "getuid"):  # on Windows the user's folders are the user's
        for place in (fmu, fmu.parent, fmu.parent.parent):
            _refuse_foreign(place)
    try:
        return fmu.with_name(fmu.name + SEAL).read_text() == _seal(fmu)
    except (OSError, ValueError):
        return False


def _refuse_foreign(place: Path) -> None:
    if not place.exists():
        return
    info = place.stat()
    if info.st_uid not in (os.getuid(), 0):
        raise BuildError(f"'{place}' belongs to another user; set CYBERSHIP_CACHE to another folder")
    if info.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise BuildError(f"other users may write to '{place}', so it is not used (chmod go-w)")


def _seal(fmu: Path) -> str:
    content = fmu.read_bytes()
    return f"{len(content)} {hashlib.sha256(content).hexdigest()}\n"


def make_folder(folder: Path) -> None:
    """Make a folder of the cache, in which only this user may write.

    What killed processes have left in the cache is removed.

    Raises:
        BuildError: it cannot be made.
    """
    try:
        cache_folder().parent.mkdir(parents=True, exist_ok=True)
        for place in (cache_folder(), folder):
            place.mkdir(mode=0o755, exist_ok=True)
        sweep_parts(cache_folder().glob("**/.*.part"))
    except OSError as error:
        raise BuildError(
            f"cannot keep FMUs in '{folder}' ({error.strerror}); set CYBERSHIP_CACHE to another "
"folder"
        ) from None


def store(built: Path, fmu: Path) -> None:
    """Copy an FMU into the cache, so that even a loss of power leaves it whole or not sealed."""
    seal = fmu.with_name(fmu.name + SEAL)
    seal.unlink(missing_ok=True)
    place(built, fmu)
    sealed = built.with_name(seal.name)
    sealed.write_text(_seal(built))
    place(sealed, seal)


def place(source: Path, target: Path) -> Path:
    """Copy a file so that the target is either the old one or the whole new one."""
    with atomic_write(target) as part:
        shutil.copyfile(source, part)
        with open(part, "rb+") as file:
            os.fsync(file.fileno())
    return target
