"""The force that nobody recorded: how large, how long it lasts, and disturbances at single times.

Such a disturbance is a stretch in which the force that is left is beyond what chance gives anywhere
in the runs, were it as large there as it usually is. Its beginning, end and size are those of the
constant force that explains most of what is left around. It is reported, and never a part of a model.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fmus.effects.text import number, signed

from ...predictors import Model, WeakWindows, omega
from ...predictors.uncertainty import NOISE_TOLERANCE, omega_std
from ...predictors.weak_form import BLOCK, kernel_integral
from ...runs.sensors.evidence import spread_of
from ..findings import MOST_REPORTED
from ..most_likely import beyond
from .disturbance import ForceDisturbance

AXES, UNITS, NAMES = ("X", "Y", "N"), ("N", "N", "N m"), ("surge", "sway", "yaw")


class Stretch(NamedTuple):
    """A disturbance at a single time: run, axis X, Y or N, start, end [s], mean force [N or N m]."""

    run: str
    axis: str
    start: float
    end: float
    size: float


@dataclass(frozen=True, eq=False)
class Unrecorded:
    """What acts and is in no command and no effect.

    Attributes:
        disturbance: its size and correlation time on each axis.
        differing: values of which the two fits differ by more than their intervals -> the value by the
            model error, and by predictions.
        stretches: disturbances at single times, the clearest first.
    """

    disturbance: ForceDisturbance
    differing: Mapping[str, tuple[float, float]]
    stretches: Sequence[Stretch]

    @property
    def sentence(self) -> str:
        """What is to be said of it."""
        size = zip(NAMES, self.disturbance.size, UNITS, self.disturbance.time, strict=True)
        stated = [
            f"{number(x, 2)} {unit} in {name} over {t:.2g} s" for name, x, unit, t in size if x > 0.0
        ]
        text = "No disturbance is detected. "
        if stated:
            text = f"A disturbance remains, with size and correlation time: {', '.join(stated)}. "
            text += "Intervals and bands are wider by its uncertainty. "
        if self.differing:
            text += (
                "The difference is significant: the fit to the model error and the fit to "
                f"predictions differ by more than their intervals in {', '.join(self.differing)}. "
            )
        return (text + self.at_single_times).strip()

    @property
    def at_single_times(self) -> str:
        """The disturbances at single times; empty where there are none."""
        named = {axis: f"{unit} in {name}" for axis, unit, name in zip(AXES, UNITS, NAMES, strict=True)}
        times = ((s, f"{s.run} {s.start:.1f} to {s.end:.1f} s") for s in self.stretches)
        each = [f"{time}, {signed(s.size, 2, '+')} {named[s.axis]}" for s, time in times]
        return f"Disturbances at single times: {'; '.join(each)}." if each else ""


def unrecorded(
    runs: Sequence[WeakWindows],
    model: Model,
    disturbance: ForceDisturbance,
    differing: Mapping[str, tuple[float, float]],
) -> Unrecorded:
    """What acts unrecorded in runs that a model was fitted to; arguments as the result has them."""
    left = [omega(w, model) for w in runs]
    noise = [NOISE_TOLERANCE * omega_std(w, model) for w in runs]
    # As far as the noise of the measurement allows, the same in all runs.
    whole = np.concatenate(left)
    usual = [spread_of(np.append(x, -x)) for x in whole.T]  # about zero
    limit = beyond(whole.size)
    found = []
    for w, error, std in zip(runs, left, noise, strict=True):
        for k in range(3):
            found += _disturbances(w, k, error[:, k], np.maximum(std[:, k], usual[k]), limit)
    clearest = sorted(found, key=lambda f: -f[0])[:MOST_REPORTED]
    return Unrecorded(disturbance, differing, [stretch for _, stretch in clearest])


def _disturbances(
    w: WeakWindows, axis: int, error: np.ndarray, std: np.ndarray, limit: float
) -> Iterator[tuple[float, Stretch]]:
    """Disturbances of a run on an axis, each with how many standard deviations are left at its clearest.

    What lasts longer than a block is a remainder, and what is shorter than a third of a window of
    the weak form cannot be distinguished from a jump of the measured pose.
    """
    z = error / std
    rows = np.flatnonzero(np.abs(z) > limit)
    for part in np.split(rows, np.flatnonzero(np.diff(w.middle[rows]) > w.width) + 1):
        if part.size and w.middle[part[-1]] - w.middle[part[0]] <= BLOCK * w.scale.time:
            near = np.abs(w.middle - w.middle[part].mean()) <= 0.5 * np.ptp(w.middle[part]) + w.width
            start, end, size = box(w, near, error[near])
            if end - start >= 2.0 * w.every:
                yield np.abs(z[part]).max(), Stretch(w.run.name, AXES[axis], start, end, size)


def box(w: WeakWindows, near: np.ndarray, error: np.ndarray) -> tuple[float, float, float]:
    """Start, end [s] and size of the constant force whose means are next to an error (k,) [N or N m].

    The error is that in some of the windows of a run, those ``near`` (K,).
    """
    middle, half = w.middle[near], 0.5 * w.width
    times = np.arange(middle[0] - half, middle[-1] + half, 0.5 * w.every)
    passed = kernel_integral(np.clip((times[:, None] - middle) / half, -1.0, 1.0))
    first, last = np.triu_indices(times.size, 1)
    means = passed[last] - passed[first]
    power = np.einsum("ij,ij->i", means, means)
    along = means @ error
    best = int(np.argmax(along**2 / np.maximum(power, np.finfo(float).eps)))
    return float(times[first[best]]), float(times[last[best]]), float(along[best] / power[best])
