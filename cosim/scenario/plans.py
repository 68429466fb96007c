"""Plans: what depends on time and chance in an operation, asked call by call or for many calls at once.

Both ways draw the same random numbers in the same order.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence

import numpy as np

# Tolerance of time comparisons [s]: rounding must not move an instant by a step, and no step is shorter
# than 1e-6 s.
TIME_TOLERANCE = 1e-9
# Samples of noise that are drawn at once; chosen: many, because the call of the generator is what costs.
DRAWN = 1024

# What an operation applies at a call at t [s], a number for each slot; None where it does not act then.
# It is called once for each call, with times that do not decrease.
Plan = Callable[[float], Sequence[float] | None]


class PlanAhead(ABC):
    """A plan that is quicker for many calls at once than call by call."""

    @abstractmethod
    def __call__(self, t: float) -> Sequence[float] | None:
        """What is applied at a call at t [s]."""

    @abstractmethod
    def ahead(self, times: np.ndarray, acts: np.ndarray, numbers: np.ndarray) -> None:
        """What is applied at the next calls.

        Args:
            times: of the calls [s].
            acts: receives 1 at each call at which the operation acts; zeros before, shape (calls,).
            numbers: receives what is applied, shape (calls, slots); zeros before.
        """


def ask_ahead(plan: Plan, times: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """What a plan applies at some calls.

    Args:
        plan: of an operation.
        times: of the calls [s].
        width: how many numbers a call takes.

    Returns:
        Whether it acts at each, shape (calls,), and what is applied, shape (calls, width).

    Raises:
        ValueError: the plan gives another number of numbers.
    """
    acts, numbers = np.zeros(len(times), np.uint8), np.zeros((len(times), width))
    if isinstance(plan, PlanAhead):
        plan.ahead(times, acts, numbers)
        return acts, numbers
    for k, t in enumerate(times.tolist()):
        if (row := plan(t)) is not None:
            if len(row) != width:
                raise ValueError(f"a plan gives {len(row)} numbers for {width} slots")
            acts[k], numbers[k] = 1, row
    return acts, numbers


class WhiteNoise(PlanAhead):
    """Independent Gaussian numbers of mean zero at each call.

    Args:
        std: standard deviation of each number.
        rng: random numbers of this plan alone.
    """

    def __init__(self, std: Sequence[float], rng: np.random.Generator) -> None:
        self._std, self._rng = np.array(std), rng
        self._rows = np.empty((0, len(std)))  # drawn ahead and left, the next one is the last
        self._drawn: list[list[float]] = []  # behind these, for single calls
        self._at_once = 1  # so many become a list the next time: a few calls need no long one

    def _next(self) -> np.ndarray:
        """Rows that have not been given, at least one."""
        left = np.concatenate([self._rows, self._drawn]) if self._drawn else self._rows
        self._rows, self._drawn = self._rows[:0], []
        if len(left):
            return left
        with np.errstate(over="ignore"):  # the run ends at a number that is not finite
            return self._std * self._rng.standard_normal((DRAWN, len(self._std)))

    def __call__(self, t: float) -> Sequence[float]:
        if not self._drawn:
            rows = self._next()
            kept = max(0, len(rows) - self._at_once)
            self._rows, self._drawn = rows[:kept], rows[kept:].tolist()
            self._at_once = min(2 * self._at_once, DRAWN)
        return self._drawn.pop()

    def ahead(self, times: np.ndarray, acts: np.ndarray, numbers: np.ndarray) -> None:
        acts[:] = 1
        k = 0
        while k < len(numbers):
            rows = self._next()
            taken = min(len(rows), len(numbers) - k)
            numbers[k : k + taken] = rows[::-1][:taken]
            self._rows = rows[: len(rows) - taken]
            k += taken


class TimeSpans:
    """Spans of time, given or random.

    Args:
        at: when they begin [s]; None draws that.
        rate: how often they begin at random [1/s], where ``at`` is None.
        duration: ``duration()`` draws how long one is [s].
        rng: random numbers of this plan alone.
    """

    def __init__(
        self,
        at: Sequence[float] | None,
        rate: float,
        duration: Callable[[], float],
        rng: np.random.Generator,
    ) -> None:
        self._given = None if at is None else sorted(at)
        self._rate, self._duration, self._rng = rate, duration, rng
        self._start, self._stop = self._after(0.0), -math.inf

    def _after(self, stop: float) -> float:
        """When the next one begins [s]."""
        if self._given is None:
            return stop + self._rng.exponential(1.0 / self._rate)
        return self._given.pop(0) if self._given else math.inf

    def __call__(self, t: float) -> bool:
        """Whether t [s] is in one; t must not decrease."""
        while t >= self._start - TIME_TOLERANCE:
            self._stop = max(self._stop, self._start + self._duration())
            self._start = self._after(self._stop)
        return t < self._stop - TIME_TOLERANCE

    def ahead(self, times: np.ndarray) -> Iterator[tuple[int, int]]:
        """Which of the times are in one: the first, and the one behind the last, of each span."""
        k = 0
        while k < len(times):
            if self(float(times[k])):
                # Up to the end or the beginning of the next one all is as it is now.
                change = min(self._stop, self._start) - TIME_TOLERANCE
                end = max(k + 1, int(np.searchsorted(times, change)))
                yield k, end
                k = end
            else:
                k = max(k + 1, int(np.searchsorted(times, self._start - TIME_TOLERANCE)))


class Within(PlanAhead):
    """Acts within windows.

    Args:
        windows: when.
        row: ``row()`` is what is applied at a call then.
    """

    def __init__(self, windows: TimeSpans, row: Callable[[], Sequence[float]]) -> None:
        self._windows, self._row = windows, row

    def __call__(self, t: float) -> Sequence[float] | None:
        return self._row() if self._windows(t) else None

    def ahead(self, times: np.ndarray, acts: np.ndarray, numbers: np.ndarray) -> None:
        for first, end in self._windows.ahead(times):
            acts[first:end] = 1
            for k in range(first, end):
                numbers[k] = self._row()
