"""How long a search for effects still takes, by the steps that have ended and those that usually follow.

The number of effects is known only in the end. The time that is left if no further one is found is the
least that is possible; :data:`MORE` times that is stated. The true time is at least 0.6 of it then, and
more than twice it only where it is 3.2 times the least. Where no effect was found, none is validated
and fitted. A kind of step that has ended takes what it took; any other one its usual time, scaled by
what the steps so far took.
"""

import re
import time
from collections.abc import Callable

ROUND = ("every effect as a candidate", "candidates refined")
AGAIN = "its place searched again"  # of one effect, each time that another one is found
OF_EACH = "validation data are predicted better"  # for each effect
OF_EFFECTS = (OF_EACH, "fit to predictions")  # only where there is one
# s of processor time for ten minutes of the Otter at 10 Hz; only their ratios count. In their order.
USUAL = {
    "reading": 0.1,
    "smoothing": 1.4,
    "calibration of the coefficients": 2.4,
    **dict(zip(ROUND, (0.8, 1.1), strict=True)),
    AGAIN: 4.8,
    "waves": 0.6,
    **dict(zip(OF_EFFECTS, (1.2, 5.0), strict=True)),
    "residual": 0.1,
    "gain of the search over calibration": 1.5,
    "predicting": 0.8,
    "stability": 0.9,
    "report: figures": 1.1,
    "report: page": 0.3,
}
LAST = [*USUAL][[*USUAL].index(AGAIN) + 1 :]  # steps behind the search
# 1, of the remaining time of a search that finds no further effect. Chosen: the largest for which a
# search that finds none at all, one, two or three effects is within a factor of two from its first round
# on.
MORE = 1.6
# 1, share of its time that a step is taken to go on for where it takes longer than usual; chosen.
LATE = 0.3


class RemainingTime:
    """The remaining time of ``learn``, once its search has begun.

    Args:
        now: the time [s].
    """

    def __init__(self, now: Callable[[], float] = time.monotonic) -> None:
        self._now, self._started = now, now()
        self._step, self._begun, self._round, self._again = "", self._started, 0, 0
        self._took: dict[str, list[float]] = {}  # kind of step -> how long each took, over its number
        self._number = 1.0  # of the present step: of effects where it takes as long as they are many
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
        spent = self._now() - self._begun
        rest = sum(number * self._usual(name) for name, number in self._left.items())
        return max(self._number * self._usual(self._step) - spent, LATE * spent) + rest

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
        if step in ROUND or step == AGAIN:
            self._again = self._again + 1 if step == AGAIN else 0
            number = re.match(r"effect (\d+)", what)
            self._round = max(self._round, int(number[1]) if number and step in ROUND else 1)
            self._left = self._following()
        elif step in LAST and self._round:
            effects = self._round - 1.0
            self._number = max(effects, 1.0) if step == OF_EACH else 1.0
            numbers = dict.fromkeys(LAST, 1.0) | self._of_effects(effects)
            self._left = {name: numbers[name] for name in LAST[LAST.index(step) + 1 :]}

    def _of_effects(self, effects: float) -> dict[str, float]:
        """The number of steps that depend on how many effects there are."""
        return dict.fromkeys(OF_EFFECTS, min(effects, 1.0)) | {OF_EACH: effects}

    def _following(self) -> dict[str, float]:
        """The number of each kind of step that usually follows the present one of a round."""
        effects = max(self._round if self._again else self._round - 1.0, 1.0)
        left = dict.fromkeys(ROUND, effects + 1.0 - self._round)
        if self._step == ROUND[0]:
            left[ROUND[1]] += 1.0
        # With each further effect the place of each before it is searched again.
        again = max(effects - 1.0 - self._again, 0.0) if self._again else 0.0
        last = dict.fromkeys(LAST, 1.0) | self._of_effects(effects)
        steps = left | {AGAIN: again} | last
        return {name: MORE * number for name, number in steps.items()}
