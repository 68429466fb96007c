"""Runs in real time: simulated time kept at a multiple of wall time."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from ..process.run_state import STATE

# Longest time without a look at the interrupt flag [s]; chosen: not noticeable.
LONGEST_SLEEP = 0.05


@dataclass
class RealTimePace:
    """Keeps simulated time at a multiple of wall time, and measures the lateness.

    Args:
        factor: simulated seconds per second of wall time.
        step: base step [s].
        interrupted: whether the user has stopped the run.
    """

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
        """Return when wall time reaches t [s], or when the user has stopped the run."""
        due = self.started + t / self.factor
        STATE.calls_nothing()
        while (left := due - time.perf_counter()) > 0.0 and not self.interrupted():
            time.sleep(min(left, LONGEST_SLEEP))
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
