"""Log messages of FMUs."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Message:
    """A log message of an FMU."""

    instance: str
    status: int
    text: str


class Messages:
    """Collects the first warnings and errors that FMUs log.

    Args:
        show: receives each as a line for the user.
    """

    KEEP = 200  # messages; chosen: more would fill log.json and the terminal

    def __init__(self, show: Callable[[str], None]) -> None:
        self.count = 0
        self.kept: list[Message] = []
        self._show = show

    def add(self, instance: str, status: int, text: str) -> None:
        if status == 0:  # information only
            return
        self.count += 1
        if self.count <= self.KEEP:
            self.kept.append(Message(instance, status, text))
            self._show(f"{instance}: {text}")
        elif self.count == self.KEEP + 1:
            self._show(f"FMUs logged more than {self.KEEP} messages; the rest is not shown")
