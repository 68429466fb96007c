"""Scratch folders and files named by their process; removal of what killed processes have left."""

import glob
import os
import re
import shutil
import tempfile
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PREFIX = "cybership_"
LOCK = "lock"  # file in the folder, locked by its owner for as long as that lives
# Age from which a file is left over, as its owner may be alive unseen in another container [s]; chosen:
# no write pauses as long.
STALE = 60.0


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


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A scratch file to write, which replaces ``path`` when the block ends without an exception.

    It is in the same folder; a failure leaves ``path`` as it was and removes the scratch file. Scratch
    files of the same path that killed processes have left are removed as well.
    """
    sweep_parts(path.parent.glob(f".{glob.escape(path.name)}.*.part"))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield part
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)


def sweep_parts(parts: Iterable[Path]) -> None:
    """Remove those scratch files of :func:`atomic_write` whose processes have ended.

    Args:
        parts: files whose names end in ``.part``.
    """
    with suppress(OSError):
        for part in parts:
            owner = re.search(r"\.(\d+)\.part$", part.name)
            if owner and not _runs(int(owner[1])) and time.time() - part.lstat().st_mtime > STALE:
                part.unlink(missing_ok=True)


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
    with suppress(OSError):  # Linux: one that has ended, and that nobody has waited for, is still listed
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
