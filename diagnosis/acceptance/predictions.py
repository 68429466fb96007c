"""The windows that criteria judge: the motion at their horizon, predicted and measured."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from cosim import InputError
from fmus.ops import wrap

from ..predictors import Model
from ..predictors.evaluation import Evaluation
from ..runs import Smoothed, body_velocity
from ..runs.run_constants import NEGLIGIBLE
from .criterion import JUDGED


class Predictions:
    """Predictions of a run in windows of one length.

    Args:
        e: the run with what predicts it: the learned model, or the initial one.
        horizon: of the predictions [s].

    Attributes:
        name: of the run.
        windows: of that length; of a predictor whose velocity cannot be set one, the whole run.
        possible: windows that there would be, were no sample missing.
        after: (w,), time of prediction that is judged [s].
        rows: (w,), row of the last sample of each, near the horizon.
        measured: (w, 6), the sample of the pose there, and the smoothed velocity.

    Raises:
        InputError: no window has enough samples.
    """

    def __init__(self, e: Evaluation, horizon: float) -> None:
        self.name, self.smoothed, self.predictor = e.name, e.smoothed, e.predictor
        self._learned = [] if e.learned is None else [e.learned]
        self.model = (e.learned or e.model).during(e.name)
        none = InputError(f"run '{e.name}' has no window of {horizon:g} s with enough samples")
        windows = self.predictor.windows([self.smoothed], horizon)
        if windows is None:
            raise none
        self.windows, begin = windows, self.predictor.run_in(self.smoothed)
        until = begin + horizon
        place = np.flatnonzero(self.windows.since <= until + 1e-9)
        window = self.windows.sample_window[place]
        last = place[np.append(window[1:] != window[:-1], True)] if place.size else place
        late = max(NEGLIGIBLE * horizon, 1.5 * self.smoothed.track.period)
        last = last[self.windows.since[last] >= until - late]
        # Three samples of the same window give the slope of the pose at the last of them.
        last = last[last >= 2]
        self._last = last[self.windows.sample_window[last - 2] == self.windows.sample_window[last]]
        if not self._last.size:
            raise none
        window = self.windows.sample_window[self._last]
        self._since = self.windows.since
        self.after = self._since[self._last] - begin
        time = self.windows.start[window] + self._since[self._last]
        whole, seconds = self.predictor.whole, possible(self.smoothed, horizon)
        self.possible = self._last.size if whole else max(seconds, self._last.size)
        self.first = np.searchsorted(self.smoothed.time, self.windows.start[window] + begin - 1e-6)
        self.rows = np.searchsorted(self.smoothed.time, time - 1e-6)
        self.measured = np.hstack([self.windows.measured[self._last], self.smoothed.nu[self.rows]])

    @property
    def start(self) -> np.ndarray:
        """(w,), times at which the predictions that are judged begin [s]."""
        return self.smoothed.time[self.first]

    @cached_property
    def residuals(self) -> np.ndarray:
        """(samples, 3), measured minus predicted pose [m, m, rad] at the samples of the windows."""
        return self.predictor.residuals(self.windows, self._learned)[-1]

    @cached_property
    def motion(self) -> np.ndarray:
        """(w, 6), the predicted motion at the horizon."""
        return self._at_end(self.residuals)

    def finer(self, parts: int) -> np.ndarray:
        """The predicted motion (w, 6) of which each step is divided into so many."""
        return self._at_end(self.predictor.residuals(self.windows.finer(parts), self._learned)[-1])

    def with_addition(self, changes: Mapping[str, float]) -> np.ndarray:
        """The predicted motion (w, 6) with additions to parameters of effects."""
        added = [m.plus(changes) for m in self._learned or [self.predictor.model]]
        return self._at_end(self.predictor.residuals(self.windows, added)[-1])

    def from_others(self, states: Sequence[Smoothed]) -> list[np.ndarray]:
        """The predicted motion (w, 6) from each of some other states of the run on."""
        windows = self.predictor.windows(states, self.windows.length)
        assert windows is not None  # as of the run itself
        residuals = self.predictor.residuals(windows, self._learned)[-1]
        return [self._at_end(r) for r in np.split(residuals, len(states))]

    def motions(self, models: Sequence[Model]) -> list[np.ndarray]:
        """The predicted motion (w, 6) of each of some models of this project."""
        return [self._at_end(r) for r in self.windows.residuals_of_each(models)]

    def _at_end(self, residuals: np.ndarray) -> np.ndarray:
        """The last pose, and the slope of the parabola through the last three as velocity."""
        pose = self.windows.measured - residuals
        k = self._last
        t0, t1, t2 = (self._since[j] for j in (k - 2, k - 1, k))
        one, two = pose[k - 1] - pose[k - 2], pose[k] - pose[k - 1]
        one[:, 2], two[:, 2] = wrap(one[:, 2]), wrap(two[:, 2])
        one, two = one / (t1 - t0)[:, None], two / (t2 - t1)[:, None]
        rate = two + (two - one) * ((t2 - t1) / (t2 - t0))[:, None]
        return np.column_stack([pose[k], body_velocity(pose[k, 2], rate)])


def possible(smoothed: Smoothed, horizon: float) -> int:
    """Windows of a length [s] that there would be in a run, were no sample missing."""
    return int((smoothed.time[-1] - smoothed.time[0] + smoothed.track.period) // horizon)


def difference(motion: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Motions (..., 6) less others, headings wrapped."""
    found = motion - other
    found[..., 2] = wrap(found[..., 2])
    return found


def judged(quantity: str, off: np.ndarray) -> np.ndarray:
    """(w,), what a difference (w, 6) is in a quantity that is judged: of position the distance."""
    named = dict(zip(JUDGED, (np.hypot(off[:, 0], off[:, 1]), *off.T[2:]), strict=True))
    return named[quantity]
