"""The remainder: what a model leaves of the model error, against what the measurement's noise gives.

Two statistics are tested on each axis, r the model error of a window and s its standard deviation by
noise, over K windows of which OVERLAP count as one:

- size: sum of (r / s)^2 / OVERLAP is chi-square with K / OVERLAP degrees of freedom, for noise alone;
- slow part: the means m over SPAN neighbouring windows. omega is a second derivative of the pose, so
  noise hardly gives any: var m <= s^2 SLOW_NOISE OVERLAP / SPAN, and sum m^2 / var m is chi-square too.

The first sees any error that is larger than the noise, the second a smaller one that lasts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from ..predictors import Model, WeakWindows, omega
from ..predictors.uncertainty import NOISE_TOLERANCE, SHARE_OF_COMMAND, omega_std
from ..predictors.weak_form import OVERLAP, commanded
from .covariates import AXES

CHANCE = 0.01  # level of the test, all axes and both statistics together; contract
SHARE_OF_FIRST = 0.05  # of an axis' first model error, from which a remainder matters; contract
SPAN = 12  # windows: twice their width, so that what is left is slower than a window; chosen
# Variance of a mean of SPAN windows by noise alone, as a share of that of independent windows: measured
# 0.04 to 0.13 on runs without a hidden cause, and doubled.
SLOW_NOISE = 0.25
TESTS = 6  # three axes, two statistics: Bonferroni


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
        return self.p_value < CHANCE / TESTS


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
        size = float(np.mean((left[:, k] / noise[:, k]) ** 2)) / NOISE_TOLERANCE**2
        dof = len(left) / OVERLAP
        by_size = float(chdtrc(dof, dof * size))
        slow, by_slowness = _slow_part(left[:, k], noise[:, k], groups)
        rms, start = _rms(left[:, k]), _rms(first[:, k])
        least = max(SHARE_OF_FIRST * start, SHARE_OF_COMMAND * _rms(command[:, k]))
        level = CHANCE / TESTS
        matters = (by_size < level and rms > least) or (by_slowness < level and slow > least)
        share = (rms / start) ** 2 if start > 0.0 else 0.0
        p_value = min(by_size, by_slowness)
        uncertainty = _rms(noise[:, k])
        found[axis] = AxisRemainder(rms, uncertainty, share, slow, p_value, least, matters)
    return found


def spans(data: Sequence[WeakWindows]) -> np.ndarray:
    """(K,), number of the span that each window of some runs lies in, over all runs."""
    numbers, first = [], 0
    for w in data:
        number = np.floor((w.middle - w.middle[0]) / (SPAN * w.every) + 1e-9).astype(int)
        numbers.append(first + number)
        first += int(number[-1]) + 1
    return np.unique(np.concatenate(numbers), return_inverse=True)[1]


def _slow_part(left: np.ndarray, noise: np.ndarray, groups: np.ndarray) -> tuple[float, float]:
    """RMS of the means over spans, less that of noise, and the p-value that they are noise."""
    count = np.bincount(groups)
    full = count >= SPAN / 2
    if not full.any():
        return 0.0, 1.0
    mean = (np.bincount(groups, left) / count)[full]
    variance = (np.bincount(groups, noise**2) / count * SLOW_NOISE * OVERLAP / count)[full]
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
