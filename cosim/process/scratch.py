"""Scratch folders for unpacked archives, and the removal of those that killed runs have left."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

PREFIX = "cosim_"
LOCK = "lock"  # file in the folder, locked by its owner for as long as that lives


class Scratch:
    """A folder of this process in the folder for temporary files; empty.

    Attributes:
        path: the folder.
    """

    def __init__(self) -> None:
        self._outer = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{os.getpid()}_"))
        self._lock = FileLock(self._outer / LOCK)
        self._lock.acquire(blocking=False)
        self.path = self._outer / "files"
        self.path.mkdir()

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        with suppress(OSError):  # an FMU has closed it
            self._lock.release()
        shutil.rmtree(self._outer, ignore_errors=True)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A scratch folder for a block."""
    scratch = Scratch()
    try:
        yield scratch.path
    finally:
        scratch.remove()


def is_scratch(folder: Path) -> bool:
    """Whether a folder lies in a scratch folder of some process."""
    outer = Path(tempfile.gettempdir())
    return any(p.parent == outer and p.name.startswith(PREFIX) for p in (folder, *folder.parents))


def sweep() -> None:
    """Remove the scratch folders of this user's processes that have ended without doing so."""
    with suppress(OSError):
        for folder in Path(tempfile.gettempdir()).glob(f"{PREFIX}*"):
            if (owner := re.fullmatch(rf"{PREFIX}(\d+)_\w+", folder.name)) and _is_mine(folder):
                _sweep(folder, int(owner[1]))


def _is_mine(folder: Path) -> bool:
    info = folder.lstat()
    return folder.is_dir() and (not hasattr(os, "getuid") or info.st_uid == os.getuid())


def _sweep(folder: Path, owner: int) -> None:
    # An FMU may have closed its owner's lock; in another container its owner may be alive unseen.
    if _runs(owner):
        return
    try:
        with FileLock(folder / LOCK, timeout=0):
            pass
    except (Timeout, OSError):
        return
    shutil.rmtree(folder, ignore_errors=True)


def _runs(pid: int) -> bool:
    """Whether there is such a process; on Windows, where asking would end it, only the lock tells."""
    if os.name == "nt":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
