"""The remainder: what a model leaves of the model error, against what the measurement's noise gives.

Two statistics are tested on each axis, r the model error of a window and s its standard deviation by
noise, over K windows of which OVERLAP count as one:

- size: sum of (r / s)^2 / OVERLAP is chi-square with K / OVERLAP degrees of freedom, for noise alone;
- slow part: the means m over spans of n windows, twice a window's width, so that m is slower than a
  window. omega is a second derivative of the pose, so noise hardly gives any:
  var m <= s^2 slow_noise OVERLAP / n, and sum m^2 / var m is chi-square too.

The first sees any error that is larger than the noise, the second a smaller one that lasts. An estimated
noise is itself uncertain: with the relative standard deviation v its variance has 1 / (2 v^2) degrees of
freedom, and the ratio of the two variances is F-distributed (Fisher). Where samples say nothing of the
noise, nothing is significant. An upper bound of the noise needs no such allowance.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, fdtrc

from fmus.effects.text import enumeration, number
from fmus.scale import REFERENCE, Scale

from ...predictors import Model, WeakWindows, omega
from ...predictors.uncertainty import NOISE_TOLERANCE, SHARE_OF_COMMAND, omega_std
from ...predictors.weak_form import EVERY, OVERLAP, WIDTH, commanded
from ...runs.run_constants import CHANCE, NEGLIGIBLE
from ..covariates import AXES
from ..regions import NAMES, UNITS, Region, numbered
from .recurrence import TOGETHER, Recurrence

CHANCE_OF_ONE = CHANCE / (2 * len(AXES))  # 1, of each of two tests on each axis, by Bonferroni
SPAN = round(2 * WIDTH / EVERY)  # 1, windows
NOTHING_LEFT = "The residual of the model is within the uncertainty of the measurement."
LITTLE_LEFT = (
    "The residual of the model exceeds the noise of the measurement, but is less than 5 % of the "
    "initial model error or 2 % of the commanded force."
)
# Space in which most repeats -> how, and what kind of cause does so.
REPEATS = {
    "place": (
        "depends on the position",
        "a cause that is fixed in the basin, such as a bank, shallow water or a current",
    ),
    "heading": (
        "depends on the heading",
        "wind or current, or an error of the compass that varies with the heading",
    ),
    "motion": (
        "depends on speed, drift and yaw rate",
        "a force on the hull whose shape no known effect has",
    ),
    "command": (
        "depends on the commands",
        "a thruster force that differs from the thruster model in a shape that no effect has, or one "
        "to which a controller reacts",
    ),
    TOGETHER: (
        "depends on position and motion together",
        "a force on the hull that differs from place to place, as in shallow water or near a bank",
    ),
    "time": (
        "depends on the time since the start of a run",
        "an event at the same time of each run, or a drift",
    ),
}
IN_PART = (
    "is proportional to the command of its axis for some time only",
    "a thruster whose force is lower at times, as it fails and recovers, cavitates, draws air or has "
    "less power",
)
CHANGES = (
    "changes at about {1:.0f} s of {0}, and is another function of speed and command from then on",
    "an event at that time, such as an actuator that sticks or fails, a change of load, or other water "
    "(learn --split {0}@{1:.0f} gives both parts values of their own)",
)
IN_ONE_RUN = (
    "occurs in {0} alone, so that these runs do not show what it depends on",
    "something that differed in that run, such as its place, load, water or weather",
)
OF_NONE = "does not follow from position, heading, motion, command or time alone, and "
LASTS = (
    OF_NONE + "lasts for about {0:.0f} s at a time",
    "a disturbance, such as gusts or a towed cable, an error of the measurement or of logged commands "
    "that lasts so long, or a force that depends on several of these together",
)
THROUGHOUT = (
    OF_NONE + "lasts through whole runs",
    "a force that differs from run to run, such as that of wind or current, or one that is commanded "
    "otherwise than recorded",
)
BRIEF = (
    OF_NONE + "lasts for {0:.2g} s at the most, the width of a window",
    "waves, a disturbance of the measurement, or commands that differ from the recorded ones",
)


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
        of_command: the RMS over that of the commanded force; NaN where nothing is commanded.
    """

    rms: float
    uncertainty: float
    share: float
    slow: float
    p_value: float
    least: float
    significant: bool
    of_command: float

    @property
    def beyond_chance(self) -> bool:
        """Whether more is left than noise gives, be it so little that it does not matter."""
        return self.p_value < CHANCE_OF_ONE

    @property
    def is_slow(self) -> bool:
        """Whether most of it, beyond the noise, lasts longer than a window, which no wave does."""
        return 2.0 * self.slow**2 > self.rms**2 - self.uncertainty**2


def remaining(runs: Sequence[WeakWindows], start: Model, model: Model) -> dict[str, AxisRemainder]:
    """The residual of a model on each axis of some runs, compared with that of the first one."""
    before, after = ([omega(w, m) for w in runs] for m in (start, model))
    return axis_remainders(runs, before, after, noise_of(runs, start, model), start)


def remains(runs: Sequence[WeakWindows], start: Model, model: Model) -> bool:
    """Whether a model leaves a significant residual."""
    return any(axis.significant for axis in remaining(runs, start, model).values())


def noise_of(runs: Sequence[WeakWindows], start: Model, model: Model) -> list[np.ndarray]:
    """Of each run the std (K, 3) of the first model's error by noise, behind a model's measurement."""
    return [omega_std(w, replace(start, measurement=model.measurement)) for w in runs]


def axis_remainders(
    data: Sequence[WeakWindows],
    before: Sequence[np.ndarray],
    after: Sequence[np.ndarray],
    std: Sequence[np.ndarray],
    model: Model,
) -> dict[str, AxisRemainder]:
    """What a model leaves on each axis, by the model error of the first model and of this.

    These, and their standard deviation by noise, are (K, 3) of each run [N, N, N m].
    """
    command = commanded(data, model)
    first, left, noise = (np.concatenate(x) for x in (before, after, std))
    groups, freedom = spans(data), noise_freedom(data, std)
    found = {}
    for k, axis in enumerate(AXES):
        size, dof = _rms(left[:, k] / noise[:, k]) / NOISE_TOLERANCE, len(left) / OVERLAP
        by_size = chance(dof, size**2, freedom[k])
        slow, by_slowness = _slow_part(left[:, k], noise[:, k], groups, freedom[k])
        rms, start, uncertainty = (_rms(x[:, k]) for x in (left, first, noise))
        force = _rms(command[:, k])
        least = max(NEGLIGIBLE * start, SHARE_OF_COMMAND * force)
        beyond = rms**2 - uncertainty**2 > least**2  # without the noise, as the slow part is
        matters = (by_size < CHANCE_OF_ONE and beyond) or (by_slowness < CHANCE_OF_ONE and slow > least)
        share = (rms / start) ** 2 if start > 0.0 else 0.0
        of_command = rms / force if force > 0.0 else np.nan
        p_value = min(by_size, by_slowness)
        found[axis] = AxisRemainder(rms, uncertainty, share, slow, p_value, least, matters, of_command)
    return found


def noise_freedom(data: Sequence[WeakWindows], std: Sequence[np.ndarray]) -> np.ndarray:
    """Degrees of freedom (3,) of the variance by noise on each axis; infinite where it is known.

    Args:
        data: windows of every run.
        std: of each run, (K, 3), standard deviation of the model error by noise.
    """
    power = np.array([np.sum(each**2, axis=0) for each in std])
    share = power / np.maximum(power.sum(axis=0), np.finfo(float).tiny)
    channels = [np.where(w.smoothed.noise_at_most, 0.0, w.smoothed.noise_rel_std) for w in data]
    of_axis = np.array([(max(v[:2]), max(v[:2]), v[2]) for v in channels])
    with np.errstate(divide="ignore"):
        return 0.5 / np.sum((share * of_axis) ** 2, axis=0)


def chance(dof: float, ratio: float, freedom: float) -> float:
    """Chance of so large a ratio of a variance to that of the noise, or a larger one.

    Args:
        dof: degrees of freedom of the variance.
        ratio: of the two.
        freedom: degrees of freedom of that of the noise.
    """
    if not freedom:
        return 1.0
    if np.isinf(freedom):
        return float(chdtrc(dof, dof * ratio))
    return float(fdtrc(dof, freedom, ratio))


def spans(data: Sequence[WeakWindows]) -> np.ndarray:
    """(K,), number of the span that each window of some runs lies in, over all runs."""
    since = [np.rint((w.middle - w.middle[0]) / w.every) for w in data]
    return numbered([s // SPAN for s in since])


def _slow_part(
    left: np.ndarray, noise: np.ndarray, groups: np.ndarray, freedom: float
) -> tuple[float, float]:
    """RMS of the means over spans, less that of noise, and the p-value that they are noise."""
    count = np.bincount(groups)
    full = 2 * count >= SPAN
    if not full.any():
        return 0.0, 1.0
    mean = (np.bincount(groups, left) / count)[full]
    # As if windows were independent: measured, without a hidden cause, it is a sixth to a half of that.
    variance = (np.bincount(groups, noise**2) / count / count)[full]
    weight = count[full] / count[full].sum()
    slow = float(np.sqrt(max(weight @ (mean**2 - variance), 0.0)))
    ratio = float(np.mean(mean**2 / variance)) / NOISE_TOLERANCE**2
    return slow, chance(int(full.sum()), ratio, freedom)


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


def remainder_sentence(
    axes: Mapping[str, AxisRemainder],
    how: Sequence[Recurrence] | None,
    regions: Sequence[Region],
    waves: bool,
    scale: Scale = REFERENCE,
) -> str:
    """The remainder of all axes in words.

    Args:
        axes: X, Y, N -> what is left.
        how: of each axis how it comes again; None where nothing is left.
        regions: where the model that is judged fails, the clearest of an axis first.
        waves: whether waves were found, which the model cannot take away.
        scale: of the ship.
    """
    left = [axis for axis in axes if axes[axis].significant]
    if not left or how is None:
        return LITTLE_LEFT if any(a.beyond_chance for a in axes.values()) else NOTHING_LEFT
    parts: dict[tuple[str, str], list[str]] = {}
    for k, axis in enumerate(axes):
        if axis in left:
            parts.setdefault(_kind(how[k], WIDTH * scale.time), []).append(axis)
    texts = []
    for (comes, cause), group in parts.items():
        amounts = enumeration([_amount(axis, axes[axis]) for axis in group])
        where = [r for axis in group for r in regions if r.axis == axis][:1]
        place = f", most {where[0].phrase}" if where else ""
        texts.append(f"{amounts} not explained{place}. It {comes}: this suggests {cause}.")
    if waves:
        texts.append("Part of it is the detected waves, whose timing is not predictable.")
    return " ".join(texts)


def _amount(axis: str, r: AxisRemainder) -> str:
    shares = {
        "initial model error": 100.0 * np.sqrt(r.share),
        "commanded force": 100.0 * r.of_command,
    }
    stated = [f", {share:.2g} % of the {whole}" for whole, share in shares.items() if share < 99.5]
    size = f"{NAMES[axis]}: {number(r.rms, 2)} {UNITS[axis]}"
    return f"{size} (uncertainty {number(r.uncertainty, 1)}{''.join(stated)})"


def _kind(r: Recurrence, briefly: float) -> tuple[str, str]:
    if r.changes:
        return CHANGES[0].format(*r.changes), CHANGES[1].format(*r.changes)
    if r.in_part and r.best != "place":
        return IN_PART
    if r.best is not None:
        return REPEATS[r.best]
    if r.run:
        return IN_ONE_RUN[0].format(r.run), IN_ONE_RUN[1]
    if np.isinf(r.lasts):
        return THROUGHOUT
    if r.lasts > briefly:
        return LASTS[0].format(r.lasts), LASTS[1]
    return BRIEF[0].format(briefly), BRIEF[1]
