"""Files in the user's cache: whole, of this user, and where nobody else may write.

What is loaded from there runs as the user. ``fmus.build`` keeps FMUs in the same way, in code of its
own: neither package imports the other.
"""

import hashlib
import os
import shutil
import stat
from pathlib import Path

from cybership.scratch_folder import atomic_write

SEAL = ".sha256"  # ends the name of the file next to an entry with its size [bytes] and SHA-256


def is_whole(path: Path) -> bool:
    """Whether an entry is there, and is what was stored."""
    try:
        return path.with_name(path.name + SEAL).read_text() == _seal(path)
    except (OSError, ValueError):
        return False


def _seal(path: Path) -> str:
    content = path.read_bytes()
    return f"{len(content)} {hashlib.sha256(content).hexdigest()}\n"


def store(source: Path, path: Path) -> None:
    """Copy a file into the cache, so that even a loss of power leaves it whole or not sealed."""
    seal = path.with_name(path.name + SEAL)
    seal.unlink(missing_ok=True)
    with atomic_write(path) as scratch:
        shutil.copyfile(source, scratch)
        _sync(scratch)
    with atomic_write(seal) as scratch:
        scratch.write_text(_seal(source))
        _sync(scratch)


def _sync(path: Path) -> None:
    with open(path, "rb+") as file:
        os.fsync(file.fileno())


def make_folder(folder: Path) -> None:
    """Make a folder of the cache, in which only this user may write."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    folder.mkdir(mode=0o755, exist_ok=True)


def refusal(path: Path) -> str:
    """Why an entry must not be loaded, whatever it holds: somebody else may have written it."""
    if not hasattr(os, "getuid"):  # Windows, where the user's folders are the user's
        return ""
    for place in (path, path.parent):
        if not place.exists():
            continue
        info = place.stat()
        if info.st_uid not in (os.getuid(), 0):
            return f"'{place}' belongs to another user, and is not loaded"
        if info.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"other users may write to '{place}', so it is not loaded (chmod go-w)"
    return ""
