"""How long a search for effects still takes, by the steps that have ended and those that usually follow.

The number of effects is known only in the end. It is between those that were found and those that the
search announces as likely (:mod:`diagnosis.search.shortlist`): the times for both are stated. A kind of
step that has ended takes what it took; any other one its usual time, scaled by what the steps of the
search took.
"""

import math
import re
import time
from collections.abc import Callable, Sequence

ROUND = ("every effect as a candidate", "candidates refined")
AGAIN = "its place searched again"  # of one effect, each time that another one is found
OF_EACH = "validation data are predicted better"  # for each effect
OF_EFFECTS = (OF_EACH, "fit to predictions")  # only where there is one
# s of processor time, medians of six logs (benchmarks/code.md); only ratios count. In their order.
USUAL = {
    **dict(zip(ROUND, (0.9, 0.8), strict=True)),
    AGAIN: 0.8,
    "waves": 0.7,
    **dict(zip(OF_EFFECTS, (0.3, 2.2), strict=True)),
    "residual": 0.2,
    "gain of the search over calibration": 0.2,
    "predicting": 0.2,
    "stability": 1.2,
    "report: figures": 0.2,
    "report: page": 0.2,
}
LAST = [*USUAL][[*USUAL].index(AGAIN) + 1 :]  # steps behind the search
# 1, share of its time that a step is taken to go on for where it takes longer than usual; chosen.
LATE = 0.3


class RemainingTime:
    """The remaining time of ``learn``, once its search has regressed all candidates.

    Args:
        now: the time [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now, self._started = now, now()
        self._step, self._begun, self._round, self._again = "", self._started, 0, 0
        self._took: dict[str, list[float]] = {}  # kind of step -> how long each took, over its number
        self._number = 1.0  # of the present step: of effects where it takes as long as they are many
        self._likely = 0
        # Of each kind of step, for the fewest effects and for those that are likely.
        self._left: list[dict[str, float]] = []

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return self._now() - self._started

    @property
    def ends(self) -> tuple[float, float] | None:
        """Remaining times [s] for the fewest and for the likely effects; None: not known yet."""
        if not self._round:
            return None
        spent = self._now() - self._begun
        present = max(self._number * self._usual(self._step) - spent, LATE * spent)
        rest = [sum(number * self._usual(name) for name, number in left.items()) for left in self._left]
        return present + rest[0], present + rest[-1]

    @property
    def seconds(self) -> float | None:
        """The remaining time [s], the geometric mean of its ends; None: not known yet."""
        ends = self.ends
        return None if ends is None else math.sqrt(math.prod(ends))

    @property
    def share(self) -> float | None:
        """The share of the whole time that is over; None: not known."""
        left = self.seconds
        return None if left is None else self.elapsed / max(self.elapsed + left, 1e-9)

    def _usual(self, name: str) -> float:
        """What a step takes [s]: as those of its kind so far, else by what all others took."""
        if own := self._took.get(name):
            return sum(own) / len(own)
        took = sum(map(sum, self._took.values()))
        usual = sum(len(each) * USUAL[kind] for kind, each in self._took.items())
        return USUAL.get(name, 0.0) * (took / usual if usual else 1.0)

    def begin(self, what: str) -> None:
        """A step begins, and the one before it has ended; one that is not known is a part of that."""
        step = next((name for name in USUAL if name in what), "")
        if not step:
            return
        now = self._now()
        if self._step:
            self._took.setdefault(self._step, []).append((now - self._begun) / self._number)
        self._step, self._begun, self._number = step, now, 1.0
        number = re.match(r"effect (\d+) of about (\d+)", what)
        if number:
            self._round, self._likely = int(number[1]), int(number[2])
        if number or step == AGAIN:
            self._again = self._again + 1 if step == AGAIN else 0
            fewest = self._round - (step != AGAIN)
            self._left = [self._following(n) for n in (fewest, max(fewest, self._likely))]
        elif step in LAST and self._round:
            effects = self._round - 1
            self._number = max(effects, 1) if step == OF_EACH else 1
            self._left = [_last(effects, LAST[LAST.index(step) + 1 :])]

    def _following(self, effects: int) -> dict[str, float]:
        """The number of each kind of step that follows the present one, if so many effects are found."""
        present = self._round
        left = dict.fromkeys(ROUND, float(effects + 1 - present))
        left[ROUND[1]] += self._step == ROUND[0]
        # With each further effect the place of each before it is searched again.
        again = sum(range(present, effects)) + max(present - 1 - self._again, 0) * (effects >= present)
        return left | {AGAIN: float(again)} | _last(effects, LAST)


def _last(effects: int, steps: Sequence[str]) -> dict[str, float]:
    """The number of each of some steps behind a search that found so many effects."""
    numbers = dict.fromkeys(OF_EFFECTS, float(effects > 0)) | {OF_EACH: float(effects)}
    return {name: numbers.get(name, 1.0) for name in steps}
