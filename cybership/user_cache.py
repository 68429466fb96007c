"""Files in the user's cache (FMUs, step loop): whole, of this user, and where nobody else may write.

What is taken from there runs as the user.
"""

import hashlib
import os
import shutil
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from platformdirs import user_cache_path

from .scratch_folder import atomic_write, scratch_folder, sweep_parts

SEAL = ".sha256"  # ends the name of the file next to an entry with its size [bytes] and SHA-256


class RefusedError(Exception):
    """An entry must not be used; the message says why."""


def kept(cache: Path, path: Path, make: Callable[[Path], Path], patience: float | None = None) -> Path:
    """An entry of the cache, which is made if it is not there or not whole.

    Of processes that ask at once one makes it, and the others wait for that one.

    Args:
        cache: the cache.
        path: of the entry.
        make: returns a file, which it may make in the scratch folder that it is given.
        patience: longest wait for another process [s]; None: without end.

    Raises:
        RefusedError: another user may have written it.
        filelock.Timeout: another process takes longer.
        OSError: the cache cannot be written.
    """
    if not _is_usable(cache, path):
        from filelock import FileLock  # only now: most calls find the entry, and this takes a while

        make_folder(cache, path.parent)
        with FileLock(path.with_name(f"{path.name}.lock"), -1 if patience is None else patience):
            if not _is_usable(cache, path):
                with scratch_folder() as work:
                    store(make(work), path)
    return path


def _is_usable(cache: Path, path: Path) -> bool:
    if why := refusal(cache, path):
        raise RefusedError(why)
    return is_whole(path)


def cache_folder() -> Path | None:
    """The folder: ``CYBERSHIP_CACHE``, else in the user's cache folder; None: the user has no home."""
    if chosen := os.environ.get("CYBERSHIP_CACHE"):
        return Path(chosen)
    with suppress(RuntimeError):  # of newer versions; older ones give a relative path
        if (folder := user_cache_path("cybership")).is_absolute():
            return folder
    return None


def make_folder(cache: Path, folder: Path) -> None:
    """Make the cache and a folder of it, in which only this user may write.

    What killed processes have left in the cache is removed.
    """
    cache.parent.mkdir(parents=True, exist_ok=True)
    for place in (cache, folder):
        place.mkdir(mode=0o755, exist_ok=True)
    sweep_parts(cache.glob("**/.*.part"))


def refusal(cache: Path, path: Path) -> str:
    """Why an entry must not be used, whatever it holds: another user may have written it; else empty."""
    if not hasattr(os, "getuid"):  # Windows, where the user's folders are the user's
        return ""
    for place in (path, *(p for p in path.parents if p.is_relative_to(cache))):
        if not place.exists():
            continue
        info = place.stat()
        if info.st_uid not in (os.getuid(), 0):
            return f"'{place}' belongs to another user; set CYBERSHIP_CACHE to another folder"
        if info.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"other users may write to '{place}', so it is not used (chmod go-w)"
    return ""


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
    place(source, path)
    with atomic_write(seal) as part:
        part.write_text(_seal(source))
        _sync(part)


def place(source: Path, target: Path) -> Path:
    """Copy a file so that the target is either the old one or the whole new one."""
    with atomic_write(target) as part:
        shutil.copyfile(source, part)
        _sync(part)
    return target


def _sync(path: Path) -> None:
    with open(path, "rb+") as file:
        os.fsync(file.fileno())
