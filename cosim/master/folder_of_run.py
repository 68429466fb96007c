"""The result folder of a run, which one run at a time writes to."""

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout

from ..errors import InputError, not_written
from ..results.log import SIDECAR
from ..results.result_files import clear_results

LOCK = ".lock"  # locked by the run, as long as it lives; removed when it ends


class ResultFolder:
    """The folder of a run: made by :meth:`make`, and its own until :meth:`leave`.

    Args:
        path: of the folder.
        note: shown when it is made; empty: nothing is.
    """

    def __init__(self, path: Path, note: str = "") -> None:
        self.path, self.note = path, note
        self._lock = FileLock(path / LOCK, timeout=0)

    def make(self, show: Callable[[str], None]) -> None:
        """Make it, without what an earlier run left there; ``show`` receives notes, a line each.

        Raises:
            InputError: another run writes to it, or it cannot be made.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._lock.acquire()
            if (self.path / SIDECAR).exists():
                show(f"note: replaces the earlier run in '{self.path}'")
            clear_results(self.path)
        except Timeout:
            raise InputError(
                f"another run writes to '{self.path}'; --out names another folder"
            ) from None
        except OSError as error:
            raise InputError(not_written(self.path, error)) from None
        if self.note:
            show(self.note)

    def leave(self) -> None:
        """Let other runs write to it."""
        if self._lock.is_locked:
            with suppress(OSError):
                os.unlink(self.path / LOCK)
            with suppress(OSError):  # an FMU has closed it
                self._lock.release()
