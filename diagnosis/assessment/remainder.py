"""The remainder: what a model leaves of the model error, against what the measurement's noise gives.

Two statistics are tested on each axis, r the model error of a window and s its standard deviation by
noise, over K windows of which OVERLAP count as one:

- size: sum of (r / s)^2 / OVERLAP is chi-square with K / OVERLAP degrees of freedom, for noise alone;
- slow part: the means m over spans of n windows, twice a window's width, so that m is slower than a
  window. omega is a second derivative of the pose, so noise hardly gives any:
  var m <= s^2 slow_noise OVERLAP / n, and sum m^2 / var m is chi-square too.

The first sees any error that is larger than the noise, the second a smaller one that lasts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ..predictors import Model, WeakWindows, omega
from ..predictors.uncertainty import NOISE_TOLERANCE, SHARE_OF_COMMAND, omega_std
from ..predictors.weak_form import EVERY, OVERLAP, WIDTH, commanded
from .clusters import numbered
from .covariates import AXES
from .settings import SETTINGS


@dataclass(frozen=True)
class AxisRemainder:
    """What is left on one axis.

    Attributes:
        rms: of the model error that is left [N or N m].
        uncertainty: RMS of its standard deviation by noise [N or N m].
        share: its sum of squares over that of the first model error.
        slow: RMS of the part that lasts longer than a window [N or N m].
        p_value: of the clearer of the two tests, not corrected for their number.
        least: from which on a remainder matters [N or N m].
        significant: whether it is more than chance, and matters.
    """

    rms: float
    uncertainty: float
    share: float
    slow: float
    p_value: float
    least: float
    significant: bool

    @property
    def beyond_chance(self) -> bool:
        """Whether more is left than noise gives, be it so little that it does not matter."""
        return self.p_value < level()


def remaining(runs: Sequence[WeakWindows], start: Model, model: Model) -> dict[str, AxisRemainder]:
    """The residual of a model on each axis of some runs, compared with that of the first one."""
    before, after = ([omega(w, m) for w in runs] for m in (start, model))
    return axis_remainders(runs, before, after, [omega_std(w, start) for w in runs], start)


def any_significant(runs: Sequence[WeakWindows], start: Model, model: Model) -> bool:
    """Whether a model leaves a significant residual on some axis."""
    return any(axis.significant for axis in remaining(runs, start, model).values())


def axis_remainders(
    data: Sequence[WeakWindows],
    before: Sequence[np.ndarray],
    after: Sequence[np.ndarray],
    std: Sequence[np.ndarray],
    model: Model,
) -> dict[str, AxisRemainder]:
    """What a model leaves on each axis, X, Y and N.

    Args:
        data: windows of each run.
        before, after: of each run the model error (K, 3) of the first model and of this [N, N, N m].
        std: of each run its standard deviation by noise (K, 3) [N, N, N m].
        model: the first one.
    """
    command = commanded(data, model)
    first, left, noise = (np.concatenate(x) for x in (before, after, std))
    groups = spans(data)
    found = {}
    for k, axis in enumerate(AXES):
        size, dof = _rms(left[:, k] / noise[:, k]) / NOISE_TOLERANCE, len(left) / OVERLAP
        by_size = float(chdtrc(dof, dof * size**2))
        slow, by_slowness = _slow_part(left[:, k], noise[:, k], groups)
        rms, start, uncertainty = (_rms(x[:, k]) for x in (left, first, noise))
        least = max(SETTINGS.share_of_first * start, SHARE_OF_COMMAND * _rms(command[:, k]))
        matters = (by_size < level() and rms > least) or (by_slowness < level() and slow > least)
        share = (rms / start) ** 2 if start > 0.0 else 0.0
        p_value = min(by_size, by_slowness)
        found[axis] = AxisRemainder(rms, uncertainty, share, slow, p_value, least, matters)
    return found


def spans(data: Sequence[WeakWindows]) -> np.ndarray:
    """(K,), number of the span that each window of some runs lies in, over all runs."""
    since = [np.rint((w.middle - w.middle[0]) / w.every) for w in data]
    return numbered([s // span_windows() for s in since])


def level() -> float:
    """Of each of two tests on each axis, by Bonferroni's correction."""
    return SETTINGS.chance / (2 * len(AXES))


def span_windows() -> int:
    """How many windows a span has."""
    return round(2 * WIDTH / EVERY)


def _slow_part(left: np.ndarray, noise: np.ndarray, groups: np.ndarray) -> tuple[float, float]:
    """RMS of the means over spans, less that of noise, and the p-value that they are noise."""
    count = np.bincount(groups)
    full = 2 * count >= span_windows()
    if not full.any():
        return 0.0, 1.0
    mean = (np.bincount(groups, left) / count)[full]
    variance = (np.bincount(groups, noise**2) / count * SETTINGS.slow_noise * OVERLAP / count)[full]
    weight = count[full] / count[full].sum()
    slow = float(np.sqrt(max(weight @ (mean**2 - variance), 0.0)))
    p_value = float(chdtrc(full.sum(), np.sum(mean**2 / variance) / NOISE_TOLERANCE**2))
    return slow, p_value


def _rms(x: np.ndarray) -> float:
    return float(np.sqrt(np.mean(x**2)))


@dataclass(frozen=True)
class Remainder:
    """What a model leaves of the model error.

    Attributes:
        axes: X, Y, N -> what is left there.
        sentence: how much, where, with what it repeats, and what that suggests.
    """

    axes: Mapping[str, AxisRemainder]
    sentence: str

    @property
    def significant(self) -> bool:
        """Whether more is left on some axis than chance gives, and it matters."""
        return any(a.significant for a in self.axes.values())

    @property
    def beyond_chance(self) -> bool:
        """Whether more is left on some axis than chance gives."""
        return any(a.beyond_chance for a in self.axes.values())
