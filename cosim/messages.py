"""What FMUs tell through their loggers."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass
class Message:
    """What an FMU told through its logger."""

    instance: str
    status: int
    text: str


class Messages:
    """Collects the first warnings and errors that FMUs log."""

    KEEP = 200

    def __init__(self, show: Callable[[str], None]) -> None:
        self.count = 0
        self.kept: list[Message] = []
        self._show = show

    def add(self, instance: str, status: int, text: str) -> None:
        if status == 0:  # mere information
            return
        self.count += 1
        if self.count <= self.KEEP:
            self.kept.append(Message(instance, status, text))
            self._show(f"{instance}: {text}")
        elif self.count == self.KEEP + 1:
            self._show(f"FMUs logged more than {self.KEEP} messages; the rest is not shown")
