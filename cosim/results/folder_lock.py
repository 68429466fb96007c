"""A folder that one process at a time writes to."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from ..errors import InputError, not_written


@contextmanager
def locked_folder(folder: Path, lock: str, taken: str) -> Iterator[None]:
    """A folder, which is made, in which no other process has the lock.

    Args:
        folder: its path.
        lock: name of a file in it, removed at the end.
        taken: message where another process has it.

    Raises:
        InputError: another process has it, or the folder cannot be written.
    """
    file = FileLock(folder / lock, timeout=0)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file.acquire()
    except Timeout:
        raise InputError(taken) from None
    except OSError as error:
        raise InputError(not_written(folder, error)) from None
    try:
        yield
    finally:
        with suppress(OSError):
            os.unlink(folder / lock)
        with suppress(OSError):  # an FMU has closed it
            file.release()
