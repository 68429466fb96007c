"""How long a search for effects still takes, by the steps that have ended and those that usually follow.

The number of effects is known only in the end. The search forecasts it by regressions of all candidates,
and anew beside each effect that it accepts (:mod:`diagnosis.search.forward_selection`). A kind of step
that has ended takes its mean time; any other one its usual time, scaled by what all steps took.
"""

import math
import re
import time
from collections.abc import Callable, Sequence

ROUND = ("every effect as a candidate", "candidates refined")
AGAIN = "its place searched again"  # of one effect, each time that another one is found
OF_EACH = "validation data are predicted better"  # for each effect
OF_EFFECTS = (OF_EACH, "fit to predictions")  # only where there is one
# s of processor time, medians of six logs (benchmarks/code.md). In their order.
USUAL = {
    "calibration of the coefficients": 0.6,
    **dict(zip(ROUND, (0.65, 1.35), strict=True)),
    AGAIN: 0.85,
    "waves": 0.85,
    **dict(zip(OF_EFFECTS, (0.5, 1.9), strict=True)),
    "gain of the search over calibration": 0.2,
    "residual": 0.2,
    "predicting": 0.2,
    "stability": 1.1,
    "report: figures": 0.2,
    "report: page": 0.2,
}
LAST = [*USUAL][[*USUAL].index(AGAIN) + 1 :]  # steps behind the search
# Steps that take as long for few data as for many. Whether other steps took long because the data are
# many or because the machine is slow is not known: these are scaled by the root.
FIXED = {"gain of the search over calibration", "stability", "report: figures", "report: page"}
FIRST = 1.9  # 1, the first regression of all candidates over each later one; median of the same logs
# 1, refining candidates of which none is accepted over refining others; a third in the median.
REJECTED = 0.3
# 1, share of its time that a step is taken to go on for where it takes longer than usual; chosen.
LATE = 0.3


class RemainingTime:
    """The remaining time of ``learn``, once its search has an effect and a second forecast, or ended.

    Args:
        now: the time [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now, self._started = now, now()
        self._step, self._begun, self._round, self._again = "", self._started, 0, 0
        self._likely: int | None = None  # number of effects
        self._took: dict[str, list[float]] = {}  # kind of step -> how long each took, over its number
        self._number = 1.0  # of the present step: where it takes as long as several of its kind
        self._left: dict[str, float] | None = None  # number of each kind of step; None: not known yet

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return self._now() - self._started

    @property
    def seconds(self) -> float | None:
        """The remaining time [s]; None: not known yet."""
        if self._left is None:
            return None
        spent = self._now() - self._begun
        present = max(self._number * self._usual(self._step) - spent, LATE * spent)
        return present + sum(n * self._usual(name) for name, n in self._left.items())

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
        scale = took / usual if usual else 1.0
        return USUAL.get(name, 0.0) * (math.sqrt(scale) if name in FIXED else scale)

    def begin(self, what: str) -> None:
        """A step begins, and the one before it has ended; one that is not known is a part of that."""
        step = next((name for name in USUAL if name in what), "")
        if not step:
            return
        now = self._now()
        if self._step == ROUND[1] and step in LAST:
            self._number = REJECTED
        if self._step:
            self._took.setdefault(self._step, []).append((now - self._begun) / self._number)
        self._step, self._begun = step, now
        self._number = FIRST if what == ROUND[0] else 1.0
        turn = step in ROUND and re.match(r"effect (\d+)(?:, about (\d+) likely)?", what)
        if turn:
            self._round = int(turn[1])
            self._likely = int(turn[2]) if turn[2] else self._likely
        if self._likely is not None and (turn or step == AGAIN):
            self._again = self._again + 1 if step == AGAIN else 0
            found = self._round - (step != AGAIN)
            self._left = self._following(max(found, self._likely))
        elif step in LAST and ROUND[1] in self._took:
            effects = max(self._round - 1, 0)
            self._number = max(effects, 1) if step == OF_EACH else 1
            self._left = _last(effects, LAST[LAST.index(step) + 1 :])

    def _following(self, effects: int) -> dict[str, float]:
        """The number of each kind of step that follows the present one, if so many effects are found."""
        present = self._round
        left = dict.fromkeys(ROUND, float(effects + 1 - present))
        if self._step == ROUND[0] or effects >= present:
            left[ROUND[1]] += (self._step == ROUND[0]) + REJECTED - 1.0  # the last one is rejected
        # With each further effect the place of each before it is searched again.
        again = sum(range(present, effects)) + max(present - 1 - self._again, 0) * (effects >= present)
        return left | {AGAIN: float(again)} | _last(effects, LAST)


def _last(effects: int, steps: Sequence[str]) -> dict[str, float]:
    """The number of each of some steps behind a search that found so many effects."""
    numbers = dict.fromkeys(OF_EFFECTS, float(effects > 0)) | {OF_EACH: float(effects)}
    return {name: numbers.get(name, 1.0) for name in steps}
