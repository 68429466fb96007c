"""The result folder of a run, which one run at a time writes to."""

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

from ..errors import InputError, not_written
from ..results.folder_lock import locked_folder
from ..results.log import SIDECAR
from ..results.result_files import clear_results

LOCK = ".lock"


class ResultFolder(ExitStack):
    """The folder of a run: made by :meth:`make`, and its own until it is closed.

    Args:
        path: of the folder.
        note: shown when it is made; empty: nothing is.
    """

    def __init__(self, path: Path, note: str = "") -> None:
        super().__init__()
        self.path, self.note = path, note

    def make(self, show: Callable[[str], None]) -> None:
        """Make it, without what an earlier run left there; ``show`` receives notes, a line each.

        Raises:
            InputError: another run writes to it, or it cannot be made.
        """
        taken = f"another run writes to '{self.path}'; --out names another folder"
        self.enter_context(locked_folder(self.path, LOCK, taken))
        try:
            if (self.path / SIDECAR).exists():
                show(f"note: replaces the earlier run in '{self.path}'")
            clear_results(self.path)
        except OSError as error:
            raise InputError(not_written(self.path, error)) from None
        if self.note:
            show(self.note)
