"""How long a search for effects still takes, by the steps that have ended and those that usually follow.

The number of effects is known only in the end: that of the rounds is the usual one, or the present one
and half a round more. Where no effect was found, none is validated and
fitted. How long a step takes is scaled by what the steps so far took.
"""

import re
import time
from collections.abc import Callable

# s of processor time for ten minutes of the Otter at 10 Hz; only their ratios count.
ROUND = {"every effect as a candidate": 1.0, "candidates refined": 0.5}
AGAIN = {"its place searched again": 3.0}
OF_EFFECTS = {"validation data are predicted better": 1.1, "fit to predictions": 1.3}
LAST = {
    "waves": 0.7,
    **OF_EFFECTS,
    "residual": 0.1,
    "gain of the search over calibration": 1.7,
    "predicting": 0.4,
    "stability": 1.1,
    "report: figures": 1.0,
    "report: page": 0.1,
}
FIRST = {"reading": 0.1, "smoothing": 1.2, "calibration of the coefficients": 2.9}
USUAL = {**FIRST, **ROUND, **AGAIN, **LAST}
# Usual number, the last of which finds nothing. Chosen: simulated runs take 2 and measured ones up to 5,
# and the remaining time of 3 is between theirs.
ROUNDS = 3.0
LATE = (
    0.3  # share of its time that a step is taken to go on for where it takes longer than usual; chosen
)


class RemainingTime:
    """The remaining time of ``learn``, once its search has begun.

    Args:
        now: the time [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now, self._started = now, now()
        self._step, self._begun, self._round, self._again = "", self._started, 0, 0
        self._took, self._usual = 0.0, 0.0
        self._left: dict[str, float] = {}

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return self._now() - self._started

    @property
    def seconds(self) -> float | None:
        """The remaining time [s]; None: the search has not begun."""
        if not self._round:
            return None
        usual = self._scale * USUAL.get(self._step, 0.0)
        spent = self._now() - self._begun
        return max(usual - spent, LATE * spent) + self._scale * sum(self._left.values())

    @property
    def share(self) -> float | None:
        """The share of the whole time that is over; None: not known."""
        left = self.seconds
        return None if left is None else self.elapsed / max(self.elapsed + left, 1e-9)

    @property
    def _scale(self) -> float:
        """Time of the steps so far over their usual one."""
        return self._took / self._usual if self._usual else 1.0

    def begin(self, what: str) -> None:
        """A step begins, and the one before it has ended."""
        now = self._now()
        if self._step:
            self._took += now - self._begun
            self._usual += USUAL[self._step]
        self._step, self._begun = next((name for name in USUAL if name in what), ""), now
        if self._step in ROUND or self._step in AGAIN:
            self._again = self._again + 1 if self._step in AGAIN else 0
            number = re.match(r"effect (\d+)", what)
            self._round = max(self._round, int(number[1]) if number else 1)
            self._left = self._following()
        elif self._step in LAST and self._round:
            names = [*LAST]
            skipped = OF_EFFECTS if self._round == 1 else ()
            names = [name for name in names[names.index(self._step) + 1 :] if name not in skipped]
            self._left = {name: LAST[name] for name in names}

    def _following(self) -> dict[str, float]:
        """The time of each kind of step that usually follows the present one of a round."""
        rounds = max(ROUNDS, self._round + 0.5)
        left = {name: (rounds - self._round) * usual for name, usual in ROUND.items()}
        # A place is searched again twice for each effect but one, and goes on where it went on long.
        before, effects = self._round - 1.0, rounds - 1.0
        again = effects * (effects - 1.0) - before * (before - 1.0)
        if self._again:
            again = max(2.0 - self._again, 0.5 * self._again)
        if self._step == next(iter(ROUND)):
            left["candidates refined"] += ROUND["candidates refined"]
        return left | {name: again * usual for name, usual in AGAIN.items()} | LAST
