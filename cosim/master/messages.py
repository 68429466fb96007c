"""Log messages of FMUs."""

from collections.abc import Callable
from typing import Any


class Messages:
    """Collects the first warnings and errors that FMUs log.

    Args:
        show: receives each as a line for the user.

    Attributes:
        kept: each as log.json has it.
    """

    KEEP = 200  # messages; chosen: more would fill log.json and the terminal

    def __init__(self, show: Callable[[str], None]) -> None:
        self.count = 0
        self.kept: list[dict[str, Any]] = []
        self._show = show

    def add(self, instance: str, status: int, text: str) -> None:
        if status == 0:  # information only
            return
        self.count += 1
        if self.count <= self.KEEP:
            self.kept.append({"instance": instance, "status": status, "text": text})
            self._show(f"{instance}: {text}")
        elif self.count == self.KEEP + 1:
            self._show(f"FMUs logged more than {self.KEEP} messages; the rest is not shown")
