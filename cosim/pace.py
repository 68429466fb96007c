"""Keeps a run at a multiple of wall time."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field


@dataclass
class Pace:
    """Keeps simulated time at a multiple of wall time, and counts how often it could not."""

    factor: float
    step: float
    interrupted: Callable[[], bool]
    started: float = field(default_factory=time.perf_counter)
    steps: int = 0
    misses: int = 0
    worst: float = 0.0
    total: float = 0.0
    squares: float = 0.0

    def wait(self, t: float) -> None:
        """Return when it is time for t, or when the user has had enough."""
        due = self.started + t / self.factor
        while (left := due - time.perf_counter()) > 0.0 and not self.interrupted():
            time.sleep(min(left, 0.05))
        late = time.perf_counter() - due
        self.steps += 1
        self.misses += late > self.step / self.factor
        self.worst = max(self.worst, late)
        self.total += late
        self.squares += late * late

    def summary(self) -> dict[str, float]:
        """Numbers for log.json: how late steps were [s], and how many by more than a step."""
        mean = self.total / max(1, self.steps)
        return {
            "factor": self.factor,
            "deadline_misses": self.misses,
            "lateness_max": self.worst,
            "jitter_rms": math.sqrt(max(0.0, self.squares / max(1, self.steps) - mean * mean)),
        }
