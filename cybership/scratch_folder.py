"""Scratch folders named by their process, and the removal of those that killed processes have left."""

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX = "cybership_"
LOCK = "lock"  # file in the folder, locked by its owner for as long as that lives


class Scratch:
    """A folder of this process; empty.

    Args:
        folder: in which it is made; by default that for temporary files.
        prefix: of its name, before the number of the process.

    Attributes:
        outer: the folder, and its lock.
        path: what it is for: a folder inside.
    """

    def __init__(self, folder: Path | None = None, prefix: str = PREFIX) -> None:
        from filelock import FileLock  # only now: it takes a while to import

        self.outer = Path(tempfile.mkdtemp(prefix=f"{prefix}{os.getpid()}_", dir=folder))
        self._lock = FileLock(self.outer / LOCK)
        self._lock.acquire(blocking=False)
        self.path = self.outer / "files"
        self.path.mkdir()

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        with suppress(OSError):  # an FMU has closed it
            self._lock.release()
        shutil.rmtree(self.outer, ignore_errors=True)


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A scratch folder for a block."""
    scratch = Scratch()
    try:
        yield scratch.path
    finally:
        scratch.remove()


def environment_with(folder: Path) -> dict[str, str]:
    """The environment of a program that keeps its temporary files in a folder, such as a compiler."""
    return {**os.environ, **dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(folder))}


def is_scratch(folder: Path) -> bool:
    """Whether a folder lies in a scratch folder of some process."""
    outer = Path(tempfile.gettempdir())
    return any(p.parent == outer and p.name.startswith(PREFIX) for p in (folder, *folder.parents))


def sweep(folder: Path | None = None, prefix: str = PREFIX) -> int:
    """Remove the scratch folders of this user's processes that have ended without doing so.

    Args:
        folder: in which they lie; by default that for temporary files.
        prefix: of their names.

    Returns:
        How many were removed.
    """
    with suppress(OSError):
        there = (folder or Path(tempfile.gettempdir())).glob(f"{prefix}*")
        owned = [(p, re.fullmatch(rf"{re.escape(prefix)}(\d+)_\w+", p.name)) for p in there]
        return sum(_sweep(p, int(owner[1])) for p, owner in owned if owner and _is_mine(p))
    return 0


def _is_mine(folder: Path) -> bool:
    info = folder.lstat()
    return folder.is_dir() and (not hasattr(os, "getuid") or info.st_uid == os.getuid())


def _sweep(folder: Path, owner: int) -> bool:
    # An FMU may have closed its owner's lock; in another container its owner may be alive unseen.
    if _runs(owner):
        return False
    from filelock import FileLock, Timeout

    try:
        with FileLock(folder / LOCK, timeout=0):
            pass
    except (Timeout, OSError):
        return False
    shutil.rmtree(folder, ignore_errors=True)
    return not folder.exists()


def _runs(pid: int) -> bool:
    """Whether there is such a process; on Windows, where asking would end it, only the lock tells."""
    if os.name == "nt":
        return False
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
